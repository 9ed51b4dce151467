"""What an integration method is: two compiled functions and a tableau, all called or read by address.

So the driver (`limb_nodes.solve.integrate`) is compiled once, and a method only if it is used.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.foundation.records import Record
from limb_nodes.solve import limits
from limb_nodes.solve.inner import inner
from limb_nodes.solve.pointer import Callback, f8, i8, numbers
from limb_nodes.solve.problem import (
    METHOD,
    NEW_STATE,
    SCALE,
    STATE,
    control_pointer,
    method_pointer,
    problem_pointer,
)

# t, h, method, work, control, problem
STEP = (f8, f8, method_pointer, numbers, control_pointer, problem_pointer)
# t, h, count, times, out, method, work, problem
BETWEEN = (f8, f8, i8, numbers, numbers, method_pointer, numbers, problem_pointer)


@dataclass(frozen=True)
class Method:
    """A method; its functions take the array of a step, rows as in `limb_nodes.solve.problem`.

    step: a step of size h from time t; the rates at its start and, for an implicit method, their slopes
        are known. Leaves its stages, and in `control.error` the largest estimated error over its
        tolerance.
    between: the states out [count, n] at times [count] within the step.
    tableau: its coefficients, C-contiguous. stages: how many it has.
    """

    step: Callback
    between: Callback
    tableau: FloatArray
    stages: int
    implicit: bool

    @cached_property
    def free(self) -> Record:
        """The record of the method for problems without limits."""
        record = Record(METHOD)
        record.step[0], record.between[0] = self.step.address, self.between.address
        record.tableau[0], record.stages[0] = self.tableau.ctypes.data, self.stages
        record.implicit[0] = self.implicit
        return record

    @cached_property
    def limited(self) -> Record:
        """The record of the method for problems with limits."""
        record = self.free.copy()
        record.settle[0], record.find_event[0] = limits.settle.address, limits.find_event.address
        record.take_effect[0] = limits.take_effect.address
        return record


@inner
def judge(errors, work, control):
    """Leave in `control.error` the largest of the estimated errors [n] of a step over its tolerance."""
    worst = 0.0
    for i in range(errors.size):
        size = max(work[SCALE, i], abs(work[STATE, i]), abs(work[NEW_STATE, i]))
        ratio = abs(errors[i]) / (control.tolerance * size)
        if not ratio <= worst:
            worst = ratio
        if not math.isfinite(worst):
            break
    control.error = worst
