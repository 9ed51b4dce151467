"""What an excitation does to a muscle and its motor units, as a table over the excitation.

With many motor units a muscle's drives cost more than its mechanics, although all of them follow
from one number.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numba import njit

from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.model.layout import GROUP_INDEX, MUSCLE_INDEX, UNIT_INDEX, Layout
from limb_nodes.solve.pointer import Callback, call
from limb_nodes.solve.table import BUCKETS, NODES, TOLERANCE, Table, tabulate

_NO_INPUT = np.empty((1, 1))


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
            call(muscle_drive, a, owner, p, k, _NO_INPUT, scratch, scratch)
            for j in range(first, last):
                out[row, j] = scratch[j]


class DriveTable:
    """The drives of all muscles of a limb.

    unit_drive, muscle_drive: the program's functions of one unit and of one muscle.
    """

    def __init__(self, layout: Layout, unit_drive: Callback, muscle_drive: Callback) -> None:
        self._layout = layout
        self._unit, self._muscle = unit_drive, muscle_drive
        muscles = layout.muscles * len(MUSCLE_INDEX)
        units = layout.index[muscles + layout.groups * len(GROUP_INDEX) :].reshape(-1, len(UNIT_INDEX))
        self._owners = units[:, UNIT_INDEX.index("muscle")]
        records = layout.index[:muscles].reshape(-1, len(MUSCLE_INDEX))
        firsts = [*records[:, MUSCLE_INDEX.index("drive")].tolist(), layout.drives]
        self._drives = list(pairwise(firsts))
        self.tables = [self.tabulated(muscle) for muscle in range(layout.muscles)]

    def tabulated(self, muscle: int) -> Table:
        """The table of one muscle and its units."""
        units = np.flatnonzero(self._owners == muscle)
        # A muscle's only unit need not be looked at alone.
        single = self._muscle.address, np.array([muscle])
        searched = single if units.size == 1 else (self._unit.address, units)
        first, last = self._drives[muscle]
        return tabulate(
            self._muscle.address,
            muscle,
            searched,
            self._layout.parameters,
            self._layout.index,
            (first, last),
            self._layout.drives,
            (0.0, 1.0),
            # A drive is at most of the order of 1.
            np.ones(last - first),
            # Rounding grows with the number of units that are summed.
            TOLERANCE * max(1.0, 0.1 * units.size),
        )

    def look_up(self, excitation: FloatArray) -> FloatArray:
        """Drives [T, drives] of excitations [T, muscles]."""
        layout = self._layout
        out = np.empty((len(excitation), layout.drives))
        for muscle, (table, wanted) in enumerate(zip(self.tables, self._drives, strict=True)):
            look_up(
                table.edges,
                table.coefficients,
                table.starts,
                self._muscle.address,
                muscle,
                layout.parameters,
                layout.index,
                *wanted,
                np.ascontiguousarray(excitation[:, muscle]),
                out,
            )
        return out
