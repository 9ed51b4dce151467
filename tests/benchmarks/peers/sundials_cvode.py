"""SUNDIALS' CVODE through scikit-sundae, with the product's compiled right-hand side."""

from __future__ import annotations

from typing import Any

import numpy as np

from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.solve.whole import WholeModel

NAME = "sundae CVODE, compiled"


def solve(
    model: WholeModel, inputs: FloatArray, period: float, times: FloatArray, tolerance: float, method: str
) -> FloatArray:
    """States [T, states] at some times. method: "BDF" or "Adams"."""
    from sksundae.cvode import CVODE

    rates, numbers, data = model.program.rates, model.layout.model.address, model.new_data(period)

    def right_hand_side(t: float, y: FloatArray, out: FloatArray) -> None:
        rates(t, y, inputs, numbers, data.address, out)

    solver: Any = CVODE(
        right_hand_side,
        method=method,
        rtol=tolerance,
        atol=tolerance * model.state_scale,
        max_step=0.1,
        max_num_steps=1_000_000,
    )
    found = solver.solve(times, model.initial_state())
    if not found.success:
        raise RuntimeError(found.message)
    return np.asarray(found.y)
