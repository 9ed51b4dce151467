"""Where a limb's activations come from: a bag, a CSV file, a waveform YAML, or constants in a line."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from limb_nodes.errors import FieldError, UserError
from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.foundation.parameter import Parameter
from limb_nodes.signals.bag_field import BagOptions
from limb_nodes.signals.clock import fit_clock
from limb_nodes.signals.named_values import is_bag, read_named_values
from limb_nodes.signals.table import check_times, is_value, read_table
from limb_nodes.signals.text_options import TextOptions
from limb_nodes.signals.waveform import (
    Waveform,
    check_frequencies,
    parse_constants,
    read_waveforms,
    sample_waveforms,
)

# A recorded run holds what drove its muscles on the first topic, a recording of EMG on the second.
ACTIVATION_TOPICS = ("activation", "emg_envelope")
MOST_TICKS = 10**8
# Waveforms are looked through in stretches of so many ticks.
STRETCH = 2**16
# Filters and conversions of units leave values outside [0, 1] by as much as this.
ROUNDING = 1e-6
# An envelope that exceeds its maximum seldom exceeds it twice; one in percent does.
LEAST_PERCENT = 2.0
RATE = Parameter("rate", "Hz", "ticks per second", above=0.0)
# Stamps of ROS hold twice as much (s).
LONGEST = 1e9
DURATION = Parameter("duration", "s", "simulated time", above=0.0)


@dataclass(frozen=True)
class Activation:
    """Activations at every tick: a stretch of them, `activation[start:end]`, or all, `values`.

    ticks: how many, at the times k / rate, k = 0, 1, ... rate: Hz. names: the muscles, one per column. between: the
    activations [ticks, muscles], 0 to 1, from one tick to before another. notes: what a person should know about the
    source, one sentence each.
    """

    ticks: int
    rate: float
    names: tuple[str, ...]
    between: Callable[[int, int], FloatArray]
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        return self.ticks

    def __getitem__(self, rows: slice) -> FloatArray:
        return self.between(*rows.indices(self.ticks)[:2])

    @cached_property
    def values(self) -> FloatArray:
        """All of them, [ticks, muscles]."""
        return self[:]

    @property
    def duration(self) -> float:
        """Time of the last tick (s)."""
        return (self.ticks - 1) / self.rate


@dataclass(frozen=True)
class _Samples:
    """What a file or a bag holds.

    times: [samples], s, rising. values: [samples, names]. place: how an error names a sample.
    """

    source: str
    times: FloatArray
    names: tuple[str, ...]
    values: FloatArray
    place: Callable[[int], str]
    notes: tuple[str, ...] = ()


def load_activation(
    source: str, muscles: Sequence[str], rate: float, duration: float | None = None, text: TextOptions | None = None
) -> Activation:
    """Load activations for some muscles, at k / rate for k = 0 ... duration * rate.

    source: a bag with the topic `activation` or `emg_envelope`, or another that is named behind the bag, as in
    `BAG:/emg/envelope` or `BAG:/emg/envelope:field`; a text table (`limb_nodes.signals.table`), such as CSV or
    OpenSim's `.mot`, with a column of times and one per muscle; a waveform YAML (`limb_nodes.signals.waveform`); or
    constants in a line, `flexor=0.9,extensor=0`. Recordings are taken along straight lines between their samples, from
    their first sample on. Muscles of the source that are not asked for are left out, and noted.

    muscles: their names, in the order of the columns. rate: ticks per second (Hz). duration: seconds, a whole
    number of ticks; None takes the whole recording. text: how a text table is to be read.

    Raises UserError if the source lacks a muscle, leaves [0, 1], misses a value or is too short; FieldError if the
    source cannot be read, or if rate or duration are impossible.
    """
    RATE.check(rate)
    if duration is not None:
        _ticks(duration, rate)
    if _is_bag(source):
        return _from_samples(_bag(source), muscles, rate, duration)
    if not os.path.exists(source):
        if "=" not in source:
            raise FieldError(
                "source",
                f"is {source!r}, which is no file; a bag, a CSV file, a waveform YAML, or constants such as "
                "flexor=0.9,extensor=0 are needed",
            )
        return _from_waveforms(source, parse_constants(source), muscles, rate, duration)
    if Path(source).suffix.lower() in {".yaml", ".yml"}:
        return _from_waveforms(source, read_waveforms(source), muscles, rate, duration)
    return _from_samples(_table(source, muscles, text), muscles, rate, duration)


def _ticks(duration: float, rate: float) -> int:
    """Number of the last tick of a duration that is a whole number of ticks."""
    DURATION.check(duration)
    _check_count(duration, rate)
    last = round(duration * rate)
    if last < 1 or abs(duration * rate - last) > 1e-6 * max(1.0, last * 1e-6):
        raise FieldError(
            "duration", f"is {duration:g}; a whole number of ticks of {1 / rate:g} s is needed (rate {rate:g} Hz)"
        )
    return last


def _check_count(duration: float, rate: float) -> None:
    if duration * rate > MOST_TICKS:
        raise FieldError(
            "rate",
            f"is {rate:g}, {duration * rate:.3g} ticks in {duration:g} s; at most {MOST_TICKS:g} ticks, which fit in "
            "memory, are needed",
        )
    if duration > LONGEST:
        raise FieldError("duration", f"is {duration:g}; at most {LONGEST:g} in s is needed")


def _from_waveforms(
    source: str, waveforms: dict[str, Waveform], muscles: Sequence[str], rate: float, duration: float | None
) -> Activation:
    if duration is None:
        raise FieldError("duration", f"is missing; {DURATION.allowed()} is needed, for a waveform has no end", source)
    _check_muscles(source, "muscle", tuple(waveforms), muscles)
    count = _ticks(duration, rate) + 1
    check_frequencies(source, waveforms, muscles, rate)

    def between(start: int, end: int) -> FloatArray:
        return sample_waveforms(source, waveforms, muscles, np.arange(start, end) / rate)

    for start in range(0, count, STRETCH):
        between(start, min(count, start + STRETCH))
    return Activation(count, rate, tuple(muscles), between, _unused(tuple(waveforms), muscles))


def _from_samples(samples: _Samples, muscles: Sequence[str], rate: float, duration: float | None) -> Activation:
    source, times = samples.source, samples.times - samples.times[0]
    _check_muscles(source, "column", samples.names, muscles)
    values = samples.values[:, [samples.names.index(muscle) for muscle in muscles]]
    values, rounded = _checked(samples, values, muscles)
    end = float(times[-1])
    if duration is None:
        _check_count(end, rate)
        last = int(np.floor(end * rate + 1e-6))
    else:
        last = _ticks(duration, rate)
    if last < 1:
        raise UserError(f"{source}: lasts {end:g} s; one tick of {1 / rate:g} s (rate {rate:g} Hz) or more is needed")
    if last > end * rate + 1e-6:
        raise FieldError("duration", f"is {duration:g}; a number <= {end:g} in s is needed, for it ends there", source)
    as_they_are = len(times) > last and np.abs(times[: last + 1] - np.arange(last + 1) / rate).max() < 1e-9

    def between(start: int, end: int) -> FloatArray:
        if as_they_are:
            return values[start:end].copy()
        ticks = np.arange(start, end) / rate
        return np.stack([np.interp(ticks, times, values[:, i]) for i in range(len(muscles))], axis=1)

    notes = samples.notes + rounded + _unused(samples.names, muscles)
    return Activation(last + 1, rate, tuple(muscles), between, notes)


def _checked(samples: _Samples, values: FloatArray, muscles: Sequence[str]) -> tuple[FloatArray, tuple[str, ...]]:
    """The values [samples, muscles] within [0, 1], and a note if rounding had put some outside.

    Raises UserError that names the first value that is missing or further outside.
    """
    outside = np.argwhere(~((values >= -ROUNDING) & (values <= 1.0 + ROUNDING)))
    if outside.size:
        row, column = outside[0]
        value, highest = values[row, column], float(np.nanmax(values[:, column]))
        percent = f"; it reaches {highest:.6g}: divide it by 100 if it is in percent" if highest > LEAST_PERCENT else ""
        raise UserError(
            f"{samples.source}, {samples.place(row)}: {muscles[column]} {is_value(value)}; "
            f"a number in [0, 1] is needed{percent}"
        )
    clipped = np.clip(values, 0.0, 1.0)
    count = int((clipped != values).sum())
    return clipped, (f"values outside [0, 1] by rounding, by {ROUNDING:g} at most, clipped: {count}",) if count else ()


def _check_muscles(source: str, what: str, names: Sequence[str], muscles: Sequence[str]) -> None:
    for muscle in muscles:
        if muscle not in names:
            raise UserError(f"{source}: no {what} '{muscle}', a muscle of the limb; there are {', '.join(names)}")


def _unused(names: Sequence[str], muscles: Sequence[str]) -> tuple[str, ...]:
    unused = [name for name in names if name not in muscles]
    return (f"not used, for the limb has no such muscle: {', '.join(unused)}",) if unused else ()


def _table(source: str, muscles: Sequence[str], text: TextOptions | None) -> _Samples:
    table = read_table(source, text)
    twice = next((muscle for muscle in muscles if muscle in table.repeated), None)
    if twice is not None:
        raise UserError(f"{source}: two columns are named {twice!r}, a muscle of the limb; one column for it is needed")
    times = table.needed_times()
    notes = () if times[0] == 0 else (f"its times start at {times[0]:.12g} s; counted from there",)
    return _Samples(source, times, table.names, table.values, table.place, table.notes + notes)


def _bag(source: str) -> _Samples:
    path, _, place = source.partition(":") if not os.path.exists(source) else (source, "", "")
    topic, _, field = place.partition(":")
    try:
        series = read_named_values(path, ACTIVATION_TOPICS, BagOptions(topic=topic or None, field=field or None))
    except FieldError as error:
        raise UserError(f"{error}; BAG:TOPIC:FIELD chooses, and `limb emg` has options for more") from None
    times, notes = series.times, series.notes
    if not series.stamped and not (np.diff(times) > 0.0).all():
        # Times of reception come in packets.
        fitted = fit_clock(source, times, series.place)
        ticks = np.arange(len(times)) if fitted.ticks is None else fitted.ticks
        times = ticks / fitted.rate + (0.0 if fitted.wander is None else fitted.wander)
        notes += fitted.notes
    check_times(source, times, series.place)
    missing = int(series.ticks[-1] - series.ticks[0]) + 1 - len(series.ticks)
    if missing > 0 and series.counter == "tick":
        notes += (f"ticks missing on {series.topic}, bridged by straight lines: {missing}",)
    return _Samples(source, times, series.names, series.values, series.place, notes)


def _is_bag(source: str) -> bool:
    """Whether a source is a bag, or one with a topic behind a colon."""
    path, colon, topic = source.partition(":")
    return is_bag(source) or bool(colon and topic and os.path.exists(path) and is_bag(path))
