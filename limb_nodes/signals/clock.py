"""The clock of a recording: an even one, fitted to all stamps, whatever noise, rounding or packets are in them.

A stamp is taken as `start + (row + missing rows before) / rate + noise`. The rows were sampled evenly, the noise came
to their stamps later; so row k belongs to tick k plus what is missing before it, and the samples stay as they are.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.ndimage import median_filter
from scipy.optimize import linprog

from limb_nodes.errors import FieldError, UserError
from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.foundation.parameter import Parameter

_HIGHEST = 1e6
RATE = Parameter("rate", "Hz", "samples per second", above=0.0, maximum=_HIGHEST)
# A clock whose rate moves by more than this part is not one clock.
_SAME_RATE = 0.005
# Later times (s) are none; from 1970 on, 3 million years.
_LATEST = 1e14
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
    _check_stamps(source, times, place)
    begin = float(times[0])
    relative = times - begin
    rows = np.arange(len(times), dtype=np.float64)
    ticks: npt.NDArray[np.int64] | None = None
    quantum = _quantum(times)
    line = _straight(rows, relative, 0.5 * quantum)
    if line is None:
        parts = _Parts(relative)
        parts.check_one_rate(source, place)
        step = parts.step
        # The second time with the step of the whole recording instead of that of its parts.
        for _ in range(2):
            missing = _missing_rows(source, times, step, quantum, place)
            _check_size(source, times, missing, place)
            rows = np.arange(len(times)) + np.concatenate([[0.0], np.cumsum(missing)])
            step, offset = _robust_line(rows, relative)
            if not 1.0 / _HIGHEST < step < _LATEST:
                raise _uneven(source, times, int(np.abs(np.diff(relative)).argmax()) + 1, parts.step, place)
        ticks = rows.astype(np.int64) if missing.any() else None
        line = step, offset, 0.0
    slope, offset, width = line
    if slope * _HIGHEST < 1.0 - 1e-6:
        raise UserError(
            f"{source}: the times are {slope:.6g} s apart; {1.0 / _HIGHEST:g} s or more is needed, or a rate"
        )
    residual = relative - slope * rows
    residual -= offset
    noise = 1.4826 * float(np.median(np.abs(residual)))
    wander = _wander(source, times, residual, slope, place)
    count = len(times) if ticks is None else int(ticks[-1]) + 1
    rate = _rate(source, 1.0 / slope, count, noise, width / slope**2, stated)
    notes = []
    if ticks is not None:
        notes.append(f"rows missing between the first and the last time: {count - len(times)}")
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


def _check_stamps(source: str, times: FloatArray, place: Callable[[int], str]) -> None:
    """Raise UserError if there is only one stamp, one is missing, or none is later than the first."""
    if len(times) < 2:
        raise UserError(f"{source}: holds one row; at least 2 are needed for a rate")
    if not np.isfinite(times).all():
        row = int(np.isfinite(times).argmin())
        allowed = f"a number > {_shown(times, row - 1)}, the time before," if row else "a number"
        raise UserError(f"{source}, {place(row)}: time is missing; {allowed} in s is needed")
    late = np.abs(times) > _LATEST
    if late.any():
        row = int(late.argmax())
        raise UserError(f"{source}, {place(row)}: time is {times[row]:.9g}; a number < {_LATEST:g} in s is needed")
    back = np.diff(times) <= 0.0
    if times.max() <= times[0] or (len(times) < _LEAST_NOISY and back.any()):
        raise _not_after(source, times, int(back.argmax()) + 1, place)


def _not_after(source: str, times: FloatArray, row: int, place: Callable[[int], str]) -> UserError:
    return UserError(
        f"{source}, {place(row)}: time is {_shown(times, row)}; a number > {_shown(times, row - 1)}, the time before, "
        "in s is needed, or a rate"
    )


def _quantum(times: FloatArray) -> float:
    """What the stamps are rounded to (s), with what floats round themselves."""
    some = times[:: max(1, len(times) // 1000)]
    exact = 4.0 * float(np.spacing(np.abs(times).max()))
    for decimals in range(10):
        scaled = some * 10.0**decimals
        if np.abs(scaled - np.rint(scaled)).max() <= 1e-6 + exact * 10.0**decimals:
            return 10.0**-decimals + 2.0 * exact
    return 1e-9 + 2.0 * exact


def _straight(rows: FloatArray, relative: FloatArray, tolerance: float) -> tuple[float, float, float] | None:
    """Slope (s), offset (s) and how far the slope may differ, of a line with all stamps within the tolerance (s)."""
    slope, offset = _least_squares(rows, relative)
    residual = relative - slope * rows
    residual -= offset
    largest = float(np.abs(residual).max())
    if slope <= 0.0 or largest > 4.0 * tolerance:
        return None
    if largest <= min(tolerance, 0.01 * slope):
        return slope, offset, 0.01 * slope / len(rows)
    # All lines that pass every stamp so near; of each part of the rows, only the farthest stamps count.
    size = max(1, len(rows) // 300)
    edges = np.arange(0, len(rows), size)
    highest, lowest = np.maximum.reduceat(residual, edges), np.minimum.reduceat(residual, edges)
    at = edges / len(rows)
    sides = np.concatenate([np.column_stack([-at, -np.ones(len(at))]), np.column_stack([at, np.ones(len(at))])])
    limits = np.concatenate([tolerance - highest, tolerance + lowest]) / tolerance + 0.01
    # Variables: change of the slope over all rows, change of the offset; both in units of the tolerance.
    ends = [linprog([sign, 0.0], A_ub=sides, b_ub=limits, bounds=(None, None)) for sign in (1.0, -1.0)]
    if any(end.status != 0 for end in ends):
        return None
    change, move = 0.5 * (ends[0].x + ends[1].x) * tolerance
    width = 0.5 * float(ends[1].x[0] - ends[0].x[0]) * tolerance
    return slope + float(change) / len(rows), offset + float(move), width / len(rows)


def _least_squares(x: FloatArray, y: FloatArray) -> tuple[float, float]:
    """Slope and offset of the line through points."""
    mean_x, mean_y = float(x.mean()), float(y.mean())
    centred = x - mean_x
    slope = float(centred @ (y - mean_y) / (centred @ centred))
    return slope, mean_y - slope * mean_x


class _Parts:
    """The slopes of the stamps in equal parts of the rows; a gap is in one of them.

    step: s, their median.
    """

    def __init__(self, relative: FloatArray) -> None:
        self._relative = relative
        rows = len(relative)
        packet = rows / max(1, int((np.diff(relative) > 0.0).sum()))
        self._size = int(min(rows, max(16, rows // _PARTS, 20 * packet)))
        self._slopes = np.array([self._line(part)[0] for part in range(rows // self._size)])
        self.step = float(np.median(self._slopes))
        if self.step <= 0.0:
            self.step = float(relative.max()) / (rows - 1)

    def _line(self, part: int) -> tuple[float, float]:
        start = part * self._size
        rows = np.arange(start, start + self._size, dtype=np.float64)
        return _least_squares(rows, self._relative[start : start + self._size])

    def check_one_rate(self, source: str, place: Callable[[int], str]) -> None:
        """Raise UserError if the rows come at one rate first and at another one later."""
        slopes = self._slopes
        if len(slopes) < 6:
            return
        middles = [
            (float(np.median(slopes[:cut])), float(np.median(slopes[cut:]))) for cut in range(2, len(slopes) - 1)
        ]
        # The cut that leaves the least on either side.
        left = [
            float(np.abs(slopes[:cut] - before).sum() + np.abs(slopes[cut:] - after).sum())
            for cut, (before, after) in enumerate(middles, 2)
        ]
        cut = int(np.argmin(left)) + 2
        before, after = middles[cut - 2]
        change = abs(after - before)
        if min(before, after) <= 0.0 or change <= _SAME_RATE * min(before, after):
            return
        # What is left of a change is small: noise and gaps leave as much without a cut.
        if left[cut - 2] > 0.25 * float(np.abs(slopes - self.step).sum()) and change < 8.0 * left[cut - 2] / len(
            slopes
        ):
            return
        first, second = self._line(max(0, cut - 2)), self._line(min(len(slopes) - 1, cut + 1))
        meet = (second[1] - first[1]) / (first[0] - second[0])
        row = int(np.clip(round(meet), (cut - 1) * self._size, (cut + 1) * self._size))
        raise UserError(
            f"{source}, {place(row)}: the rate is {1.0 / after:.6g} Hz from here on, {1.0 / before:.6g} Hz before; one "
            "rate is needed: cut the file there, or give the rate"
        )


def _missing_rows(
    source: str, times: FloatArray, step: float, quantum: float, place: Callable[[int], str]
) -> npt.NDArray[np.int64]:
    """How many rows are missing before each row but the first: [rows - 1].

    Raises UserError if a stamp goes back, or if a few stamps are neither even nor many enough to tell noise.
    """
    steps = np.diff(times)
    middle = float(np.median(steps))
    apart = np.rint(np.minimum(steps / middle, 1e15)) if middle > 0.0 else np.zeros(len(steps))
    told = middle > 0.0 and float((np.abs(steps - apart * middle) > 0.25 * middle).mean()) < 0.02
    if told and float((apart < 1.0).mean()) < 0.02:
        # Every stamp tells its own row.
        # Two rows share a time if rounding is as coarse as the steps, and one seems to be missing at times.
        coarse = quantum > 0.4 * middle
        wrong = steps < 0.0 if coarse else steps <= 0.0
        if wrong.any():
            raise _not_after(source, times, int(wrong.argmax()) + 1, place)
        if coarse and ((steps == 0.0).any() or (apart == 2.0).sum() > 1):
            rows = np.arange(len(times)) + np.concatenate([[0.0], np.cumsum(np.where(apart > 2.0, apart - 1.0, 0.0))])
            if _straight(rows, times - times[0], quantum):
                apart[apart <= 2.0] = 1.0
        # A late stamp before one in time makes a long step and a short one, and nothing is missing.
        late = np.flatnonzero((apart[:-1] > 1.0) & (steps[1:] < 0.75 * middle * np.maximum(apart[1:], 1.0)))
        apart[late] = np.rint((steps[late] + steps[late + 1]) / middle) - 1.0
        return np.maximum(apart.astype(np.int64) - 1, 0)
    if len(times) < _LEAST_NOISY:
        off = np.abs(steps / step - np.maximum(1.0, np.rint(steps / step))) > 0.25
        raise _uneven(source, times, int(off.argmax()) + 1, step, place)
    rising = steps[steps > 0.0]
    usual = float(np.median(rising))
    spread = float(np.median(np.abs(rising - usual)))
    back = steps < 0.0
    if back.any() and (back.mean() < 0.02 or steps.min() < -(usual + 12.0 * spread)):
        raise _not_after(source, times, int(steps.argmin()) + 1, place)
    return _shifts(times, steps, step, usual + 12.0 * spread + 0.5 * usual)


def _shifts(times: FloatArray, steps: FloatArray, step: float, least: float) -> npt.NDArray[np.int64]:
    """The missing rows [rows - 1] where all stamps that follow are late; a late stamp alone is followed by early ones.

    step: s. least: s, what a gap's step is longer than.
    """
    missing = np.zeros(len(steps), dtype=np.int64)
    packet = len(steps) / max(1, int((steps > 0.0).sum()))
    width = max(60, int(12 * packet))
    for after in np.flatnonzero(steps > least):
        before, behind = times[max(0, after + 1 - width) : after + 1], times[after + 1 : after + 1 + width]
        before = before - step * np.arange(-len(before), 0)
        # The late stamp itself, which the gap was looked for at, would seem to be one.
        behind = (behind - step * np.arange(len(behind)))[1:]
        if len(behind) < max(10.0, 2.0 * packet):
            continue
        shift = float(np.median(behind) - np.median(before))
        error = np.sqrt(packet * (before.var() / len(before) + behind.var() / len(behind)))
        if shift > 0.5 * step and shift > 6.0 * error:
            missing[after] = round(min(shift / step, 1e15))
    return missing


def _check_size(source: str, times: FloatArray, missing: npt.NDArray[np.int64], place: Callable[[int], str]) -> None:
    """Raise UserError if more is missing than there is, before memory is taken for it."""
    if float(missing.sum(dtype=np.float64)) > max(1000, 4 * len(times)):
        row = int(missing.argmax()) + 1
        raise UserError(
            f"{source}, {place(row)}: time is {_shown(times, row)}, {times[row] - times[row - 1]:.6g} s after the one "
            "before, as if the clock was set; times that rise evenly are needed, or a rate"
        )


def _robust_line(rows: FloatArray, relative: FloatArray) -> tuple[float, float]:
    """Slope (s) and offset (s) of the line through the stamps; outliers weigh nothing."""
    slope, offset = _least_squares(rows, relative)
    for _ in range(2):
        residual = np.abs(relative - slope * rows - offset)
        good = residual <= 6.0 * float(np.median(residual)) + 1e-9 * slope
        if good.all() or good.mean() < 0.8:
            break
        slope, offset = _least_squares(rows[good], relative[good])
    return slope, offset


def _wander(
    source: str, times: FloatArray, residual: FloatArray, slope: float, place: Callable[[int], str]
) -> FloatArray | None:
    """The slow part of the residuals [rows] (s), if it moves samples by more than noise can: the clock was not even.

    Raises UserError if it moves too fast for one clock.
    """
    size = max(64, len(residual) // (4 * _PARTS))
    parts = len(residual) // size
    if parts < 8:
        return None
    # A late packet moves one part or two; a clock moves all that follow.
    levels = median_filter(np.median(residual[: parts * size].reshape(parts, size), axis=1), 5, mode="nearest")
    centres = (np.arange(parts) + 0.5) * size
    wander: FloatArray = np.interp(np.arange(len(residual)), centres, levels)
    noise = 1.4826 * float(np.median(np.abs(residual - wander)))
    if np.ptp(levels) < max(slope, 3.0 * noise):
        return None
    moves = np.abs(np.diff(levels))
    if moves.max() > _SAME_RATE * slope * size + noise:
        raise _uneven(source, times, int(centres[moves.argmax()]), slope, place)
    return wander


def _rate(source: str, rate: float, count: int, noise: float, width: float, stated: float | None) -> float:
    """The plainest rate (Hz) that the stamps allow, or the stated one. width: what rounding hides of it (Hz)."""
    # The slope's standard error, with a margin; the last sample moves by a hundredth of a step at most otherwise.
    error = 0.0 if width else 4.0 * np.sqrt(12.0) * noise * rate / count**1.5
    tolerance = max(width, rate * max(error, 0.01 / count))
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
