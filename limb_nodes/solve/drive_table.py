"""What an excitation does to a muscle and its motor units, as a table over the excitation.

With many motor units a muscle's drives cost more than its mechanics, although all of them follow
from one number.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numba import njit

from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.foundation.records import Record
from limb_nodes.model.layout import Layout
from limb_nodes.solve.pointer import Callback, record_at
from limb_nodes.solve.problem import evaluate, new_problem, problem_type
from limb_nodes.solve.table import BUCKETS, NODES, TOLERANCE, Table, tabulate


@njit(cache=True, error_model="numpy", nogil=True)
def look_up(edges, table, starts, problem_, muscle, span, excitation, out):
    """Fill the columns of a span (first, end) of out [T, drives] for a muscle's excitation [T].

    edges, table, starts: of its `Table`. problem_: address of a problem whose
    rates are the drives by the laws.
    """
    first, last = span
    problem = record_at(problem_, problem_type)
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
            evaluate(problem.rates, a, owner, problem, scratch)
            for j in range(first, last):
                out[row, j] = scratch[j]


class DriveTable:
    """The drives of all muscles of a limb.

    unit_drive, muscle_drive: the program's functions of one unit and of one muscle.
    """

    def __init__(self, layout: Layout, unit_drive: Callback, muscle_drive: Callback) -> None:
        self._layout = layout
        self._of_unit = self._problem(unit_drive)
        self._of_muscle = self._problem(muscle_drive)
        self._spans = list(pairwise([*layout.model.muscles["drive"].tolist(), layout.drives]))
        self.tables = [self._tabulated(muscle) for muscle in range(layout.muscles)]

    def _problem(self, drive: Callback) -> Record:
        """A function of one owner's excitation, as a problem whose rates are the drives."""
        model = self._layout.model
        return new_problem(self._layout.drives, drive.address, model, model)

    def _tabulated(self, muscle: int) -> Table:
        """The table of one muscle and its units."""
        units = np.flatnonzero(self._layout.model.units["muscle"] == muscle)
        # A muscle's only unit need not be looked at alone.
        single = self._of_muscle, np.array([muscle])
        searched = single if units.size == 1 else (self._of_unit, units)
        first, last = self._spans[muscle]
        # Rounding grows with the number of units that are summed.
        tolerance = TOLERANCE * max(1.0, 0.1 * units.size)
        # A drive is at most of the order of 1.
        scale = np.ones(last - first)
        return tabulate(self._of_muscle, muscle, searched, (first, last), (0.0, 1.0), scale, tolerance)

    def look_up(self, excitation: FloatArray) -> FloatArray:
        """Drives [T, drives] of excitations [T, muscles]."""
        out = np.empty((len(excitation), self._layout.drives))
        for muscle, (table, span) in enumerate(zip(self.tables, self._spans, strict=True)):
            own = np.ascontiguousarray(excitation[:, muscle])
            look_up(table.edges, table.coefficients, table.starts, self._of_muscle.address, muscle, span, own, out)
        return out
