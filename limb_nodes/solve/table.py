"""Functions of one number as tables of polynomials.

A table holds what a limb's laws give over a range of one variable: smooth pieces between the places
at which a law jumps or has a corner, which bisection tells, each split until its polynomial is
as good as the laws themselves. Where that fails, the coefficients are NaN and the laws must be asked.

The functions are those of a problem (`limb_nodes.solve.problem`), called as its rates: the variable in place of the
time, the number of its owner in place of the state, values in the result.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from limb_nodes.foundation.arrays import FloatArray, IntArray
from limb_nodes.foundation.records import Record
from limb_nodes.solve.inner import inner
from limb_nodes.solve.pointer import record_at
from limb_nodes.solve.problem import evaluate, problem_type

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


@inner
def piece(problem, owner, values, left, right, scale, scratch, coefficients):
    """Fill coefficients [values, NODES], powers of -1 to 1 across the piece; the largest error over its scale."""
    first, width = values[0], values[1] - values[0]
    middle, half = 0.5 * (left + right), 0.5 * (right - left)
    for j in range(width):
        for power in range(NODES):
            coefficients[j, power] = 0.0
    for node in range(NODES):
        evaluate(problem.rates, middle + half * _NODES[node], owner, problem, scratch)
        for j in range(width):
            for power in range(NODES):
                coefficients[j, power] += _TO_POWERS[power, node] * scratch[first + j]
    worst = 0.0
    for s in _CHECKS:
        evaluate(problem.rates, middle + half * s, owner, problem, scratch)
        for j in range(width):
            value = coefficients[j, NODES - 1]
            for power in range(NODES - 2, -1, -1):
                value = value * s + coefficients[j, power]
            error = abs(value - scratch[first + j]) / scale[j]
            if not error <= worst:
                worst = error
    return worst


@inner
def corner(problem, owner, values, left, right, scale, scratch):
    """The place between left and right at which values jump or bend most, to the next number."""
    first, last = values
    seen = np.empty((5, last - first))
    while True:
        step = 0.25 * (right - left)
        for i in range(5):
            evaluate(problem.rates, left + i * step, owner, problem, scratch)
            for j in range(last - first):
                seen[i, j] = scratch[first + j]
        before = after = 0.0
        for j in range(last - first):
            before = max(before, abs(seen[0, j] - 2.0 * seen[1, j] + seen[2, j]) / scale[j])
            after = max(after, abs(seen[2, j] - 2.0 * seen[3, j] + seen[4, j]) / scale[j])
        middle = left + 2.0 * step
        if middle <= left or middle >= right:
            return right
        if before >= after:
            right = middle
        else:
            left = middle


@njit(cache=True, error_model="numpy", nogil=True)
def find_corners(problem_, owners, values, span, scale, places):
    """Fill places with those in the span at which values of an owner jump or bend; how many there are.

    problem_: its address.
    """
    problem = record_at(problem_, problem_type)
    low, high = span
    scratch, coefficients = np.empty(problem.states), np.empty((scale.size, NODES))
    owner = np.zeros(1)
    count = 0
    for number in owners:
        owner[0] = number
        # The cells of all depths in order: a cell at `at` of depth d, then its halves.
        level, at = 0, 0
        while level >= 0:
            size = (high - low) / (1 << level)
            left, right = low + at * size, low + (at + 1) * size
            error = piece(problem, owner, values, left, right, scale, scratch, coefficients)
            smooth = error <= TOLERANCE
            if not smooth and level < SEARCH_DEPTH:
                level, at = level + 1, 2 * at
                continue
            if not smooth and count < places.size:
                places[count] = corner(problem, owner, values, left, right, scale, scratch)
                count += 1
            while level >= 0 and at % 2 == 1:
                level, at = level - 1, at // 2
            level, at = (level, at + 1) if level > 0 else (-1, 0)
    return count


@njit(cache=True, error_model="numpy", nogil=True)
def fit(problem_, number, breaks, values, scale, tolerance, edges, table):
    """Fill edges [pieces + 1] and table [pieces, values, NODES] between breaks; how many pieces there are.

    The coefficients are NaN if no polynomial will do.
    """
    problem = record_at(problem_, problem_type)
    owner, scratch = np.full(1, float(number)), np.empty(problem.states)
    least = LEAST_WIDTH * (breaks[-1] - breaks[0])
    pieces = 0
    for at in range(breaks.size - 1):
        left, end = breaks[at], breaks[at + 1]
        right = end
        while left < end:
            error = piece(problem, owner, values, left, right, scale, scratch, table[pieces])
            if not error <= tolerance:
                # Pieces are halved from the left; the rest is tried whole again.
                if right - left > least and pieces < len(table) - breaks.size:
                    right = 0.5 * (left + right)
                    continue
                for j in range(scale.size):
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
    problem: Record,
    owner: int,
    searched: tuple[Record, IntArray],
    values: tuple[int, int],
    span: tuple[float, float],
    scale: FloatArray,
    tolerance: float,
) -> Table:
    """The table of some of an owner's values over a span of the variable.

    searched: another problem and its owners, whose corners are those of the values. values: the first, and the one
    behind the last. scale: [values], their typical sizes; errors stay below tolerance * scale.
    """
    places = np.empty(MOST_PIECES // 2)
    count = find_corners(searched[0].address, searched[1], values, span, scale, places)
    breaks = np.unique(np.concatenate([span, places[:count]]))
    edges, table = np.empty(MOST_PIECES + 1), np.empty((MOST_PIECES, scale.size, NODES))
    pieces = fit(problem.address, owner, breaks, values, scale, tolerance, edges, table)
    edges = edges[: pieces + 1].copy()
    starts = np.empty(BUCKETS, dtype=np.int64)
    first_pieces(edges, starts)
    return Table(edges, table[:pieces].copy(), starts)
