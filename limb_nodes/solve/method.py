"""What an integration method is: three compiled functions, called by address.

So the driver (`limb_nodes.solve.integrate`) is compiled once, and a method only where it is used.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from limb_nodes.foundation.arrays import IntArray
from limb_nodes.solve.inner import inner
from limb_nodes.solve.pointer import Callback, f8, i8, invoke, numbers, whole_numbers

# rates, t, h, n, rows of u, y, start_rates, slopes, stages, p, k, u, c, stage_y, new_y, matrix, pivots
STEP = (i8, f8, f8, i8, i8, *[numbers] * 5, whole_numbers, *[numbers] * 5, whole_numbers)
# h, tolerance, n, y, new_y, stages, scale, found
ERROR = (f8, f8, i8, *[numbers] * 5)
# t, h, n, count, times, y, new_y, stages, out
BETWEEN = (f8, f8, i8, i8, *[numbers] * 5)


@dataclass(frozen=True)
class Method:
    """A method. n: number of states; arrays are given as pointers.

    step: a step of size h from y to new_y; start_rates are those at t, slopes what the program's
        `jacobian` gives there (implicit methods). Leaves its stages in stages [7, n].
    error: found[0], the largest estimated error over its tolerance.
    between: the states out [count, n] at times within the step.
    """

    step: Callback
    error: Callback
    between: Callback

    @cached_property
    def addresses(self) -> IntArray:
        """Where the three are."""
        return np.array([self.step.address, self.error.address, self.between.address], dtype=np.int64)


@inner
def take_step(step, rates, t, h, arrays):
    """One step of size h by the method's function. arrays: those of `STEP`, from y to pivots."""
    y, u = arrays[0], arrays[6]
    invoke(step, rates, t, h, y.size, u.shape[0], *arrays)
