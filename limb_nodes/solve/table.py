"""Functions of one number as tables of polynomials.

A table holds what a limb's laws give over a range of one variable: smooth pieces between the places
where a law jumps or has a corner, which are found by bisection, each split until its polynomial is
as good as the laws themselves. Where that fails, the coefficients are NaN and the laws must be asked.

The functions are given by address, as those of `limb_nodes.solve.pointer.call`: the variable in
place of the time, the number of its owner in place of the state, values in the result.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from limb_nodes.foundation.arrays import FloatArray, IntArray
from limb_nodes.solve.inner import inner
from limb_nodes.solve.pointer import call

TOLERANCE = 2e-13
NODES = 8
# Halvings of the whole range before a piece that no polynomial fits is searched for a corner.
SEARCH_DEPTH = 6
# Pieces are not split below this part of the range.
LEAST_WIDTH = 1e-6
MOST_PIECES = 4_000
BUCKETS = 1024
_NODES = np.cos(np.pi * (np.arange(NODES) + 0.5) / NODES)
_TO_POWERS = np.linalg.inv(np.vander(_NODES, increasing=True))
_CHECKS = np.array([-0.998, -0.29, 0.1, 0.67, 0.998])
_NO_INPUT = np.empty((1, 1))


@inner
def piece(function, owner, p, k, first, last, left, right, scale, scratch, coefficients):
    """Fill coefficients [last - first, NODES], powers of -1 to 1 across the piece; the largest error over its scale.

    first, last: the values of the function that are wanted.
    """
    width = last - first
    middle, half = 0.5 * (left + right), 0.5 * (right - left)
    for j in range(width):
        for power in range(NODES):
            coefficients[j, power] = 0.0
    for node in range(NODES):
        call(function, middle + half * _NODES[node], owner, p, k, _NO_INPUT, scratch, scratch)
        for j in range(width):
            for power in range(NODES):
                coefficients[j, power] += _TO_POWERS[power, node] * scratch[first + j]
    worst = 0.0
    for s in _CHECKS:
        call(function, middle + half * s, owner, p, k, _NO_INPUT, scratch, scratch)
        for j in range(width):
            value = coefficients[j, NODES - 1]
            for power in range(NODES - 2, -1, -1):
                value = value * s + coefficients[j, power]
            error = abs(value - scratch[first + j]) / scale[j]
            if not error <= worst:
                worst = error
    return worst


@inner
def corner(function, owner, p, k, first, last, left, right, scale, scratch):
    """The place between left and right where values jump or bend most, to the next number."""
    values = np.empty((5, last - first))
    while True:
        step = 0.25 * (right - left)
        for i in range(5):
            call(function, left + i * step, owner, p, k, _NO_INPUT, scratch, scratch)
            for j in range(last - first):
                values[i, j] = scratch[first + j]
        before = after = 0.0
        for j in range(last - first):
            before = max(before, abs(values[0, j] - 2.0 * values[1, j] + values[2, j]) / scale[j])
            after = max(after, abs(values[2, j] - 2.0 * values[3, j] + values[4, j]) / scale[j])
        middle = left + 2.0 * step
        if middle <= left or middle >= right:
            return right
        if before >= after:
            right = middle
        else:
            left = middle


@njit(cache=True, error_model="numpy", nogil=True)
def find_corners(function, owners, p, k, first, last, low, high, scale, scratch, coefficients, found):
    """Fill found with the places from low to high where values of an owner jump or bend; how many there are."""
    owner = np.zeros(1)
    count = 0
    for number in owners:
        owner[0] = number
        # The cells of all depths in order: a cell at `at` of depth d, then its halves.
        level, at = 0, 0
        while level >= 0:
            size = (high - low) / (1 << level)
            left, right = low + at * size, low + (at + 1) * size
            error = piece(function, owner, p, k, first, last, left, right, scale, scratch, coefficients)
            smooth = error <= TOLERANCE
            if not smooth and level < SEARCH_DEPTH:
                level, at = level + 1, 2 * at
                continue
            if not smooth and count < found.size:
                found[count] = corner(function, owner, p, k, first, last, left, right, scale, scratch)
                count += 1
            while level >= 0 and at % 2 == 1:
                level, at = level - 1, at // 2
            level, at = (level, at + 1) if level > 0 else (-1, 0)
    return count


@njit(cache=True, error_model="numpy", nogil=True)
def fit(function, number, breaks, tolerance, p, k, first, last, scale, scratch, edges, table):
    """Fill edges [pieces + 1] and table [pieces, last - first, NODES] between breaks; how many pieces there are.

    The coefficients are NaN where no polynomial will do.
    """
    owner = np.full(1, float(number))
    least = LEAST_WIDTH * (breaks[-1] - breaks[0])
    pieces = 0
    for at in range(breaks.size - 1):
        left, end = breaks[at], breaks[at + 1]
        right = end
        while left < end:
            error = piece(function, owner, p, k, first, last, left, right, scale, scratch, table[pieces])
            if not error <= tolerance:
                # Pieces are halved from the left; the rest is tried whole again.
                if right - left > least and pieces < len(table) - breaks.size:
                    right = 0.5 * (left + right)
                    continue
                for j in range(last - first):
                    table[pieces, j, 0] = np.nan
            edges[pieces] = left
            pieces += 1
            left, right = right, end
    edges[pieces] = breaks[-1]
    return pieces


@njit(cache=True, error_model="numpy", nogil=True)
def first_pieces(edges, starts):
    """Fill starts with the piece in which each bucket begins."""
    at = 0
    span = edges[-1] - edges[0]
    for bucket in range(starts.size):
        while edges[at + 1] <= edges[0] + span * bucket / starts.size:
            at += 1
        starts[bucket] = at


@dataclass(frozen=True)
class Table:
    """Values [n] over a range: edges [pieces + 1], coefficients [pieces, n, NODES] of the powers of -1 to 1
    across each piece, and the piece in which each of as many equal parts of the range begins.
    """

    edges: FloatArray
    coefficients: FloatArray
    starts: IntArray


def tabulate(
    function: int,
    owner: int,
    searched: tuple[int, IntArray],
    parameters: FloatArray,
    index: IntArray,
    wanted: tuple[int, int],
    size: int,
    span: tuple[float, float],
    scale: FloatArray,
    tolerance: float = TOLERANCE,
    buckets: int = BUCKETS,
) -> Table:
    """The table of an owner's values.

    function: its address. searched: another function and its owners, whose corners are those of the values.
    wanted: the first value and the one behind the last, of `size`. scale: of each value wanted; errors stay
    below tolerance * scale.
    """
    width = wanted[1] - wanted[0]
    scratch, coefficients = np.zeros(size), np.empty((width, NODES))
    found = np.empty(MOST_PIECES // 2)
    given = parameters, index, *wanted
    count = find_corners(searched[0], searched[1], *given, *span, scale, scratch, coefficients, found)
    breaks = np.unique(np.concatenate([span, found[:count]]))
    edges, table = np.empty(MOST_PIECES + 1), np.empty((MOST_PIECES, width, NODES))
    pieces = fit(function, owner, breaks, tolerance, *given, scale, scratch, edges, table)
    edges = edges[: pieces + 1].copy()
    starts = np.empty(buckets, dtype=np.int64)
    first_pieces(edges, starts)
    return Table(edges, table[:pieces].copy(), starts)
