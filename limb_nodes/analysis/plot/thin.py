"""Fewer points for a line on paper, with every peak kept."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from limb_nodes.foundation.arrays import FloatArray

Indices = npt.NDArray[np.intp]

# A panel is some 1000 dots wide; more bins than that cannot be seen.
BINS = 1200
# A step of time this many times the usual one is a gap, over which no line is drawn.
GAP = 3.0


def thinned(times: FloatArray, values: FloatArray, bins: int = BINS) -> tuple[FloatArray, FloatArray]:
    """The lowest and the highest value of each of `bins` stretches of equal time, at their own times.

    First and last point stay. Where samples are missing, a NaN interrupts the line. Short series keep every point.
    """
    gaps = gaps_after(times)
    if len(times) <= 4 * bins:
        keep = np.arange(len(times))
    else:
        # Both sides of a gap stay, so that the line ends where the recording does.
        keep = np.unique(np.concatenate([_extremes(times, values, bins), gaps, gaps + 1, [0, len(times) - 1]]))
    places = np.searchsorted(keep, gaps) + 1
    return np.insert(times[keep], places, times[gaps]), np.insert(values[keep], places, np.nan)


def gaps_after(times: FloatArray) -> Indices:
    """The samples after which time jumps."""
    if len(times) < 3:
        return np.empty(0, dtype=np.intp)
    steps = np.diff(times)
    return np.flatnonzero(steps > GAP * np.median(steps))


def pooled(times: FloatArray, values: FloatArray, bins: int = BINS) -> FloatArray:
    """The highest value of each of at most `bins` stretches of equal time, [bins, columns]; NaN if it has none."""
    steps = np.diff(times)
    if not steps.size or not steps.max() > 0:
        return values[:1]
    usual = float(np.median(steps))
    span = times[-1] - times[0] + usual
    # No more bins than samples would fill.
    count = min(bins, max(1, round(span / usual)))
    places = np.minimum(((times - times[0] + 0.5 * usual) / span * count).astype(np.intp), count - 1)
    starts = np.flatnonzero(np.diff(places, prepend=-1))
    highest = np.full((count, values.shape[1]), np.nan)
    highest[places[starts]] = np.maximum.reduceat(values, starts, axis=0)
    return highest


def _extremes(times: FloatArray, values: FloatArray, bins: int) -> Indices:
    """Index of the lowest and of the highest value of each stretch that has one."""
    edges = np.searchsorted(times, np.linspace(times[0], times[-1], bins + 1)[1:-1])
    low, high = np.where(np.isnan(values), np.inf, values), np.where(np.isnan(values), -np.inf, values)
    indices: list[int] = []
    for start, end in zip([0, *edges], [*edges, len(times)], strict=True):
        if start < end:
            indices += [start + int(low[start:end].argmin()), start + int(high[start:end].argmax())]
    return np.array(indices, dtype=np.intp)
