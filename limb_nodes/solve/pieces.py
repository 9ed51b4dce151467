"""Sampled inputs as cubic pieces: smooth where the input is, with corners where it has them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from limb_nodes.model.layout import FloatArray

BoolArray = NDArray[np.bool_]

# A corner: a second difference above this, and this much above those beside it. A drive is at most 1 and a
# smooth one sampled well below its period has second differences of the order of the period squared.
LEAST_CORNER = 1e-4
CORNER_RATIO = 4.0
# The second difference above which three samples are taken for a corner.
STEEPEST_BEND = 1e-2


def straight(before: FloatArray, after: FloatArray) -> FloatArray:
    """One interval [1, 4 n] of straight lines between two samples [n]."""
    pieces = np.zeros((1, before.size, 4))
    pieces[0, :, 0] = before
    pieces[0, :, 1] = after - before
    return pieces.reshape(1, -1)


def bent(earlier: FloatArray, before: FloatArray, after: FloatArray) -> FloatArray:
    """One interval [1, 4 n] between the last two of three samples [n]: a parabola through all three.

    Beside a corner, where the three say nothing of the curvature, it is straight.
    """
    bend = after - 2.0 * before + earlier
    bend[np.abs(bend) > STEEPEST_BEND] = 0.0
    found = np.zeros((1, before.size, 4))
    found[0, :, 0] = before
    found[0, :, 1] = after - before - 0.5 * bend
    found[0, :, 2] = 0.5 * bend
    return found.reshape(1, -1)


def corners(samples: FloatArray) -> BoolArray:
    """Whether each sample [T, n] is a corner [T, n]."""
    found: BoolArray = np.zeros(samples.shape, dtype=np.bool_)
    if len(samples) < 3:
        return found
    bend = np.abs(np.diff(samples, n=2, axis=0))
    padded = np.pad(bend, ((2, 2), (0, 0)))
    beside = np.maximum(padded[:-4], padded[4:])
    found[1:-1] = (bend > LEAST_CORNER) & (bend > CORNER_RATIO * beside)
    return found


def pieces(samples: FloatArray) -> FloatArray:
    """Coefficients of powers of the part of an interval [T - 1, 4 n], four per column of [T, n].

    The pieces pass through the samples; their slopes there are central differences of fourth order,
    or of second order beside corners and ends, and one-sided at corners. One sample is held.
    """
    count, width = samples.shape
    if count == 1:
        return straight(samples[0], samples[0])
    rise = np.diff(samples, axis=0)
    slope = np.empty_like(samples)
    slope[1:-1] = 0.5 * (rise[1:] + rise[:-1])
    slope[0], slope[-1] = rise[0], rise[-1]
    if count >= 3:
        slope[0] = 1.5 * rise[0] - 0.5 * rise[1]
        slope[-1] = 1.5 * rise[-1] - 0.5 * rise[-2]
    sharp = corners(samples)
    if count >= 5:
        wide = (8.0 * (samples[3:-1] - samples[1:-3]) - (samples[4:] - samples[:-4])) / 12.0
        calm = ~(sharp[:-4] | sharp[1:-3] | sharp[2:-2] | sharp[3:-1] | sharp[4:])
        slope[2:-2] = np.where(calm, wide, slope[2:-2])
    left, right = slope[:-1], slope[1:]
    # Beside a corner the straight line is the honest guess for the side that the corner hides.
    left = np.where(sharp[:-1], rise, left)
    right = np.where(sharp[1:], rise, right)
    # Where an input rests on a bound, a cubic must not swing past it.
    flat = rise == 0.0
    left, right = np.where(flat, 0.0, left), np.where(flat, 0.0, right)
    table = np.empty((count - 1, width, 4))
    table[:, :, 0] = samples[:-1]
    table[:, :, 1] = left
    table[:, :, 2] = 3.0 * rise - 2.0 * left - right
    table[:, :, 3] = left + right - 2.0 * rise
    return table.reshape(count - 1, -1)
