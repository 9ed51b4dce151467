"""Sampled inputs as cubic pieces: smooth if the input is, with the corners that it has.

A table of pieces holds, for every interval between two samples, four numbers per input: the
coefficients of the powers 0 to 3 of the part of the interval that has passed.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from limb_nodes.foundation.arrays import BoolArray, FloatArray

# A corner: a second difference above this, and this much above those two samples away. A drive is at most 1 and
# a smooth one sampled well below its period has second differences of the order of the period squared.
LEAST_CORNER = 1e-4
CORNER_RATIO = 4.0
# The second difference above which three samples alone are taken for a corner.
STEEPEST_BEND = 1e-2
# A piece and a corner are known by so many samples on both sides.
REACH = 8


@njit(cache=True)
def not_below_zero(before, after, start, end):
    """The slopes at both ends of a piece, which is not to go below zero between two samples that are not.

    A force that is less than nothing would feed energy in. Schmidt and Hess, BIT 28 (1988) 340.
    """
    if before < 0.0 or after < 0.0:
        return start, end
    return max(start, -3.0 * before), min(end, 3.0 * after)


@njit(cache=True)
def straight(before, after):
    """One interval [1, 4 n] of straight lines between two samples [n]."""
    piece = np.zeros((1, 4 * before.size))
    for j in range(before.size):
        piece[0, 4 * j] = before[j]
        piece[0, 4 * j + 1] = after[j] - before[j]
    return piece


@njit(cache=True)
def bent(earlier, before, after):
    """One interval [1, 4 n] between the last two of three samples [n]: a parabola through all three.

    Beside a corner it is straight: there the three say nothing of the curvature.
    """
    piece = np.zeros((1, 4 * before.size))
    for j in range(before.size):
        rise, bend = after[j] - before[j], after[j] - 2.0 * before[j] + earlier[j]
        slopes = rise - 0.5 * bend, rise + 0.5 * bend
        if abs(bend) > STEEPEST_BEND or not_below_zero(before[j], after[j], *slopes) != slopes:
            bend = 0.0
        piece[0, 4 * j] = before[j]
        piece[0, 4 * j + 1] = rise - 0.5 * bend
        piece[0, 4 * j + 2] = 0.5 * bend
    return piece


@njit(cache=True)
def part_of(piece, start, end):
    """A part of an interval [1, 4 n], as one of its own; start, end: shares of the interval."""
    part = np.empty_like(piece)
    width = end - start
    for i in range(0, piece.shape[1], 4):
        c0, c1, c2, c3 = piece[0, i], piece[0, i + 1], piece[0, i + 2], piece[0, i + 3]
        part[0, i] = c0 + start * (c1 + start * (c2 + start * c3))
        part[0, i + 1] = width * (c1 + start * (2.0 * c2 + 3.0 * start * c3))
        part[0, i + 2] = width * width * (c2 + 3.0 * start * c3)
        part[0, i + 3] = width * width * width * c3
    return part


def corners(samples: FloatArray) -> BoolArray:
    """Whether each sample [T, n] is a corner [T, n]."""
    count, width = samples.shape
    corner = np.zeros(samples.size, dtype=np.bool_)
    if count > 2:
        flat = samples.reshape(-1)
        # Of all samples, and of two before and behind them: nothing is known of the bends there.
        bends = np.zeros(samples.size + 4 * width)
        own = bends[3 * width : -3 * width]
        np.subtract(flat[2 * width :] + flat[: -2 * width], 2.0 * flat[width:-width], out=own)
        np.abs(own, out=own)
        sharp = np.flatnonzero(own > LEAST_CORNER) + 3 * width
        beside = np.maximum(bends[sharp - 2 * width], bends[sharp + 2 * width])
        corner[sharp - 2 * width] = bends[sharp] > CORNER_RATIO * beside
    return corner.reshape(count, width)


def slopes_of(samples: FloatArray, corner: BoolArray) -> FloatArray:
    """Change per interval at every sample [T, n]: a central difference of fourth order.

    Of second order beside the corners [T, n] and next to the ends, one-sided at the ends.
    """
    if len(samples) == 2:
        return np.repeat(samples[1:] - samples[:1], 2, axis=0)
    slopes = np.empty_like(samples)
    near, inside = slopes[1:-1], slopes[2:-2]
    np.subtract(samples[2:], samples[:-2], out=near)
    wide = samples[4:] - samples[:-4]
    rows, columns = np.nonzero(corner)
    beside = np.clip(rows[:, np.newaxis] + np.arange(-2, 3), 1, len(samples) - 2), columns[:, np.newaxis]
    bent = 0.5 * slopes[beside]
    near[[0, -1]] *= 0.5
    inside *= 8.0
    inside -= wide
    inside /= 12.0
    slopes[beside] = bent
    slopes[0] = -1.5 * samples[0] + 2.0 * samples[1] - 0.5 * samples[2]
    slopes[-1] = 1.5 * samples[-1] - 2.0 * samples[-2] + 0.5 * samples[-3]
    return slopes


@njit(cache=True, nogil=True)
def cubics(samples, n, slopes, corner, table):
    """Fill table [4 * (T - 1) * n] with pieces through samples [T * n].

    slopes: at the samples. corner: whether each is one.
    """
    for at in range(samples.size - n):
        rise = samples[at + n] - samples[at]
        # Beside a corner the straight line is the honest guess for the side that the corner hides,
        # and if an input rests on a bound, a cubic must not swing past it.
        start = rise if corner[at] or rise == 0.0 else slopes[at]
        end = rise if corner[at + n] or rise == 0.0 else slopes[at + n]
        start, end = not_below_zero(samples[at], samples[at + n], start, end)
        table[4 * at] = samples[at]
        table[4 * at + 1] = start
        table[4 * at + 2] = 3.0 * rise - 2.0 * start - end
        table[4 * at + 3] = start + end - 2.0 * rise


def pieces(samples: FloatArray, sharp: BoolArray | None = None) -> FloatArray:
    """Table [T - 1, 4 n] of pieces through samples [T, n]; one sample is held.

    sharp: their `corners`, if they are known.
    """
    count, width = samples.shape
    if count == 1:
        held = np.zeros((1, 4 * width))
        held[0, ::4] = samples[0]
        return held
    table = np.empty((count - 1, 4 * width))
    corner = corners(samples) if sharp is None else sharp
    slopes = slopes_of(samples, corner)
    cubics(samples.reshape(-1), width, slopes.reshape(-1), corner.reshape(-1), table.reshape(-1))
    return table
