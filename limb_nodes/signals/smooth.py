"""The channels of a recording, from raw to smooth: artefacts, gaps, filters; not yet normalised."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from shlex import quote

import numpy as np
import numpy.typing as npt

from limb_nodes.errors import FieldError, UserError
from limb_nodes.foundation.arrays import FloatArray, IntArray
from limb_nodes.signals import envelope as steps
from limb_nodes.signals.artefacts import NO_VALUE, Artefact, artefacts, lone_spikes, no_signal, within
from limb_nodes.signals.causal import CausalChain, naming
from limb_nodes.signals.envelope import Gaps
from limb_nodes.signals.options import EnvelopeOptions
from limb_nodes.signals.recording import Recording


@dataclass(frozen=True)
class Smooth:
    """Some channels of a recording.

    values: [samples, channels], the envelopes in the channels' units; 0 in a channel without a signal, NaN in a gap
    that is kept. raw: [samples, channels], before all steps, NaN where a value is missing. gaps, has_signal: one per
    channel. artefacts: what was noticed in them.
    """

    values: FloatArray
    raw: FloatArray
    gaps: tuple[Gaps, ...]
    has_signal: npt.NDArray[np.bool_]
    artefacts: tuple[Artefact, ...]


def smooth(recording: Recording, columns: Sequence[str], options: EnvelopeOptions) -> Smooth:
    """Filter, rectify and smooth some columns of a recording.

    Raises FieldError if a filter cannot work at this rate or if a gap is too long; UserError if a channel that is to be
    trusted holds no value.
    """
    rate = recording.rate
    raw = recording.values[:, [recording.names.index(column) for column in columns]]
    values, has_signal = np.zeros(raw.shape), np.ones(len(columns), dtype=bool)
    gaps = [Gaps(0, 0, 0)] * len(columns)
    noticed: list[Artefact] = []
    cleaned, kept = raw.copy(), [np.empty((0, 2), dtype=np.int64)] * len(columns)
    for i, column in enumerate(columns):
        reason = no_signal(raw[:, i], rate)
        if reason == NO_VALUE and column in options.trust:
            raise UserError(f"{recording.source}: channel {column} {reason}; at least one is needed")
        if reason and column not in options.trust:
            has_signal[i] = False
            noticed.append(_without_signal(recording, column, reason))
            continue
        noticed += artefacts(column, recording.unit(column), raw[:, i], rate, options.remove_spikes)
        gaps[i], kept[i] = sort_gaps(recording, column, options)
        noticed += [_kept_gap(column, start / rate, end / rate) for start, end in kept[i].tolist()]
        if options.remove_spikes:
            cleaned[within(len(raw), lone_spikes(raw[:, i], rate)[0]), i] = np.nan
    live = np.flatnonzero(has_signal).tolist()
    values[:, live] = _without_gaps(recording, cleaned[:, live], [kept[i] for i in live], options)
    return Smooth(values, raw, tuple(gaps), has_signal, tuple(noticed))


def sort_gaps(recording: Recording, column: str, options: EnvelopeOptions) -> tuple[Gaps, IntArray]:
    """The gaps of a column that are to be bridged, and those [gaps, 2] that are kept, for they are too long.

    Raises FieldError if a gap is too long and not to be kept.
    """
    missing = steps.runs(~np.isfinite(recording.values[:, recording.names.index(column)]))
    lengths = np.diff(missing)[:, 0]
    long = lengths > options.longest_gap * recording.rate + 1e-6
    if long.any() and not options.keep_gaps:
        start, end = missing[long][0] / recording.rate
        raise FieldError(
            "longest_gap",
            f"is {options.longest_gap:g}; a number >= {lengths.max() / recording.rate:.6g} in s is needed, for channel "
            f"{column} has no value from {start:.6g} to {end:.6g} s, or --keep-gaps",
            recording.source,
        )
    bridged = lengths[~long]
    return Gaps(len(bridged), int(bridged.sum()), int(bridged.max(initial=0))), missing[long]


def _without_gaps(
    recording: Recording, values: FloatArray, kept: Sequence[IntArray], options: EnvelopeOptions
) -> FloatArray:
    """Envelopes [samples, channels] of values in which some are missing (NaN); NaN in the gaps [gaps, 2] to be kept."""
    if options.causal:
        result = CausalChain(recording.rate, options, values.shape[1], _of(recording)).process(values)
        for i, gaps in enumerate(kept):
            result[within(len(values), gaps), i] = np.nan
        return result
    result = np.full(values.shape, np.nan)
    whole = [i for i, gaps in enumerate(kept) if not len(gaps)]
    bridged = [steps.bridge_gaps(values[:, i])[0] for i in whole]
    if whole:
        result[:, whole] = _zero_phase(recording, np.stack(bridged, axis=1), options)
    corners = [*(options.band or ()), options.low_pass or np.inf]
    for i in set(range(len(kept))) - set(whole):
        # A gap is no quiet stretch: what lies before and after it is filtered by itself.
        for start, end in steps.runs(~within(len(values), kept[i])).tolist():
            if end - start >= max(2, recording.rate / min(corners)):
                stretch, _ = steps.bridge_gaps(values[start:end, i])
                result[start:end, i] = _zero_phase(recording, stretch[:, None], options)[:, 0]
    return result


def _zero_phase(recording: Recording, values: FloatArray, options: EnvelopeOptions) -> FloatArray:
    """The steps without phase shift: [samples, channels], in the recording's units."""
    source, rate, signal = _of(recording), recording.rate, values
    if options.mains is not None:
        with naming("mains", source):
            signal = steps.notch(signal, rate, options.mains)
    if options.band is not None:
        with naming("band", source):
            signal = steps.band_pass(signal, rate, options.band, options.band_order)
    if options.rectify:
        signal = steps.rectify(signal)
    if options.low_pass is not None:
        with naming("low_pass", source):
            signal = steps.low_pass(signal, rate, options.low_pass, options.low_pass_order)
    return signal


def _of(recording: Recording) -> str:
    """How an error about a filter begins."""
    return f"{recording.source} ({recording.rate:g} Hz)"


def _kept_gap(column: str, start: float, end: float) -> Artefact:
    note = f"channel {column}: no value from {start:.6g} to {end:.6g} s, kept as a gap"
    return Artefact(column, "gap", start, end, 0, 0.0, note)


def _without_signal(recording: Recording, column: str, reason: str) -> Artefact:
    end = (len(recording.values) - 1) / recording.rate
    again = "" if reason == NO_VALUE else f", or normalise it all the same by --trust {quote(column)}"
    note = (
        f"channel {column} {reason}, from 0 to {end:.6g} s: no signal, left at 0; check its electrode, leave it out by "
        f"--skip {quote(column)}{again}"
    )
    return Artefact(column, "no signal", 0.0, end, len(recording.values), 0.0, note)
