"""From a raw EMG recording to activations between 0 and 1, and into a bag."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

from limb_nodes.bags.bulk import write_table
from limb_nodes.bags.versions import versions
from limb_nodes.bags.write import BagWriter
from limb_nodes.errors import FieldError, UserError
from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.foundation.parameter import Parameter
from limb_nodes.foundation.topics import TOPIC_TYPES
from limb_nodes.signals import envelope as steps
from limb_nodes.signals import units
from limb_nodes.signals.causal import CausalChain, naming
from limb_nodes.signals.envelope import DEFAULT_BAND, DEFAULT_LOW_PASS, DEFAULT_ORDER, Gaps
from limb_nodes.signals.recording import Recording

ENVELOPE_TOPIC = "emg_envelope"
ANGLE_TOPIC = "reference_angle"
REST = Parameter("rest", "s", "length of the quietest stretch", minimum=0.0)


@dataclass(frozen=True)
class EnvelopeOptions:
    """How raw EMG becomes an envelope; None leaves a step out.

    band: lower and upper edge of the band-pass (Hz). rectify: full-wave rectification.
    low_pass: corner of the smoothing (Hz). band_order, low_pass_order: even.
    rest: the quietest stretch of this length (s) is each channel's zero; 0 keeps zero at 0.
    resample: rate of the result (Hz); None keeps the recording's.
    maximum: the envelope that counts as 1, by the channel's name in the recording and in its unit; a
        channel that is not named takes the largest value of its own envelope.
    mains: frequency of the mains (Hz), 50 or 60, that a notch removes with its harmonics.
    causal: filter forward only, as live use does.
    channels: the channels to take, each with its new name; empty takes every EMG channel as it is.
    angles: the same for the columns in degrees or radians.
    skip: channels to leave out.
    """

    band: tuple[float, float] | None = DEFAULT_BAND
    band_order: int = DEFAULT_ORDER
    rectify: bool = True
    low_pass: float | None = DEFAULT_LOW_PASS
    low_pass_order: int = DEFAULT_ORDER
    rest: float = 0.0
    resample: float | None = None
    maximum: Mapping[str, float] = field(default_factory=dict)
    channels: Mapping[str, str] = field(default_factory=dict)
    angles: Mapping[str, str] = field(default_factory=dict)
    skip: Sequence[str] = ()
    mains: float | None = None
    causal: bool = False

    def as_mapping(self) -> dict[str, object]:
        """The options as plain lists, numbers and mappings, for a bag's run_info."""
        plain = asdict(self)
        plain["band"] = None if self.band is None else list(self.band)
        plain["skip"] = list(self.skip)
        return plain


@dataclass(frozen=True)
class EmgChannel:
    """What became of one channel.

    column, name: its name in the recording and its new one. maximum, rest: the levels that became 1
    and 0, in `unit`. clipped: samples above the maximum.
    """

    column: str
    name: str
    unit: str
    gaps: Gaps
    maximum: float
    rest: float
    clipped: int


@dataclass(frozen=True)
class AngleChannel:
    """What became of one angle column: its name in the recording and its new one."""

    column: str
    name: str
    gaps: Gaps


@dataclass(frozen=True)
class Envelopes:
    """Normalised envelopes of several muscles, and the joint angles recorded beside them.

    values: [samples, channels], dimensionless, 0 to 1. angles: [samples, angle columns], rad.
    rate: Hz; sample k belongs to the time k / rate.
    """

    source: str
    rate: float
    channels: tuple[EmgChannel, ...]
    values: FloatArray
    angle_channels: tuple[AngleChannel, ...]
    angles: FloatArray
    notes: tuple[str, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """The channels' new names."""
        return tuple(channel.name for channel in self.channels)


def envelopes(recording: Recording, options: EnvelopeOptions | None = None) -> Envelopes:
    """Turn a recording's EMG channels into normalised envelopes, and keep its angle columns.

    Raises FieldError if an option is out of range, names a column that is not there or is no EMG, or if a filter
    cannot work at this rate; UserError if a channel has no value or no signal.
    """
    options = options or EnvelopeOptions()
    _check_names(recording, options)
    _check_numbers(options, recording.rate)
    chosen, angle_columns = _chosen(recording, options)
    raw, gaps = _bridged(recording, [column for column, _ in chosen])
    angles, angle_gaps = _bridged(recording, [column for column, _ in angle_columns])
    angles *= np.array([units.ANGLE[recording.unit(column)] for column, _ in angle_columns])
    for i, (column, _) in enumerate(chosen):
        if np.ptp(raw[:, i]) == 0.0:
            raise UserError(
                f"{recording.source}: channel {column} is {raw[0, i]:g} everywhere; a signal, which can be normalised, "
                "is needed"
            )
    signal = _smoothed(recording, raw, options)
    with naming("rest", _of(recording)):
        rest = steps.rest_level(signal, recording.rate, options.rest) if options.rest else np.zeros(len(chosen))
    maximum = np.array([options.maximum.get(column, signal[:, i].max()) for i, (column, _) in enumerate(chosen)])
    for i, (column, _) in enumerate(chosen):
        if not maximum[i] > rest[i]:
            raise UserError(
                f"{recording.source}: the maximum of channel {column} is {maximum[i]:g}; a number > {rest[i]:g}, its "
                "rest level, is needed"
            )
    values, above = steps.normalise(signal, maximum, rest)
    rate = recording.rate
    if options.resample is not None:
        both = steps.resample(np.hstack([values, angles]), rate, options.resample)
        values, angles = both[:, : len(chosen)], both[:, len(chosen) :]
        rate = options.resample
    channels = tuple(
        EmgChannel(column, name, recording.unit(column), gaps[i], float(maximum[i]), float(rest[i]), above[i])
        for i, (column, name) in enumerate(chosen)
    )
    angle_channels = tuple(AngleChannel(column, name, angle_gaps[i]) for i, (column, name) in enumerate(angle_columns))
    notes = recording.notes + _left_out(recording, options)
    return Envelopes(recording.source, rate, channels, values, angle_channels, angles, notes)


def _smoothed(recording: Recording, raw: FloatArray, options: EnvelopeOptions) -> FloatArray:
    """Filter, rectify and smooth: [samples, channels], in the recording's units."""
    source, signal = _of(recording), raw
    if options.causal:
        return CausalChain(recording.rate, options, raw.shape[1], source).process(raw)
    if options.mains is not None:
        with naming("mains", source):
            signal = steps.notch(signal, recording.rate, options.mains)
    if options.band is not None:
        with naming("band", source):
            signal = steps.band_pass(signal, recording.rate, options.band, options.band_order)
    if options.rectify:
        signal = steps.rectify(signal)
    if options.low_pass is not None:
        with naming("low_pass", source):
            signal = steps.low_pass(signal, recording.rate, options.low_pass, options.low_pass_order)
    return signal


def _of(recording: Recording) -> str:
    """How an error about a filter begins."""
    return f"{recording.source} ({recording.rate:g} Hz)"


def _check_names(recording: Recording, options: EnvelopeOptions) -> None:
    fields = {
        "channels": options.channels,
        "angles": options.angles,
        "skip": options.skip,
        "maximum": options.maximum,
    }
    for option, names in fields.items():
        for name in names:
            if name not in recording.names:
                raise FieldError(
                    option, f"names {name!r}; one of {', '.join(recording.names)} is needed", recording.source
                )
    for name in options.channels:
        unit = recording.unit(name)
        if unit in units.ANGLE:
            raise FieldError(
                "channels",
                f"names {name!r}, which is in {unit}; a column in V, mV, uV or without a unit is needed",
                recording.source,
            )
    for name in options.angles:
        unit = recording.unit(name)
        if unit not in units.ANGLE:
            stated = f"is in {unit}" if unit else "has no unit"
            raise FieldError(
                "angles", f"names {name!r}, which {stated}; a column in deg or rad is needed", recording.source
            )


def _check_numbers(options: EnvelopeOptions, rate: float) -> None:
    for name, value in options.maximum.items():
        if not (np.isfinite(value) and value > 0):
            raise FieldError("maximum", f"of {name} is {value:g}; a number > 0 is needed")
    REST.check(options.rest)
    if options.resample is not None:
        # Less than twice the low-pass loses some of the envelope; more than ten times the rate adds nothing.
        above, least = (None, 2 * options.low_pass) if options.low_pass else (0.0, None)
        allowed = Parameter("resample", "Hz", "rate of the envelopes", above=above, minimum=least, maximum=10 * rate)
        allowed.check(options.resample)


def _is_emg(recording: Recording, column: str) -> bool:
    return recording.unit(column) == "" or recording.unit(column) in units.VOLTAGE


def _chosen(recording: Recording, options: EnvelopeOptions) -> tuple[list[tuple[str, str]], list[tuple[str, str]]]:
    """Pick the EMG and the angle columns, each as (column, new name)."""
    left = [name for name in recording.names if name not in options.skip]
    emg = [name for name in left if name in options.channels or (not options.channels and _is_emg(recording, name))]
    angle = [
        name for name in left if recording.unit(name) in units.ANGLE and (name in options.angles or not options.angles)
    ]
    if not emg:
        raise UserError(
            f"{recording.source}: no EMG channel is left of {', '.join(recording.names)}; at least one is needed"
        )
    for name in options.maximum:
        if name not in emg:
            raise FieldError("maximum", f"names {name!r}; one of {', '.join(emg)} is needed", recording.source)
    chosen = [(name, options.channels.get(name, name)) for name in emg]
    angles = [(name, options.angles.get(name, name)) for name in angle]
    for option, columns in (("channels", chosen), ("angles", angles)):
        new = [name for _, name in columns]
        for name in new:
            if new.count(name) > 1:
                raise FieldError(option, f"names two columns {name!r}; different names are needed", recording.source)
    return chosen, angles


def _left_out(recording: Recording, options: EnvelopeOptions) -> tuple[str, ...]:
    """Say which columns were left out for their unit."""
    return tuple(
        f"column '{name}' is in {recording.unit(name)}, neither EMG nor angle: left out"
        for name in recording.names
        if recording.unit(name) not in units.ANGLE
        and not _is_emg(recording, name)
        and name not in options.channels
        and name not in options.skip
    )


def _bridged(recording: Recording, columns: Sequence[str]) -> tuple[FloatArray, list[Gaps]]:
    bridged = np.zeros((len(recording.values), len(columns)))
    gaps = []
    for i, column in enumerate(columns):
        try:
            bridged[:, i], in_channel = steps.bridge_gaps(recording.values[:, recording.names.index(column)])
        except ValueError:
            raise UserError(f"{recording.source}: channel {column} holds no value; at least one is needed") from None
        gaps.append(in_channel)
    return bridged, gaps


def write_envelopes(result: Envelopes, out: str | Path, options: EnvelopeOptions | None = None) -> None:
    """Write envelopes to a new bag: `emg_envelope` and, if there are angles, `reference_angle` at every tick.

    Tick k is stamped k times the period, rounded to whole nanoseconds. run_info holds the recording's name, the
    options, what became of each channel, and versions.

    Raises UserError if the bag cannot be made; nothing is written then.
    """
    period = round(1e9 / result.rate)
    run_info = {
        "command": "limb emg",
        "source": result.source,
        "rate": result.rate,
        "period_ns": period,
        "parameters": (options or EnvelopeOptions()).as_mapping(),
        "channels": [asdict(channel) for channel in result.channels],
        "angles": [asdict(channel) for channel in result.angle_channels],
        "notes": list(result.notes),
        "versions": versions(),
    }
    stamps = np.arange(len(result.values), dtype=np.int64) * period
    ticks = np.arange(len(result.values), dtype=np.uint64)
    with BagWriter(out, run_info) as bag:
        write_table(
            bag,
            ENVELOPE_TOPIC,
            TOPIC_TYPES[ENVELOPE_TOPIC],
            stamps,
            {"name": result.names, "last_tick": len(result.values) - 1},
            {"tick": ticks, "activation": result.values},
        )
        if result.angle_channels:
            names = [channel.name for channel in result.angle_channels]
            write_table(
                bag, ANGLE_TOPIC, TOPIC_TYPES[ANGLE_TOPIC], stamps, {"name": names}, {"position": result.angles}
            )
