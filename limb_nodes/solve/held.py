"""The torque that a chain is given for one tick: linear in joint angles, joint velocities and time; compiled."""

from __future__ import annotations

from typing import Any, NamedTuple

from numba import njit

from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.solve.inner import inner


class HeldTorque(NamedTuple):
    """Torque of n joints around a joint state; views of the rows of one array [5 + 2 n, n].

    torque: N m [n]. by_time: N m/s [n]. by_angle, by_velocity: slopes of the torque on each joint (row) in the angle
    (N m/rad) and the velocity (N m s/rad) of each joint (column) [n, n]. angle, velocity: at which it holds
    (rad, rad/s) [n]. curvature: half the second derivative in time that the tick before has shown (N m/s^2) [n].
    """

    torque: Any
    by_time: Any
    by_angle: Any
    by_velocity: Any
    angle: Any
    velocity: Any
    curvature: Any


@inner
def held_torque(rows):
    """The parts of an array [5 + 2 n, n]."""
    n = rows.shape[1]
    last = 2 + 2 * n
    return HeldTorque(rows[0], rows[1], rows[2 : 2 + n], rows[2 + n : last], rows[last], rows[last + 1], rows[last + 2])


def slope_rows(rows: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Of rows of torque [2 + 2 n, n] the slopes in the joint angles and in the joint velocities, each [n, n]."""
    n = rows.shape[1]
    return rows[2 : 2 + n], rows[2 + n :]


@inner
def linear_torque(held, j, angle, velocity, time):
    """The torque on a joint by the linear model at angles and velocities [n], a time (s) later."""
    torque = held.torque[j] + held.by_time[j] * time
    for k in range(held.torque.size):
        torque += held.by_angle[j, k] * (angle[k] - held.angle[k])
        torque += held.by_velocity[j, k] * (velocity[k] - held.velocity[k])
    return torque


@njit(cache=True)
def hold(torque, state, predicted, period, rows):
    """Fill rows of a `HeldTorque` from torque and slopes [2 + 2 n, n] at a state [2 n].

    predicted: what the tick before expected of the torque [n]; empty if it says nothing. period: s.
    """
    n = rows.shape[1]
    held = held_torque(rows)
    rows[: 2 + 2 * n] = torque
    for j in range(n):
        held.angle[j] = state[j]
        held.velocity[j] = state[n + j]
        held.curvature[j] = (torque[0, j] - predicted[j]) / (period * period) if predicted.size else 0.0


@njit(cache=True)
def predict(rows, state, period, out):
    """Torque out [n] at the new state [2 n] by the linear model of the tick before."""
    n = rows.shape[1]
    held = held_torque(rows)
    for j in range(n):
        out[j] = linear_torque(held, j, state[:n], state[n:], period)
