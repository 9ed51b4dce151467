"""Sampled inputs as cubic pieces: smooth where the input is, with corners where it has them.

A table of pieces holds, for every interval between two samples, four numbers per input: the
coefficients of the powers 0 to 3 of the part of the interval that has passed.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from limb_nodes.model.layout import FloatArray
from limb_nodes.solve.inner import inner

# A corner: a second difference above this, and this much above those two samples away. A drive is at most 1 and
# a smooth one sampled well below its period has second differences of the order of the period squared.
LEAST_CORNER = 1e-4
CORNER_RATIO = 4.0
# The second difference above which three samples alone are taken for a corner.
STEEPEST_BEND = 1e-2


@njit(cache=True)
def straight(before, after):
    """One interval [1, 4 n] of straight lines between two samples [n]."""
    found = np.zeros((1, 4 * before.size))
    for j in range(before.size):
        found[0, 4 * j] = before[j]
        found[0, 4 * j + 1] = after[j] - before[j]
    return found


@njit(cache=True)
def bent(earlier, before, after):
    """One interval [1, 4 n] between the last two of three samples [n]: a parabola through all three.

    Beside a corner, where the three say nothing of the curvature, it is straight.
    """
    found = np.zeros((1, 4 * before.size))
    for j in range(before.size):
        bend = after[j] - 2.0 * before[j] + earlier[j]
        if abs(bend) > STEEPEST_BEND:
            bend = 0.0
        found[0, 4 * j] = before[j]
        found[0, 4 * j + 1] = after[j] - before[j] - 0.5 * bend
        found[0, 4 * j + 2] = 0.5 * bend
    return found


def corners(samples: FloatArray) -> NDArray[np.bool_]:
    """Whether each sample [T, n] is a corner [T, n]."""
    count, width = samples.shape
    found = np.zeros(samples.size, dtype=np.bool_)
    if count > 2:
        flat = samples.reshape(-1)
        # Of all samples, and of two before and behind them: nothing is known of the bends there.
        bends = np.zeros(samples.size + 4 * width)
        own = bends[3 * width : -3 * width]
        np.subtract(flat[2 * width :] + flat[: -2 * width], 2.0 * flat[width:-width], out=own)
        np.abs(own, out=own)
        sharp = np.flatnonzero(own > LEAST_CORNER) + 3 * width
        beside = np.maximum(bends[sharp - 2 * width], bends[sharp + 2 * width])
        found[sharp - 2 * width] = bends[sharp] > CORNER_RATIO * beside
    return found.reshape(count, width)


@inner
def slopes_of(samples, sharp):
    """Change per interval at every sample [T * n]: a central difference of fourth order.

    Of second order beside corners and next to the ends, one-sided at the ends.
    """
    count, n = samples.shape
    slopes = np.empty(samples.size)
    if count == 2:
        for j in range(n):
            slopes[j] = slopes[n + j] = samples[1, j] - samples[0, j]
        return slopes
    flat = samples.reshape(-1)
    # What lies one and two samples before and behind each of those within; one loop over all is three times as fast.
    before2, before, behind, behind2 = flat[: -4 * n], flat[n:], flat[3 * n :], flat[4 * n :]
    inside = slopes[2 * n :]
    for at in range(max(0, samples.size - 4 * n)):
        inside[at] = (8.0 * (behind[at] - before[at]) - (behind2[at] - before2[at])) / 12.0
    last = count - 1
    for j in range(n):
        slopes[j] = -1.5 * samples[0, j] + 2.0 * samples[1, j] - 0.5 * samples[2, j]
        slopes[last * n + j] = 1.5 * samples[last, j] - 2.0 * samples[last - 1, j] + 0.5 * samples[last - 2, j]
        slopes[n + j] = 0.5 * (samples[2, j] - samples[0, j])
        slopes[(last - 1) * n + j] = 0.5 * (samples[last, j] - samples[last - 2, j])
    for corner in np.flatnonzero(sharp):
        i, j = corner // n, corner % n
        for near in range(max(1, i - 2), min(last, i + 3)):
            slopes[near * n + j] = 0.5 * (samples[near + 1, j] - samples[near - 1, j])
    return slopes


@njit(cache=True, nogil=True)
def cubics(samples, sharp, table):
    """Fill table [T - 1, 4 n] with pieces through samples [T, n], of which some are corners [T, n]."""
    n = samples.shape[1]
    slopes = slopes_of(samples, sharp)
    flat, corner, found = samples.reshape(-1), sharp.reshape(-1), table.reshape((-1, 4))
    following, next_corner, next_slope = flat[n:], corner[n:], slopes[n:]
    for at in range(found.shape[0]):
        rise = following[at] - flat[at]
        # Beside a corner the straight line is the honest guess for the side that the corner hides,
        # and where an input rests on a bound, a cubic must not swing past it.
        start = rise if corner[at] or rise == 0.0 else slopes[at]
        end = rise if next_corner[at] or rise == 0.0 else next_slope[at]
        found[at, 0] = flat[at]
        found[at, 1] = start
        found[at, 2] = 3.0 * rise - 2.0 * start - end
        found[at, 3] = start + end - 2.0 * rise


def pieces(samples: FloatArray, sharp: NDArray[np.bool_] | None = None) -> FloatArray:
    """Table [T - 1, 4 n] of pieces through samples [T, n]; one sample is held.

    sharp: their `corners`, where they are known.
    """
    count, width = samples.shape
    if count == 1:
        held = np.zeros((1, 4 * width))
        held[0, ::4] = samples[0]
        return held
    table = np.empty((count - 1, 4 * width))
    cubics(samples, corners(samples) if sharp is None else sharp, table)
    return table
