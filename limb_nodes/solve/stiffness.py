"""How stiff a limb is, or its muscles alone: the fastest rate at its start decides on the method.

By differences: the program of the exact slopes need not be compiled to find that it is not needed.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.foundation.records import Record
from limb_nodes.solve.integrate import difference_slopes
from limb_nodes.solve.pieces import pieces
from limb_nodes.solve.problem import give_inputs

# Rate (1/s) from which the implicit method's longer steps outweigh that each costs more.
STIFF = 6000.0
# How far each internal state is moved, over its typical size, to see how stiff tendons are that pull.
STRETCH = 0.1


def stiffness_of(
    problem: Record, start: FloatArray, scale: FloatArray, internal: int, drives: Callable[[float], FloatArray]
) -> float:
    """Fastest rate (1/s) of a problem at its start, with all muscles fully excited or with none, whose tendons pull.

    start, scale: its states and their typical sizes [states], the last `internal` of them internal ones. drives: of all
    muscles at an excitation [1, drives].
    """
    pulling = start.copy()
    pulling[start.size - internal :] += STRETCH * scale[start.size - internal :]
    # What no muscle force damps is as fast as its own damper lets it be.
    excited, slack = (fastest(problem, start, scale, drives(1.0)), fastest(problem, pulling, scale, drives(0.0)))
    # Of rates at the start that are not finite the solve itself tells; the other posture is none of the limb's.
    return max(excited, slack) if math.isfinite(slack) else excited


def fastest(problem: Record, state: FloatArray, scale: FloatArray, drives: FloatArray) -> float:
    """The fastest rate (1/s) of a problem at a state [states] under drives; infinite if a slope is not finite."""
    slopes, inputs = np.empty((state.size, state.size)), pieces(drives)
    give_inputs(problem, inputs)
    difference_slopes(problem.address, state, scale, slopes)
    return float(np.abs(np.linalg.eigvals(slopes)).max()) if np.isfinite(slopes).all() else math.inf
