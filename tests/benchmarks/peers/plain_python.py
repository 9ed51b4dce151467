"""The equations of the reference joint as plain Python, as one would write them for scipy; nothing is compiled."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.solve.whole import WholeModel
from tests.independent import reference_joint

Rates = Callable[[float, Sequence[float]], list[float]]


def right_hand_side(inputs: FloatArray, period: float) -> Rates:
    """Rates of the joint's state, tendons rigid, as a function of time (s) and state.

    inputs: pieces of the drives, one drive for each muscle.
    """
    pieces = [[tuple(piece) for piece in row] for row in inputs.reshape(len(inputs), -1, 4).tolist()]
    rate, last = 1.0 / period, len(pieces) - 1

    def drive(time: float) -> list[float]:
        position = time * rate
        row = min(max(int(position), 0), last)
        part = position - row
        return [a + part * (b + part * (c + part * d)) for a, b, c, d in pieces[row]]

    return reference_joint.rates(drive, factors=True)


def largest_difference(model: WholeModel, rates: Rates, inputs: FloatArray, period: float) -> float:
    """How far the plain rates are from the compiled ones at some states, relative to their size."""
    worst = 0.0
    compiled = model.right_hand_side(inputs, period)
    for row in range(0, len(inputs), max(1, len(inputs) // 50)):
        state = np.array([0.5 + 0.3 * np.sin(row), 2.0 * np.cos(row)])
        out = compiled(row * period, state)
        plain = np.array(rates(row * period, state.tolist()))
        worst = max(worst, float(np.abs(plain - out).max() / max(1.0, np.abs(out).max())))
    return worst
