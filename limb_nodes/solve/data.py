"""What changes during a solve: one record for each limb that is being solved."""

from __future__ import annotations

from typing import Any

import numpy as np

from limb_nodes.model.layout import Layout
from limb_nodes.solve.chain import INERTIA


def data_type(layout: Layout) -> np.dtype[Any]:
    """The type of a limb's data, of n joints; everything is float64.

    period: time between two samples of the input (s), the first of which is at 0 s.
    first: the number of the first of the input's pieces that are there, 0 for those from 0 s on.
    load: [3], force on the tip in x and y (N) and torque on it (N m).
    locked: [n], 1 or -1 while a joint rests on its highest or lowest angle, else 0.
    torque, torque_t: [n], of the muscles about each joint (N m), and its tangent.
    acceleration: [n], of the joints (rad/s^2).
    joints, joints_t: [2 n], joint angles and velocities between two ticks (rad, rad/s); the tangent of those that
        muscles are given.
    held: [5 + 2 n, n], the torque of a tick, its slopes, its state and its curvature (`limb_nodes.solve.held`).
    angles_before, velocities_before, angles_after, velocities_after: [n], joint states at a tick's ends
        (rad, rad/s), between which the muscles follow a cubic.
    chain: [4 + n, n], what the chain's equations keep from one stage to the next (`limb_nodes.solve.chain`).
    drives, drives_t: [drives], what the input does to muscles and units, and its tangent.
    scratch: what muscles and groups keep from one stage to the next.
    internal_t: [internal states], their tangent. rates, rates_t: [internal states], changes with time
        (their unit per s) and their tangent.
    A tangent is the derivative in the direction that is being asked for.
    """
    joints, states, drives = layout.joints, layout.states, layout.drives
    sizes: dict[str, int | tuple[int, ...]] = {
        "load": 3,
        "locked": joints,
        "torque": joints,
        "torque_t": joints,
        "joints": 2 * joints,
        "joints_t": 2 * joints,
        "acceleration": joints,
        "held": (5 + 2 * joints, joints),
        "angles_before": joints,
        "velocities_before": joints,
        "angles_after": joints,
        "velocities_after": joints,
        "chain": (INERTIA + joints, joints),
        "drives": drives,
        "drives_t": drives,
        "scratch": layout.scratch,
        "internal_t": states,
        "rates": states,
        "rates_t": states,
    }
    arrays = [(name, np.float64, size if isinstance(size, tuple) else (size,)) for name, size in sizes.items()]
    return np.dtype([("period", np.float64), ("first", np.float64), *arrays])
