"""What a raw channel holds that is no EMG: lone spikes, clipping, stretches that stand still, no signal at all."""

from __future__ import annotations

from dataclasses import dataclass, replace
from shlex import quote

import numpy as np
import numpy.typing as npt

from limb_nodes.foundation.arrays import FloatArray, IntArray
from limb_nodes.signals.envelope import runs

# A spike is back within this time (s), shorter than any wave of surface EMG, and this many times as high as all others.
SPIKE_WIDTH = 0.002
SPIKE_RATIO = 3.0
MOST_SPIKES = 20
# Samples that lie this close to the highest, as a part of the range, count as equal to it: some steps of a converter.
EQUAL = 2e-4
CLIPPED_RUNS = 3
CLIPPED_SAMPLES, CLIPPED_RATIO = 5, 4
# Noise moves a sensor that works within this time (s) and these samples.
STILL_TIME, STILL_SAMPLES = 0.1, 20
MOST_REPEATED = 0.2
# An input without a sensor changes by a step or two of the converter.
LEVELS_WITHOUT_SIGNAL = 4
MANY_LEVELS = 100
LEAST_SAMPLES = 50
NO_VALUE = "holds no value"


@dataclass(frozen=True)
class Artefact:
    """One thing that was noticed in a channel.

    column: the channel's name in the recording. kind: spike, clipping, still or no signal. start, end: s, from the
    first sample to the last that it touches. samples: how many it takes. value: in the channel's unit. note: a sentence
    that says what to do, about all of the kind; empty but for the first of them.
    """

    column: str
    kind: str
    start: float
    end: float
    samples: int
    value: float
    note: str = ""


def artefacts(column: str, unit: str, values: FloatArray, rate: float, removed: bool = False) -> list[Artefact]:
    """What was noticed in a channel that holds a signal.

    values: [samples], in its unit, NaN where one is missing; rate: Hz. removed: whether spikes are removed.
    """
    spiky, ratio = lone_spikes(values, rate)
    found = _spikes(column, values, rate, spiky)
    if found:
        remedy = "replaced by a straight line" if removed else "--remove-spikes puts a straight line there"
        times = ", ".join(f"{_quantity(spike.value, unit)} at {spike.start:.6g} s" for spike in found)
        what = "a lone spike" if len(found) == 1 else f"{len(found)} lone spikes"
        about = f"{what}, {times}, {ratio:.3g} times as high as the next wave; {remedy}"
        found[0] = replace(found[0], note=f"channel {column}: {about}")
    rest = np.where(within(len(values), spiky), np.nan, values)
    limits = clipped_runs(rest)
    found += [_clipping(column, unit, level, stretches, rate) for level, stretches in limits]
    at_limits = within(len(values), np.vstack([np.empty((0, 2), np.int64), *(stretches for _, stretches in limits)]))
    still = still_runs(rest, rate)
    return found + _still(column, unit, values, still[~at_limits[still[:, 0]]], rate)


def no_signal(values: FloatArray, rate: float) -> str:
    """Why a channel seems to hold no signal, as the predicate of a sentence; empty if it holds one.

    values: [samples], NaN where one is missing.
    """
    good = values[np.isfinite(values)]
    if not good.size:
        return NO_VALUE
    if np.ptp(good) <= 1e-9 * np.abs(good).max():
        return f"is {good[0]:g} everywhere"
    if len(np.unique(good[:1000])) > MANY_LEVELS:
        return ""
    spiky, _ = lone_spikes(values, rate)
    if len(spiky):
        good = values[np.isfinite(values) & ~within(len(values), spiky)]
    if len(good) < LEAST_SAMPLES:
        return ""
    if np.ptp(good) == 0.0:
        return f"is {good[0]:g} everywhere but in a spike"
    levels = _levels(good)
    if levels > LEVELS_WITHOUT_SIGNAL:
        return ""
    return f"takes {levels} different values only, from {good.min():g} to {good.max():g}, as an unplugged input does"


def lone_spikes(values: FloatArray, rate: float) -> tuple[IntArray, float]:
    """Samples that stand alone far above or below all others.

    values: [samples], NaN where one is missing; rate: Hz. Returns [spikes, 2], the first sample of each and the one
    after it, and how many times higher the lowest of them is than the highest wave beside them.

    A sample is as prominent as it is from the nearer of the values one width before and after it. Spikes are the few
    most prominent ones, if the next one is so much less prominent.
    """
    none: tuple[IntArray, float] = (np.empty((0, 2), dtype=np.int64), 0.0)
    width = max(1, round(SPIKE_WIDTH * rate))
    there = np.flatnonzero(np.isfinite(values))
    if len(there) < max(LEAST_SAMPLES, 4 * width):
        return none
    # What lies on both sides of a gap is compared, and at an end the level there.
    held = values[there]
    before, after = np.roll(held, width), np.roll(held, -width)
    before[:width], after[-width:] = _level(held, 0, width), _level(held, len(held) - 1, width)
    prominence = np.maximum(np.minimum(held - before, held - after), np.minimum(before - held, after - held))
    places, heights = _peaks(prominence, width)
    ratios = heights[:-1] / np.maximum(heights[1:], 1e-6 * heights[0] + np.finfo(float).tiny)
    # Few, compared with all the waves that a recording of this length has.
    most = min(MOST_SPIKES, 1 + len(held) // (50 * width))
    count = int(ratios[:most].argmax()) + 1 if len(ratios) else 0
    if not count or ratios[count - 1] < SPIKE_RATIO:
        return none
    kept = [
        (there[start], there[end - 1] + 1)
        for place in np.sort(places[:count]).tolist()
        # A wave that is broad does not fall back to where it came from within the width.
        if prominence[place] > 0.5 * abs(held[place] - _level(held, place, width))
        for start, end in [_extent(held, place, width)]
    ]
    return (np.array(kept, dtype=np.int64), float(ratios[count - 1])) if kept else none


def clipped_runs(values: FloatArray) -> list[tuple[float, IntArray]]:
    """The levels at which a channel is cut off, each with its runs [runs, 2] of samples.

    A limit is where samples pile up: more than in the hundredth of the range below it if two or more are in a row
    several times, and far more if they are not. values: [samples], NaN where one is missing.
    """
    found = []
    good = np.isfinite(values)
    if good.sum() < LEAST_SAMPLES:
        return []
    span = float(np.ptp(values[good]))
    for sign in (1.0, -1.0):
        signed = np.where(good, sign * values, -np.inf)
        top = float(signed.max())
        at_top = signed >= top - EQUAL * span
        stretches = runs(at_top)
        long = stretches[np.diff(stretches)[:, 0] >= 2]
        below = signed[~at_top].max(initial=-np.inf)
        near = int(((signed >= min(top - 0.01 * span, below)) & ~at_top).sum())
        count = int(at_top.sum())
        if (len(long) >= CLIPPED_RUNS and count > near) or count > max(CLIPPED_SAMPLES, CLIPPED_RATIO * near):
            found.append((sign * top, stretches))
    return found


def still_runs(values: FloatArray, rate: float) -> IntArray:
    """Where a channel keeps one value longer than its noise would let it: [runs, 2]. values: [samples]; rate: Hz.

    A coarse converter that often repeats a value lets it rest long; nothing is said of it.
    """
    same = np.diff(values) == 0.0
    stretches = runs(same)
    lengths = np.diff(stretches)[:, 0]
    long = lengths + 1 >= max(STILL_SAMPLES, STILL_TIME * rate)
    others = len(same) - lengths[long].sum()
    if lengths[~long].sum() > MOST_REPEATED * others:
        return np.empty((0, 2), dtype=np.int64)
    stretches[:, 1] += 1
    return stretches[long]


def _peaks(prominence: FloatArray, width: int) -> tuple[IntArray, FloatArray]:
    """Place and height of the most prominent samples, no two of one wave, the highest first."""
    count = min(len(prominence), 200 + 64 * width)
    candidates = np.argpartition(prominence, -count)[-count:]
    candidates = candidates[np.argsort(-prominence[candidates], kind="stable")]
    places: list[int] = []
    for candidate in candidates.tolist():
        if all(abs(candidate - place) > 2 * width for place in places):
            places.append(candidate)
        if len(places) > MOST_SPIKES:
            break
    return np.array(places, dtype=np.int64), prominence[places]


def _extent(values: FloatArray, place: int, width: int) -> tuple[int, int]:
    """The samples around a spike's peak, a width to each side at most, that are off the level by a tenth of it."""
    level = _level(values, place, width)
    off = np.abs(values - level) > 0.1 * abs(values[place] - level)
    start = end = place
    while start > max(0, place - width) and off[start - 1]:
        start -= 1
    while end < min(len(values) - 1, place + width) and off[end + 1]:
        end += 1
    return start, end + 1


def _level(values: FloatArray, place: int, width: int) -> float:
    return float(np.median(values[max(0, place - 10 * width) : place + 10 * width + 1]))


def _levels(values: FloatArray) -> int:
    """How many different values there are, some more than a few counting as many."""
    scale = float(np.ptp(values))
    few = np.unique(np.round((values[:1000] - values.min()) / scale, 9))
    return (
        len(few) if len(few) > LEVELS_WITHOUT_SIGNAL else len(np.unique(np.round((values - values.min()) / scale, 9)))
    )


def within(size: int, stretches: IntArray) -> npt.NDArray[np.bool_]:
    """A mask [size] that is true within some runs [runs, 2] of samples."""
    steps = np.zeros(size + 1, dtype=np.int64)
    np.add.at(steps, stretches[:, 0], 1)
    np.add.at(steps, stretches[:, 1], -1)
    return np.cumsum(steps[:-1]) > 0


def _spikes(column: str, values: FloatArray, rate: float, spiky: IntArray) -> list[Artefact]:
    found = []
    middle = np.nanmedian(values) if len(spiky) else 0.0
    for start, end in spiky.tolist():
        peak = start + int(np.nanargmax(np.abs(values[start:end] - middle)))
        found.append(Artefact(column, "spike", start / rate, (end - 1) / rate, end - start, float(values[peak])))
    return found


def _clipping(column: str, unit: str, level: float, stretches: IntArray, rate: float) -> Artefact:
    samples = int(np.diff(stretches).sum())
    first, last = float(stretches[0, 0] / rate), float((stretches[-1, 1] - 1) / rate)
    note = (
        f"channel {column}: clipped at {_quantity(level, unit)}, {samples} samples from {first:.6g} to {last:.6g} s; "
        f"its envelope is too low there: record with less gain, or leave it out by --skip {quote(column)}"
    )
    return Artefact(column, "clipping", first, last, samples, level, note)


def _still(column: str, unit: str, values: FloatArray, stretches: IntArray, rate: float) -> list[Artefact]:
    found = [
        Artefact(column, "still", start / rate, (end - 1) / rate, end - start, float(values[start]))
        for start, end in stretches.tolist()
    ]
    if found:
        first, more = found[0], len(found) - 1
        note = (
            f"channel {column}: stands still at {_quantity(first.value, unit)} from {first.start:.6g} to "
            f"{first.end:.6g} s{f' and {more} times more' if more else ''}; check its contact, or leave it out by "
            f"--skip {quote(column)}"
        )
        found[0] = replace(first, note=note)
    return found


def _quantity(value: float, unit: str) -> str:
    return f"{value:.6g} {unit}".strip()
