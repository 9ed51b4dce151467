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


@njit(cache=True)
def same(one, other):
    """Whether two arrays [n] hold the same numbers."""
    for i in range(one.size):
        if one[i] != other[i]:
            return False
    return True
