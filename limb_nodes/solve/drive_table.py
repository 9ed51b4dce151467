"""What an excitation does to a muscle and its motor units, as a table of polynomials.

With many motor units a muscle's drives cost more than its mechanics, although all of them follow
from one number. The table holds them over the excitation from 0 to 1: smooth pieces between the
places where a unit joins or a law has a corner, found by bisection unit by unit, each split until
its polynomial is as good as the laws themselves. Where that fails, the laws are evaluated.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from limb_nodes.model.layout import GROUP_INDEX, MUSCLE_INDEX, UNIT_INDEX, FloatArray, IntArray, Layout
from limb_nodes.solve.inner import inner
from limb_nodes.solve.pointer import Callback, call

# A drive is at most of the order of 1.
TOLERANCE = 2e-13
NODES = 8
# Halvings of the whole range before a piece that no polynomial fits is searched for a corner.
SEARCH_DEPTH = 6
LEAST_WIDTH = 1e-6
MOST_PIECES = 4_000
BUCKETS = 1024
_NODES = np.cos(np.pi * (np.arange(NODES) + 0.5) / NODES)
_TO_POWERS = np.linalg.inv(np.vander(_NODES, increasing=True))
_CHECKS = np.array([-0.998, -0.29, 0.1, 0.67, 0.998])
_NO_TABLE = np.empty((1, 1))


@inner
def piece(drive, owner, p, k, first, last, left, right, scratch, coefficients):
    """Fill coefficients [last - first, NODES], powers of -1 to 1 across the piece; the largest error.

    drive: address of the program's drives of one owner; first, last: those that are wanted.
    """
    width = last - first
    middle, half = 0.5 * (left + right), 0.5 * (right - left)
    for j in range(width):
        for power in range(NODES):
            coefficients[j, power] = 0.0
    for node in range(NODES):
        call(drive, middle + half * _NODES[node], owner, p, k, _NO_TABLE, scratch, scratch)
        for j in range(width):
            for power in range(NODES):
                coefficients[j, power] += _TO_POWERS[power, node] * scratch[first + j]
    worst = 0.0
    for s in _CHECKS:
        call(drive, middle + half * s, owner, p, k, _NO_TABLE, scratch, scratch)
        for j in range(width):
            value = coefficients[j, NODES - 1]
            for power in range(NODES - 2, -1, -1):
                value = value * s + coefficients[j, power]
            error = abs(value - scratch[first + j]) / max(1.0, abs(scratch[first + j]))
            if not error <= worst:
                worst = error
    return worst


@inner
def corner(drive, owner, p, k, first, last, left, right, scratch):
    """The place between left and right where drives jump or bend most, to the next number."""
    values = np.empty((5, last - first))
    while True:
        step = 0.25 * (right - left)
        for i in range(5):
            call(drive, left + i * step, owner, p, k, _NO_TABLE, scratch, scratch)
            for j in range(last - first):
                values[i, j] = scratch[first + j]
        before = after = 0.0
        for j in range(last - first):
            before = max(before, abs(values[0, j] - 2.0 * values[1, j] + values[2, j]))
            after = max(after, abs(values[2, j] - 2.0 * values[3, j] + values[4, j]))
        middle = left + 2.0 * step
        if middle <= left or middle >= right:
            return right
        if before >= after:
            right = middle
        else:
            left = middle


@njit(cache=True, error_model="numpy", nogil=True)
def find_corners(drive, units, p, k, first, last, scratch, coefficients, found):
    """Fill found with the places where the drives of single units jump or bend; how many there are."""
    owner = np.zeros(1)
    depth, count = SEARCH_DEPTH, 0
    for unit in units:
        owner[0] = unit
        # The cells of all depths in order: a cell at `at` of depth d, then its halves.
        level, at = 0, 0
        while level >= 0:
            size = 1.0 / (1 << level)
            left, right = at * size, (at + 1) * size
            smooth = piece(drive, owner, p, k, first, last, left, right, scratch, coefficients) <= TOLERANCE
            if not smooth and level < depth:
                level, at = level + 1, 2 * at
                continue
            if not smooth and count < found.size:
                found[count] = corner(drive, owner, p, k, first, last, left, right, scratch)
                count += 1
            while level >= 0 and at % 2 == 1:
                level, at = level - 1, at // 2
            level, at = (level, at + 1) if level > 0 else (-1, 0)
    return count


@njit(cache=True, error_model="numpy", nogil=True)
def fit(drive, muscle, breaks, tolerance, p, k, first, last, scratch, edges, table):
    """Fill edges [pieces + 1] and table [pieces, last - first, NODES] between breaks; how many pieces there are.

    The coefficients are NaN where no polynomial will do.
    """
    owner = np.full(1, float(muscle))
    pieces = 0
    for at in range(breaks.size - 1):
        left, end = breaks[at], breaks[at + 1]
        right = end
        while left < end:
            error = piece(drive, owner, p, k, first, last, left, right, scratch, table[pieces])
            if not error <= tolerance:
                # Pieces are halved from the left; the rest is tried whole again.
                if right - left > LEAST_WIDTH and pieces < len(table) - breaks.size:
                    right = 0.5 * (left + right)
                    continue
                for j in range(last - first):
                    table[pieces, j, 0] = np.nan
            edges[pieces] = left
            pieces += 1
            left, right = right, end
    edges[pieces] = 1.0
    return pieces


@njit(cache=True, error_model="numpy", nogil=True)
def first_pieces(edges, starts):
    """Fill starts with the piece in which each bucket begins."""
    at = 0
    for bucket in range(starts.size):
        while edges[at + 1] <= bucket / starts.size:
            at += 1
        starts[bucket] = at


@njit(cache=True, error_model="numpy", nogil=True)
def look_up(edges, table, starts, muscle_drive, muscle, p, k, first, last, excitation, out):
    """Fill columns first to last of out [T, drives] for a muscle's excitation [T]."""
    owner = np.full(1, float(muscle))
    scratch = np.empty(out.shape[1])
    before = np.nan
    for row in range(excitation.size):
        a = excitation[row]
        if a == before:
            for j in range(first, last):
                out[row, j] = out[row - 1, j]
            continue
        before = a
        known = False
        if 0.0 < a < 1.0:
            at = starts[int(a * BUCKETS)]
            while edges[at + 1] <= a:
                at += 1
            left, right = edges[at], edges[at + 1]
            s = (2.0 * a - left - right) / (right - left)
            known = True
            for j in range(first, last):
                value = table[at, j - first, NODES - 1]
                for power in range(NODES - 2, -1, -1):
                    value = value * s + table[at, j - first, power]
                out[row, j] = value
                known = known and value == value
        if not known:
            call(muscle_drive, a, owner, p, k, _NO_TABLE, scratch, scratch)
            for j in range(first, last):
                out[row, j] = scratch[j]


@dataclass(frozen=True)
class MuscleTable:
    """The table of one muscle: its pieces, and its drives first to last among all."""

    edges: FloatArray
    coefficients: FloatArray
    starts: IntArray
    first: int
    last: int


class DriveTable:
    """The drives of all muscles of a limb.

    unit_drive, muscle_drive: the program's functions of one unit and of one muscle.
    """

    def __init__(self, layout: Layout, unit_drive: Callback, muscle_drive: Callback) -> None:
        self._layout = layout
        self._unit, self._muscle = unit_drive, muscle_drive
        muscles = layout.muscles * len(MUSCLE_INDEX)
        units = layout.index[muscles + layout.groups * len(GROUP_INDEX) :].reshape(-1, len(UNIT_INDEX))
        owners = units[:, UNIT_INDEX.index("muscle")]
        records = layout.index[:muscles].reshape(-1, len(MUSCLE_INDEX))
        ends = [*records[:, MUSCLE_INDEX.index("drive")].tolist(), layout.drives]
        self.muscles: list[MuscleTable] = []
        for muscle in range(layout.muscles):
            first, last = ends[muscle], ends[muscle + 1]
            mine = np.flatnonzero(owners == muscle)
            self.muscles.append(self.tabulated(muscle, mine, first, last))

    def tabulated(self, muscle: int, units: IntArray, first: int, last: int) -> MuscleTable:
        """The table of one muscle and its units."""
        p, k = self._layout.parameters, self._layout.index
        scratch, coefficients = np.zeros(self._layout.drives), np.empty((last - first, NODES))
        found = np.empty(MOST_PIECES // 2)
        # A muscle's only unit need not be looked at alone.
        alone = units.size == 1
        finder, owners = (self._muscle.address, np.array([muscle])) if alone else (self._unit.address, units)
        count = find_corners(finder, owners, p, k, first, last, scratch, coefficients, found)
        breaks = np.unique(np.concatenate([[0.0, 1.0], found[:count]]))
        edges, table = np.empty(MOST_PIECES + 1), np.empty((MOST_PIECES, last - first, NODES))
        # Rounding grows with the number of units that are summed.
        tolerance = TOLERANCE * max(1.0, 0.1 * units.size)
        pieces = fit(self._muscle.address, muscle, breaks, tolerance, p, k, first, last, scratch, edges, table)
        starts = np.empty(BUCKETS, dtype=np.int64)
        first_pieces(edges, starts)
        return MuscleTable(edges[: pieces + 1].copy(), table[:pieces].copy(), starts, first, last)

    def look_up(self, excitation: FloatArray) -> FloatArray:
        """Drives [T, drives] of excitations [T, muscles]."""
        layout = self._layout
        out = np.empty((len(excitation), layout.drives))
        for muscle, table in enumerate(self.muscles):
            look_up(
                table.edges,
                table.coefficients,
                table.starts,
                self._muscle.address,
                muscle,
                layout.parameters,
                layout.index,
                table.first,
                table.last,
                np.ascontiguousarray(excitation[:, muscle]),
                out,
            )
        return out
