"""scipy's LSODA with the equations in plain Python."""

from __future__ import annotations

import numpy as np

from limb_nodes.foundation.arrays import FloatArray
from tests.benchmarks.peers.plain_python import Rates

NAME = "scipy LSODA, Python"


def solve(rates: Rates, start: FloatArray, times: FloatArray, tolerance: float) -> FloatArray:
    """States [T, states] at some times."""
    from scipy.integrate import solve_ivp

    found = solve_ivp(
        lambda t, y: rates(t, y.tolist()),
        (times[0], times[-1]),
        start,
        method="LSODA",
        t_eval=times,
        rtol=tolerance,
        atol=tolerance,
        max_step=0.1,
    )
    if not found.success:
        raise RuntimeError(found.message)
    return np.asarray(found.y.T)
