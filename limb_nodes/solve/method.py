"""What an integration method is: two compiled functions and a tableau, all called or read by address.

So the driver (`limb_nodes.solve.integrate`) is compiled once, and a method only if it is used.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.foundation.records import Record, new_record
from limb_nodes.solve import limits
from limb_nodes.solve.inner import inner
from limb_nodes.solve.pointer import Callback, f8, i8, numbers
from limb_nodes.solve.problem import METHOD, control_pointer, method_pointer, problem_pointer

# t, h, method, work, control, problem
STEP = (f8, f8, method_pointer, numbers, control_pointer, problem_pointer)
# t, h, count, times, out, method, work, problem
BETWEEN = (f8, f8, i8, numbers, numbers, method_pointer, numbers, problem_pointer)


@dataclass(frozen=True)
class Method:
    """A method; its functions take the arrays of `limb_nodes.solve.problem.Work`.

    step: a step of size h from time t, from `state` to `new_state`, whose `start_rates` and, for an
        implicit method, `slopes` are known. Leaves its stages in `stages`, and in `control.error`
        the largest estimated error over its tolerance.
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
        record = new_record(METHOD)
        record.step, record.between = self.step.address, self.between.address
        record.tableau, record.stages = self.tableau.ctypes.data, self.stages
        record.implicit = self.implicit
        return record

    @cached_property
    def limited(self) -> Record:
        """The record of the method for problems with limits."""
        record = self.free.copy()
        record.settle, record.find_event = limits.settle.address, limits.find_event.address
        record.take_effect = limits.take_effect.address
        return record


@inner
def judge(errors, work, control):
    """Leave in `control.error` the largest of the estimated errors [n] over its tolerance."""
    worst = 0.0
    for i in range(errors.size):
        size = max(work.scale[i], abs(work.state[i]), abs(work.new_state[i]))
        ratio = abs(errors[i]) / (control.tolerance * size)
        if not ratio <= worst:
            worst = ratio
        if not math.isfinite(worst):
            break
    control.error = worst
