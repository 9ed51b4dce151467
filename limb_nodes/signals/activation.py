"""Where a limb's activations come from: a bag, a CSV file, a waveform YAML, or constants in a line."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from limb_nodes.errors import UserError
from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.signals.named_values import is_bag, read_named_values
from limb_nodes.signals.table import TIME_UNITS, read_table
from limb_nodes.signals.waveform import Waveform, parse_constants, read_waveforms, sample_waveforms

# A recorded run holds what drove its muscles on the first topic, a recording of EMG on the second.
ACTIVATION_TOPICS = ("activation", "emg_envelope")
MOST_TICKS = 10**8


@dataclass(frozen=True)
class Activation:
    """Activations at every tick.

    values: [ticks, muscles], 0 to 1, at the times k / rate, k = 0, 1, ... rate: Hz. names: the muscles,
    one per column. notes: what a person should know about the source, one sentence each.
    """

    values: FloatArray
    rate: float
    names: tuple[str, ...]
    notes: tuple[str, ...] = ()

    @property
    def duration(self) -> float:
        """Time of the last tick (s)."""
        return (len(self.values) - 1) / self.rate


@dataclass(frozen=True)
class _Samples:
    """What a file holds: times [samples] in s, values [samples, names], and how errors name a place."""

    source: str
    times: FloatArray
    names: tuple[str, ...]
    values: FloatArray
    places: Sequence[str]
    notes: tuple[str, ...] = ()


def load_activation(source: str, muscles: Sequence[str], rate: float, duration: float | None = None) -> Activation:
    """Load activations for some muscles, at k / rate for k = 0 ... duration * rate.

    source: a bag with the topic `activation` or `emg_envelope`; a tab- or comma-separated file with a column
    of times (s) and one per muscle; a waveform YAML (`limb_nodes.signals.waveform`); or constants in a line,
    `flexor=0.9,extensor=0`. Recordings are taken along straight lines between their samples, from
    their first sample on. Muscles of the source that are not asked for are left out, and noted.

    muscles: their names, in the order of the columns. rate: ticks per second (Hz). duration: seconds, a whole
    number of ticks; None takes the whole recording.

    Raises UserError where the source cannot be read, lacks a muscle, leaves [0, 1], misses a value or is too
    short, or where rate or duration are impossible.
    """
    if not (np.isfinite(rate) and rate > 0):
        raise UserError(f"rate {rate:g}: must be greater than 0 Hz")
    if duration is not None:
        _ticks(duration, rate)
    if is_bag(source):
        return _from_samples(_bag(source), muscles, rate, duration)
    there = os.path.exists(source)
    if not there and "=" in source:
        return _from_waveforms(source, parse_constants(source), muscles, rate, duration)
    if not there:
        raise UserError(
            f"activation '{source}': no such file or folder; must be a bag, a CSV file, a waveform YAML, "
            "or constants such as flexor=0.9,extensor=0"
        )
    if Path(source).suffix.lower() in {".yaml", ".yml"}:
        return _from_waveforms(source, read_waveforms(source), muscles, rate, duration)
    return _from_samples(_csv(source), muscles, rate, duration)


def _ticks(duration: float, rate: float) -> int:
    """Number of the last tick of a duration that is a whole number of ticks."""
    if not (np.isfinite(duration) and duration > 0):
        raise UserError(f"duration {duration:g}: must be greater than 0 s")
    _check_count(duration * rate, rate)
    last = round(duration * rate)
    if last < 1 or abs(duration * rate - last) > 1e-6 * max(1.0, last * 1e-6):
        raise UserError(f"duration {duration:g}: must be a whole number of ticks of {1 / rate:g} s (rate {rate:g} Hz)")
    return last


def _check_count(ticks: float, rate: float) -> None:
    if ticks > MOST_TICKS:
        raise UserError(f"rate {rate:g}: {ticks:.3g} ticks; at most {MOST_TICKS:g} fit in memory")


def _from_waveforms(
    source: str, waveforms: dict[str, Waveform], muscles: Sequence[str], rate: float, duration: float | None
) -> Activation:
    if duration is None:
        raise UserError(f"activation '{source}': a waveform has no end; give a duration in s")
    _check_muscles(source, "muscle", tuple(waveforms), muscles)
    times = np.arange(_ticks(duration, rate) + 1) / rate
    values = sample_waveforms(source, waveforms, muscles, times)
    return Activation(values, rate, tuple(muscles), _unused(tuple(waveforms), muscles))


def _from_samples(samples: _Samples, muscles: Sequence[str], rate: float, duration: float | None) -> Activation:
    source, times = samples.source, samples.times - samples.times[0]
    later = np.concatenate([np.isfinite(times[:1]), np.diff(times) > 0])
    if not later.all():
        row = int(later.argmin())
        shown = "no value" if np.isnan(samples.times[row]) else f"{samples.times[row]:g} s"
        raise UserError(f"{source}, {samples.places[row]}, time: {shown}; must be later than the one before")
    _check_muscles(source, "column", samples.names, muscles)
    values = samples.values[:, [samples.names.index(muscle) for muscle in muscles]]
    wrong = np.argwhere(~((values >= 0.0) & (values <= 1.0)))
    if wrong.size:
        row, column = wrong[0]
        value = values[row, column]
        shown = "no value" if np.isnan(value) else f"{value:g}"
        raise UserError(f"{source}, {samples.places[row]}, {muscles[column]}: {shown}; must be a number in [0, 1]")
    end = float(times[-1])
    _check_count(end * rate if duration is None else 0.0, rate)
    last = int(np.floor(end * rate + 1e-6)) if duration is None else _ticks(duration, rate)
    if last < 1:
        raise UserError(f"{source}: lasts {end:g} s, less than one tick of {1 / rate:g} s (rate {rate:g} Hz)")
    if last > end * rate + 1e-6:
        raise UserError(f"{source}: lasts {end:g} s, shorter than the duration of {duration:g} s")
    wanted = np.arange(last + 1) / rate
    if len(times) > last and np.abs(times[: last + 1] - wanted).max() < 1e-9:
        taken = values[: last + 1].copy()
    else:
        taken = np.stack([np.interp(wanted, times, values[:, i]) for i in range(len(muscles))], axis=1)
    return Activation(taken, rate, tuple(muscles), samples.notes + _unused(samples.names, muscles))


def _check_muscles(source: str, what: str, names: Sequence[str], muscles: Sequence[str]) -> None:
    for muscle in muscles:
        if muscle not in names:
            raise UserError(f"{source}: no {what} '{muscle}', a muscle of the limb; there are {', '.join(names)}")


def _unused(names: Sequence[str], muscles: Sequence[str]) -> tuple[str, ...]:
    unused = [name for name in names if name not in muscles]
    return (f"not used, for the limb has no such muscle: {', '.join(unused)}",) if unused else ()


def _csv(source: str) -> _Samples:
    table = read_table(source)
    column = table.time_column()
    if column is None:
        raise UserError(f"{source}: no column 'time' (s); there are {', '.join(table.names)}")
    times = table.values[:, column] * TIME_UNITS[table.units[column]]
    places = [f"line {line}" for line in table.lines]
    keep = [i for i in range(len(table.names)) if i != column]
    notes = () if times[0] == 0 else (f"its times start at {times[0]:g} s; counted from there",)
    names = tuple(table.names[i] for i in keep)
    return _Samples(source, times, names, table.values[:, keep], places, notes)


def _bag(source: str) -> _Samples:
    series = read_named_values(source, ACTIVATION_TOPICS)
    places = [f"topic {series.topic}, tick {tick}" for tick in series.ticks]
    missing = int(series.ticks[-1] - series.ticks[0]) + 1 - len(series.ticks)
    notes = (f"ticks missing on {series.topic}, bridged by straight lines: {missing}",) if missing > 0 else ()
    return _Samples(source, series.times, series.names, series.values, places, notes)
