"""The clock of a recording: an even one, fitted to all stamps, whatever noise, rounding or packets are in them.

A stamp is taken as `start + (row + missing rows before) / rate + noise`. The rows were sampled evenly, the noise came
to their stamps later; so row k belongs to tick k plus what is missing before it, and the samples stay as they are.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from limb_nodes.errors import FieldError, UserError
from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.foundation.parameter import Parameter

RATE = Parameter("rate", "Hz", "samples per second", above=0.0, maximum=1e6)
# A clock whose rate moves by more than this part is not one clock.
_SAME_RATE = 0.005
# Noise is told from uneven sampling in so many rows.
_LEAST_NOISY = 30
_PARTS = 64


@dataclass(frozen=True)
class Fitted:
    """A clock and the tick of each row.

    rate: Hz. start: s, time of tick 0 as the stamps count it. ticks: [rows], rising; None if row k is tick k.
    count: of ticks. wander: [rows], s, how far the true time of a row is from its tick; None if nowhere far.
    noise: s, what stamps differ from the clock, as a rule.
    notes: what a person should know, one sentence each.
    """

    rate: float
    start: float
    ticks: npt.NDArray[np.int64] | None
    count: int
    wander: FloatArray | None
    noise: float
    notes: tuple[str, ...] = ()

    def even(self, values: FloatArray) -> FloatArray:
        """Values [ticks, channels] of values [rows, channels]; NaN where rows are missing."""
        if self.ticks is None and self.wander is None:
            return values
        ticks = np.arange(len(values)) if self.ticks is None else self.ticks
        even = np.full((self.count, values.shape[1]), np.nan)
        even[ticks] = values
        if self.wander is not None:
            times, wanted = ticks / self.rate + self.wander, np.arange(self.count) / self.rate
            missing = np.isnan(even)
            for channel in range(values.shape[1]):
                good = np.isfinite(values[:, channel])
                if good.any():
                    even[:, channel] = np.interp(wanted, times[good], values[good, channel])
            even[missing] = np.nan
        return even


def fit_clock(
    source: str,
    times: FloatArray,
    place: Callable[[int], str],
    rate: float | None = None,
    stated: float | None = None,
) -> Fitted:
    """Fit an even clock to stamps.

    times: [rows], s; several rows may share one. place: how an error names a row. rate: samples per second (Hz), which
    counts more than any times; None takes what they say. stated: rate (Hz) that the file states.

    Raises UserError that names the row if a stamp is missing, the stamps go back, the clock was set or the rate
    changes; FieldError if times and stated rate disagree, or if the rate is out of range.
    """
    if rate is None:
        return _fit(source, times, place, stated)
    RATE.check(rate)
    try:
        fitted = _fit(source, times, place, None)
    except UserError as error:
        note = f"times not used, for the rate is given: {str(error).removeprefix(source).lstrip(':, ')}"
        start = float(times[0]) if len(times) and np.isfinite(times[0]) else 0.0
        return Fitted(rate, start, None, len(times), None, 0.0, (note,))
    if abs(fitted.rate - rate) * fitted.count <= fitted.rate:
        return replace(fitted, rate=rate)
    note = f"rate {rate:g} Hz as given; the times say {fitted.rate:.7g} Hz"
    return replace(fitted, rate=rate, wander=None, notes=(*fitted.notes, note))


def plain_rate(rate: float, tolerance: float) -> float:
    """The rate with the fewest digits that differs by no more than the tolerance."""
    for digits in range(1, 8):
        plain = float(f"{rate:.{digits}g}")
        if abs(plain - rate) <= tolerance:
            return plain
    return rate


def _fit(source: str, times: FloatArray, place: Callable[[int], str], stated: float | None) -> Fitted:
    if len(times) < 2:
        raise UserError(f"{source}: holds one row; at least 2 are needed for a rate")
    if not np.isfinite(times).all():
        row = int(np.isfinite(times).argmin())
        allowed = f"a number > {_shown(times, row - 1)}, the time before," if row else "a number"
        raise UserError(f"{source}, {place(row)}: time is missing; {allowed} in s is needed")
    begin = float(times[0])
    relative = times - begin
    steps = np.diff(relative)
    if relative.max() <= 0.0:
        raise UserError(
            f"{source}, {place(1)}: time is {_shown(times, 1)}; a number > {_shown(times, 0)}, the time before, in s "
            "is needed"
        )
    step, precise = _step(steps)
    _check_order(source, times, steps, step, precise, place)
    if not precise and len(times) < _LEAST_NOISY:
        step = float(np.median(steps[steps > 0.0]))
        off = np.abs(steps / step - np.maximum(1.0, np.rint(steps / step))) > 0.25
        row = int(off.argmax()) + 1
        raise _uneven(source, times, row, step, place)
    _check_one_rate(source, relative, step, place)
    missing = _missing(relative, steps, step, precise)
    if missing.any():
        _check_size(source, times, missing, place)
        ticks = np.arange(len(times)) + np.concatenate([[0], np.cumsum(missing)])
    else:
        ticks = None
    slope, offset, residual = _line(relative, ticks)
    noise = 1.4826 * float(np.median(np.abs(residual))) + 1e-12 * slope
    wander = _wander(residual, slope, noise)
    if wander is not None:
        size = max(64, len(times) // _PARTS)
        local = np.abs(wander[size:] - wander[:-size])
        if local.max() > _SAME_RATE * slope * size + 3.0 * noise:
            raise _uneven(source, times, int(local.argmax()), slope, place)
    count = len(times) if ticks is None else int(ticks[-1]) + 1
    rate = _rate(source, 1.0 / slope, count, noise, stated)
    notes = []
    if missing.any():
        notes.append(f"rows missing between the first and the last time: {int(missing.sum())}")
    if noise > 0.02 * slope:
        notes.append(f"times evened: they differ by {noise / slope:.2g} steps from an even clock of {rate:.9g} Hz")
    if wander is not None:
        notes.append(f"resampled: the clock wanders by {np.ptp(wander) / slope:.2g} steps")
    start = begin if abs(offset) < 0.02 * slope else begin + offset
    return Fitted(rate, start, ticks, count, wander, noise, tuple(notes))


def _uneven(source: str, times: FloatArray, row: int, step: float, place: Callable[[int], str]) -> UserError:
    return UserError(
        f"{source}, {place(row)}: time is {_shown(times, row)}; times at an even distance, here {step:.6g} s, are "
        "needed, or a rate"
    )


def _step(steps: FloatArray) -> tuple[float, bool]:
    """The step (s), robust against gaps, and whether the stamps tell every single row."""
    rising = steps[steps > 0.0]
    middle = float(np.median(steps))
    if middle > 0.0 and float(np.median(np.abs(steps - middle))) < 0.1 * middle:
        near = steps[np.abs(steps - middle) < 0.4 * middle]
        precise = float((np.abs(steps / middle - np.rint(steps / middle)) > 0.25).mean()) < 0.02
        if precise:
            return float(near.mean()), True
    # Stamps in packets, rounded or noisy: what lies between two of them is shared among the rows since.
    usual = float(np.median(rising))
    spread = float(np.median(np.abs(rising - usual)))
    plain = steps <= usual + 12.0 * spread + 0.5 * usual
    return float(steps[plain].mean()), False


def _check_order(
    source: str, times: FloatArray, steps: FloatArray, step: float, precise: bool, place: Callable[[int], str]
) -> None:
    """Raise UserError if a stamp goes back by more than noise would, or stands still where others tell each row."""
    back = steps <= 0.0 if precise else steps < -1.5 * step
    if back.any():
        row = int(back.argmax()) + 1
        raise UserError(
            f"{source}, {place(row)}: time is {_shown(times, row)}; a number > {_shown(times, row - 1)}, the time "
            "before, in s is needed, or a rate"
        )


def _check_one_rate(source: str, relative: FloatArray, step: float, place: Callable[[int], str]) -> None:
    """Raise UserError if the rows come at one rate first and at another one later."""
    size = max(16, len(relative) // _PARTS)
    if len(relative) < 4 * size:
        return
    edges = np.arange(0, len(relative), size)
    local = np.array([np.median(_steps_of_packets(relative[a : a + size + 1])) for a in edges[:-1]])
    half = len(local) // 2
    noise = 1.4826 * float(np.median(np.abs(np.diff(local)))) + 1e-9 * step
    best, at = 0.0, half
    for cut in range(2, len(local) - 1):
        change = abs(float(np.median(local[cut:])) / float(np.median(local[:cut])) - 1.0)
        if change > best:
            best, at = change, cut
    before, after = float(np.median(local[:at])), float(np.median(local[at:]))
    if best <= max(0.02, 6.0 * noise / step):
        return
    # The row where the two straight lines meet best.
    window = slice(max(0, int(edges[at]) - 2 * size), min(len(relative), int(edges[at]) + 2 * size))
    piece = relative[window] - relative[window.start] - np.arange(window.stop - window.start) * before
    row = window.start + int(np.argmax(np.abs(piece) > 3.0 * noise + 0.5 * abs(after - before)))
    raise UserError(
        f"{source}, {place(row)}: the rate is {1.0 / after:.6g} Hz from here on, {1.0 / before:.6g} Hz before; one "
        "rate is needed: cut the file there, or give the rate"
    )


def _steps_of_packets(relative: FloatArray) -> FloatArray:
    """Seconds per row between stamps that differ: [packets]; a gap is one of many."""
    first = np.concatenate([[0], np.flatnonzero(np.diff(relative) > 0.0) + 1])
    if len(first) < 3:
        return np.array([(relative[-1] - relative[0]) / max(1, len(relative) - 1)])
    shares: FloatArray = np.diff(relative[first]) / np.diff(first)
    return shares


def _missing(relative: FloatArray, steps: FloatArray, step: float, precise: bool) -> npt.NDArray[np.int64]:
    """How many rows are missing before each row but the first: [rows - 1]."""
    missing = np.zeros(len(steps), dtype=np.int64)
    if precise:
        counted = np.rint(np.minimum(steps / step, 1e15)).astype(np.int64) - 1
        return np.maximum(missing, counted)
    usual = float(np.median(steps[steps > 0.0]))
    spread = float(np.median(np.abs(steps[steps > 0.0] - usual)))
    for after in np.flatnonzero(steps > usual + 12.0 * spread + 0.5 * usual):
        # A late stamp is followed by early ones; a gap moves all that follow.
        width = max(20, 4 * int(usual / step))
        before = relative[max(0, after + 1 - width) : after + 1]
        behind = relative[after + 1 : after + 1 + width]
        level = np.median(before - step * np.arange(-len(before), 0))
        shift = float(np.median(behind - step * np.arange(len(behind))) - level)
        missing[after] = max(0, round(min(shift / step, 1e15)))
    return missing


def _check_size(source: str, times: FloatArray, missing: npt.NDArray[np.int64], place: Callable[[int], str]) -> None:
    """Raise UserError if more is missing than there is, before memory is taken for it."""
    if float(missing.sum(dtype=np.float64)) > max(1000, 4 * len(times)):
        row = int(missing.argmax()) + 1
        raise UserError(
            f"{source}, {place(row)}: time is {_shown(times, row)}, {times[row] - times[row - 1]:.6g} s after the one "
            "before, as if the clock was set; times that rise evenly are needed, or a rate"
        )


def _line(relative: FloatArray, ticks: npt.NDArray[np.int64] | None) -> tuple[float, float, FloatArray]:
    """Step (s), time of tick 0 (s) and residuals (s) [rows] of the line through the stamps; outliers weigh nothing."""
    x = np.arange(len(relative), dtype=np.float64) if ticks is None else ticks.astype(np.float64)
    good = np.ones(len(x), dtype=bool)
    slope = offset = 0.0
    residual = relative
    for _ in range(3):
        some_x, some_y = x[good], relative[good]
        mean_x, mean_y = some_x.mean(), some_y.mean()
        some_x -= mean_x
        slope = float(some_x @ (some_y - mean_y) / (some_x @ some_x))
        offset = float(mean_y - slope * mean_x)
        residual = relative - slope * x
        residual -= offset
        limit = 6.0 * float(np.median(np.abs(residual))) + 1e-9 * slope
        outside = np.abs(residual) > limit
        if not outside.any() or outside.mean() > 0.2:
            break
        good = ~outside
    return slope, offset, residual


def _wander(residual: FloatArray, slope: float, noise: float) -> FloatArray | None:
    """The slow part of the residuals [rows] (s), if it moves samples by more than noise can: the clock was not even."""
    size = max(64, len(residual) // (4 * _PARTS))
    if len(residual) < 8 * size:
        return None
    parts = len(residual) // size
    levels = np.median(residual[: parts * size].reshape(parts, size), axis=1)
    if np.ptp(levels) < max(1.0 * slope, 3.0 * noise):
        return None
    centres = (np.arange(parts) + 0.5) * size
    wander: FloatArray = np.interp(np.arange(len(residual)), centres, levels)
    return wander


def _rate(source: str, rate: float, count: int, noise: float, stated: float | None) -> float:
    """The plainest rate (Hz) that the stamps allow; the stated one if they allow it."""
    # The slope's standard error, with a margin; the last sample moves by a hundredth of a step at most otherwise.
    error = 4.0 * np.sqrt(12.0) * noise * rate / count**1.5
    tolerance = rate * max(error, 0.01 / count)
    if stated is not None:
        if abs(stated - rate) <= max(tolerance, 0.5 * rate / count):
            return stated
        if abs(stated - rate) > 0.01 * rate:
            raise FieldError(
                "rate",
                f"is not clear: the file states {stated:g} Hz, its times say {rate:.6g} Hz; one of both, or no times, "
                "is needed",
                source,
            )
    return plain_rate(rate, min(tolerance, 0.45 * rate / count))


def _shown(times: FloatArray, row: int) -> str:
    """A time as an error shows it; large ones relative to the start."""
    if abs(times[0]) > 1e6:
        return f"{times[row] - times[0]:.9g} after the first"
    return f"{times[row]:.9g}"
