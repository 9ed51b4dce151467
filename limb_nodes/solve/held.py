"""The torque that a chain is given for one tick: a linear model in joint angle, joint velocity and time, compiled."""

from __future__ import annotations

from typing import Any, NamedTuple

from numba import njit

from limb_nodes.solve.inner import inner


class HeldTorque(NamedTuple):
    """Torque of n joints around a joint state, each [n]; views of the rows of one array [7, n].

    torque: N m. by_angle: N m/rad. by_velocity: N m s/rad. by_time: N m/s. angle, velocity: at which
    it holds (rad, rad/s). curvature: half the second derivative in time that the tick before has shown (N m/s^2).
    """

    torque: Any
    by_angle: Any
    by_velocity: Any
    by_time: Any
    angle: Any
    velocity: Any
    curvature: Any


@inner
def held_torque(rows):
    """The parts of an array [7, n]."""
    return HeldTorque(rows[0], rows[1], rows[2], rows[3], rows[4], rows[5], rows[6])


@njit(cache=True)
def hold(torque, state, predicted, period, rows):
    """Fill rows [7, n] of a `HeldTorque` from torque and slopes [4, n] at a state [2 n].

    predicted: what the tick before expected of the torque [n]; empty if it says nothing. period: s.
    """
    n = rows.shape[1]
    held = held_torque(rows)
    for j in range(n):
        for row in range(4):
            rows[row, j] = torque[row, j]
        held.angle[j] = state[j]
        held.velocity[j] = state[n + j]
        held.curvature[j] = (torque[0, j] - predicted[j]) / (period * period) if predicted.size else 0.0


@njit(cache=True)
def predict(rows, state, period, out):
    """Torque out [n] at the new state [2 n] by the linear model of the tick before."""
    n = rows.shape[1]
    held = held_torque(rows)
    for j in range(n):
        out[j] = (
            held.torque[j]
            + held.by_angle[j] * (state[j] - held.angle[j])
            + held.by_velocity[j] * (state[n + j] - held.velocity[j])
            + held.by_time[j] * period
        )
