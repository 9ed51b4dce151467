"""Laws with states: their movement at given variables, and where it ends."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.integrate import solve_ivp

from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.model import ChosenLaw
from limb_nodes.model.probe import Probe, initial_states

# How long (s) a law with states is held at a point until its values are called steady.
SETTLING = 5.0


def moved(
    chosen: ChosenLaw, probe: Probe, point: Mapping[str, float], start: FloatArray, times: FloatArray, tolerance: float
) -> FloatArray:
    """States of a law [states, T] at some times (s), held at a point from the states `start` at the first time on.

    tolerance: relative error per step.
    """
    rates = [state.rate for state in chosen.law.states]

    def slope(_: float, states: FloatArray) -> list[float]:
        values = probe.at(**point, **states_by_name(chosen, states))
        return [values[rate] for rate in rates]

    span = (times[0], times[-1])
    solved = solve_ivp(slope, span, start, "LSODA", t_eval=times, rtol=tolerance, atol=1e-3 * tolerance, max_step=1.0)
    return np.asarray(solved.y)


def states_by_name(chosen: ChosenLaw, states: FloatArray) -> dict[str, float]:
    """States by name."""
    return {state.name: float(value) for state, value in zip(chosen.law.states, states, strict=True)}


def steady_state(chosen: ChosenLaw, probe: Probe, point: Mapping[str, float]) -> dict[str, float]:
    """All variables of a law whose states have settled at a point."""
    start = initial_states(chosen, probe)
    if not start:
        return probe.at(**point)
    end = moved(chosen, probe, point, np.array([*start.values()]), np.array([0.0, SETTLING]), 1e-6)[:, -1]
    return probe.at(**point, **states_by_name(chosen, end))
