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
from limb_nodes.solve.pointer import call

# A drive is at most of the order of 1.
TOLERANCE = 2e-13
NODES = 8
# Halvings of the whole range before a piece that no polynomial fits is searched for a corner.
SEARCH_DEPTH = 6
LEAST_WIDTH = 1e-6
MOST_PIECES = 20_000
BUCKETS = 1024
_NODES = np.cos(np.pi * (np.arange(NODES) + 0.5) / NODES)
_TO_POWERS = np.linalg.inv(np.vander(_NODES, increasing=True))
_CHECKS = np.array([-0.998, -0.29, 0.1, 0.67, 0.998])
_NO_TABLE = np.empty((1, 1))


@njit(cache=True, error_model="numpy", nogil=True)
def piece(drive, owner, p, k, first, last, left, right, scratch, coefficients):
    """Fill coefficients [last - first, NODES], powers of -1 to 1 across the piece; the largest error.

    drive: address of the program's drives of one owner; first, last: those that are wanted.
    """
    width = last - first
    middle, half = 0.5 * (left + right), 0.5 * (right - left)
    coefficients[:] = 0.0
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


@njit(cache=True, error_model="numpy", nogil=True)
def corner(drive, owner, p, k, first, last, left, right, scratch):
    """The place between left and right where drives jump or bend most, to the next number."""
    width = last - first
    values = np.empty((5, width))
    while True:
        step = 0.25 * (right - left)
        for i in range(5):
            call(drive, left + i * step, owner, p, k, _NO_TABLE, scratch, scratch)
            values[i] = scratch[first:last]
        before = after = 0.0
        for j in range(width):
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
def corners_of(drive, owner, p, k, first, last, scratch, found):
    """Append to `found` the places where the drives of one owner jump or bend."""
    coefficients = np.empty((last - first, NODES))
    waiting = [(0.0, 1.0, 0)]
    while len(waiting) > 0:
        left, right, depth = waiting.pop()
        if piece(drive, owner, p, k, first, last, left, right, scratch, coefficients) <= TOLERANCE:
            continue
        if depth < SEARCH_DEPTH:
            middle = 0.5 * (left + right)
            waiting.append((left, middle, depth + 1))
            waiting.append((middle, right, depth + 1))
        else:
            found.append(corner(drive, owner, p, k, first, last, left, right, scratch))
    return 0


@njit(cache=True, error_model="numpy", nogil=True)
def tabulate(unit_drive, muscle_drive, muscle, units, p, k, first, last, size):
    """Edges [pieces + 1], coefficients [pieces, last - first, NODES] and the first piece of each bucket.

    Coefficients are NaN where no polynomial will do. units: numbers of the muscle's units.
    size: number of all drives.
    """
    scratch, owner = np.zeros(size), np.zeros(1)
    found = [0.0, 1.0]
    for unit in units:
        owner[0] = unit
        corners_of(unit_drive, owner, p, k, first, last, scratch, found)
    breaks = np.unique(np.array(found))
    owner[0] = muscle
    coefficients = np.empty((last - first, NODES))
    lefts, taken = [0.0], [coefficients.copy()]
    lefts.clear()
    taken.clear()
    waiting = [(breaks[i], breaks[i + 1]) for i in range(breaks.size - 2, -1, -1)]
    while len(waiting) > 0:
        left, right = waiting.pop()
        error = piece(muscle_drive, owner, p, k, first, last, left, right, scratch, coefficients)
        if not error <= TOLERANCE * max(1.0, 0.1 * units.size):
            if right - left > LEAST_WIDTH and len(lefts) + len(waiting) < MOST_PIECES:
                middle = 0.5 * (left + right)
                waiting.append((middle, right))
                waiting.append((left, middle))
                continue
            coefficients[:] = np.nan
        lefts.append(left)
        taken.append(coefficients.copy())
    pieces = len(lefts)
    edges, table = np.empty(pieces + 1), np.empty((pieces, last - first, NODES))
    for i in range(pieces):
        edges[i] = lefts[i]
        table[i] = taken[i]
    edges[pieces] = 1.0
    starts = np.empty(BUCKETS, dtype=np.int64)
    at = 0
    for bucket in range(BUCKETS):
        while edges[at + 1] <= bucket / BUCKETS:
            at += 1
        starts[bucket] = at
    return edges, table, starts


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

    unit_drive, muscle_drive: addresses of the program's functions of one unit and of one muscle.
    """

    def __init__(self, layout: Layout, unit_drive: int, muscle_drive: int) -> None:
        self._layout = layout
        self._muscle_drive = muscle_drive
        muscles = layout.muscles * len(MUSCLE_INDEX)
        units = layout.index[muscles + layout.groups * len(GROUP_INDEX) :].reshape(-1, len(UNIT_INDEX))
        owners = units[:, UNIT_INDEX.index("muscle")]
        records = layout.index[:muscles].reshape(-1, len(MUSCLE_INDEX))
        ends = [*records[:, MUSCLE_INDEX.index("drive")].tolist(), layout.drives]
        self.muscles: list[MuscleTable] = []
        for muscle in range(layout.muscles):
            first, last = ends[muscle], ends[muscle + 1]
            found = tabulate(
                unit_drive,
                muscle_drive,
                muscle,
                np.flatnonzero(owners == muscle),
                layout.parameters,
                layout.index,
                first,
                last,
                layout.drives,
            )
            self.muscles.append(MuscleTable(*found, first, last))

    def look_up(self, excitation: FloatArray) -> FloatArray:
        """Drives [T, drives] of excitations [T, muscles]."""
        layout = self._layout
        out = np.empty((len(excitation), layout.drives))
        for muscle, table in enumerate(self.muscles):
            look_up(
                table.edges,
                table.coefficients,
                table.starts,
                self._muscle_drive,
                muscle,
                layout.parameters,
                layout.index,
                table.first,
                table.last,
                np.ascontiguousarray(excitation[:, muscle]),
                out,
            )
        return out
