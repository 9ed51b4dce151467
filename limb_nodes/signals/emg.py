"""From a raw EMG recording to activations between 0 and 1."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from limb_nodes.errors import UserError
from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.signals import envelope as steps
from limb_nodes.signals import units
from limb_nodes.signals.artefacts import Artefact, no_signal, within
from limb_nodes.signals.causal import naming
from limb_nodes.signals.chosen import check_names, chosen, left_out
from limb_nodes.signals.envelope import Gaps
from limb_nodes.signals.maxima import maxima
from limb_nodes.signals.options import EnvelopeOptions, check_numbers
from limb_nodes.signals.recording import Recording
from limb_nodes.signals.smooth import Smooth, smooth, sort_gaps


@dataclass(frozen=True)
class EmgChannel:
    """What became of one channel.

    column, name: its name in the recording and its new one. maximum, rest: the levels that became 1
    and 0, in `unit`; both 0 without a signal. clipped: samples above the maximum. has_signal: whether it was
    normalised; otherwise it is 0 throughout.
    """

    column: str
    name: str
    unit: str
    gaps: Gaps
    maximum: float
    rest: float
    clipped: int
    has_signal: bool = True


@dataclass(frozen=True)
class AngleChannel:
    """What became of one angle column: its name in the recording and its new one."""

    column: str
    name: str
    gaps: Gaps


@dataclass(frozen=True)
class Envelopes:
    """Normalised envelopes of several muscles, and the joint angles recorded beside them.

    values: [samples, channels], dimensionless, 0 to 1, NaN in gaps that are kept. angles: [samples, angle columns],
    rad. rate: Hz; sample k belongs to the time k / rate. raw: [raw samples, channels], the channels before all steps,
    in their units, NaN where a value is missing; raw_rate: Hz. artefacts: what was noticed in the channels; their
    sentences are among the notes. maximum_from: the recordings that the maxima were taken from.
    """

    source: str
    rate: float
    channels: tuple[EmgChannel, ...]
    values: FloatArray
    angle_channels: tuple[AngleChannel, ...]
    angles: FloatArray
    notes: tuple[str, ...]
    raw: FloatArray
    raw_rate: float
    artefacts: tuple[Artefact, ...] = ()
    maximum_from: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """The channels' new names."""
        return tuple(channel.name for channel in self.channels)


def envelopes(
    recording: Recording, options: EnvelopeOptions | None = None, maximum_from: Sequence[Recording] = ()
) -> Envelopes:
    """Turn a recording's EMG channels into normalised envelopes, and keep its angle columns.

    maximum_from: recordings of which the largest envelope of a channel, made by the same steps, counts as 1, unless the
    options give its maximum.

    Raises FieldError if an option is out of range, names a column that is not there or is no EMG, if a filter cannot
    work at this rate, if a gap is too long, or if no recording of `maximum_from` has a channel; UserError if no channel
    has a signal, or if a maximum is not above the rest level.
    """
    options = options or EnvelopeOptions()
    # A rate that numpy computed cannot be written to a bag's run_info.
    recording = replace(recording, rate=float(recording.rate))
    check_names(recording, options)
    check_numbers(options, recording.rate)
    emg_columns, angle_columns = chosen(recording, options)
    columns = [column for column, _ in emg_columns]
    result = smooth(recording, columns, options)
    if not result.has_signal.any():
        reason = no_signal(result.raw[:, 0], recording.rate)
        raise UserError(f"{recording.source}: channel {columns[0]} {reason}; a channel with a signal is needed")
    maximum_notes: tuple[str, ...] = ()
    if maximum_from:
        needed = [column for i, column in enumerate(columns) if result.has_signal[i] and column not in options.maximum]
        taken, maximum_notes = maxima(maximum_from, {column: recording.unit(column) for column in needed}, options)
        options = replace(options, maximum={**taken, **options.maximum})
    values, channels = _normalised(recording, emg_columns, result, options)
    angles, angle_channels = _angles(recording, angle_columns, options)
    rate = options.resample or recording.rate
    if options.resample is not None or options.delay:
        values = steps.resample(values, recording.rate, rate, options.delay)
    if options.resample is not None:
        angles = steps.resample(angles, recording.rate, rate) if angle_columns else np.empty((len(values), 0))
    noticed = tuple(artefact.note for artefact in result.artefacts if artefact.note)
    return Envelopes(
        recording.source,
        rate,
        channels,
        values,
        angle_channels,
        angles,
        recording.notes + left_out(recording, options) + noticed + maximum_notes,
        result.raw,
        recording.rate,
        result.artefacts,
        tuple(other.source for other in maximum_from),
    )


def _normalised(
    recording: Recording, columns: Sequence[tuple[str, str]], result: Smooth, options: EnvelopeOptions
) -> tuple[FloatArray, tuple[EmgChannel, ...]]:
    """Envelopes of 0 to 1 [samples, channels], and what became of each channel, columns as (column, new name)."""
    live = np.flatnonzero(result.has_signal).tolist()
    signal, rate = result.values[:, live], recording.rate
    rest, maximum = np.zeros(len(columns)), np.zeros(len(columns))
    if options.rest:
        with naming("rest", f"{recording.source} ({rate:g} Hz)"):
            rest[live] = steps.rest_level(signal, rate, options.rest)
    maximum[live] = [options.maximum.get(columns[i][0], np.nanmax(result.values[:, i])) for i in live]
    for i in live:
        if not maximum[i] > rest[i]:
            raise UserError(
                f"{recording.source}: the maximum of channel {columns[i][0]} is {maximum[i]:g}; "
                f"a number > {rest[i]:g}, its rest level, is needed"
            )
    values, above = np.zeros(result.values.shape), np.zeros(len(columns), dtype=np.int64)
    values[:, live], above[live] = steps.normalise(signal, maximum[live], rest[live])
    channels = tuple(
        EmgChannel(
            column, name, recording.unit(column), result.gaps[i], float(maximum[i]), float(rest[i]), int(above[i]),
            bool(result.has_signal[i]),
        )
        for i, (column, name) in enumerate(columns)
    )  # fmt: skip
    return values, channels


def _angles(
    recording: Recording, columns: Sequence[tuple[str, str]], options: EnvelopeOptions
) -> tuple[FloatArray, tuple[AngleChannel, ...]]:
    """Angles [samples, columns] in rad, and what became of each column, columns as (column, new name)."""
    angles = np.zeros((len(recording.values), len(columns)))
    channels = []
    for i, (column, name) in enumerate(columns):
        values = recording.values[:, recording.names.index(column)]
        if not np.isfinite(values).any():
            raise UserError(f"{recording.source}: column {column} holds no value; at least one is needed, or skip it")
        gaps, kept = sort_gaps(recording, column, options)
        bridged, _ = steps.bridge_gaps(values)
        bridged[within(len(values), kept)] = np.nan
        angles[:, i] = bridged * units.ANGLE[recording.unit(column)]
        channels.append(AngleChannel(column, name, gaps))
    return angles, tuple(channels)
