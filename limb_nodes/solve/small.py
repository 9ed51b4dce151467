"""Small loops over a few numbers, compiled: array expressions would cost ten times as much per tick."""

from __future__ import annotations

import math

from numba import njit, types

# Compiled, or loaded, with this module: the first tick must not take longer than the others.
CHECK = types.boolean(types.float64[::1])


@njit(CHECK, cache=True)
def finite(values):
    """Whether all numbers [n] are finite."""
    for value in values:
        if not math.isfinite(value):
            return False
    return True


@njit(CHECK, cache=True)
def within_unit(values):
    """Whether all numbers [n] are from 0 to 1."""
    for value in values:
        if not 0.0 <= value <= 1.0:
            return False
    return True


@njit(cache=True)
def hold(torque, state, predicted, period, rows):
    """Fill rows [7, n] for the program's `limb_rates`: torque and slopes [4, n], angle, velocity, curvature.

    predicted: what the tick before expected of the torque [n]; empty where it says nothing.
    """
    n = rows.shape[1]
    for j in range(n):
        for row in range(4):
            rows[row, j] = torque[row, j]
        rows[4, j] = state[j]
        rows[5, j] = state[n + j]
        rows[6, j] = (torque[0, j] - predicted[j]) / (period * period) if predicted.size else 0.0


@njit(cache=True)
def predict(rows, state, period, out):
    """Torque out [n] at the new state by the linear model of the tick before."""
    n = rows.shape[1]
    for j in range(n):
        out[j] = (
            rows[0, j]
            + rows[1, j] * (state[j] - rows[4, j])
            + rows[2, j] * (state[n + j] - rows[5, j])
            + rows[3, j] * period
        )


@njit(cache=True)
def same(one, other):
    """Whether two arrays [n] hold the same numbers."""
    for i in range(one.size):
        if one[i] != other[i]:
            return False
    return True
