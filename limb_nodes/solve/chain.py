"""The chain's equations of motion over arrays, compiled.

The equations of `levels.limb.chain` hold for segment angles. Here they are summed from each joint
outwards, which turns them into equations for joint angles in which the torque of a joint appears
once, and in which a joint that rests on its limit is simply left out.

Scratch `w` holds n * n + 7 n numbers.
"""

from __future__ import annotations

import math

from numba import njit

from limb_nodes.levels.limb import chain

OPTIONS = {"error_model": "numpy", "cache": True}

inertia_coupling = njit(**OPTIONS)(chain.inertia_coupling)
centrifugal_torque = njit(**OPTIONS)(chain.centrifugal_torque)
tip_force_torque = njit(**OPTIONS)(chain.tip_force_torque)
gravity_torque = njit(**OPTIONS)(chain.gravity_torque)


@njit(**OPTIONS)
def joint_equations(n, p, q, v, tip_x, tip_y, tip_torque, w):
    """Fill w with the joint inertia matrix [n, n] and, behind it, the torque [n] of motion,
    gravity and load about each joint.
    """
    cosine, sine, speed = n * n + n, n * n + 2 * n, n * n + 3 * n
    angle, turn = p[0], 0.0
    for k in range(n):
        angle += q[k]
        turn += v[k]
        w[cosine + k] = math.cos(angle)
        w[sine + k] = math.sin(angle)
        w[speed + k] = turn
    moments, lengths = 3 + n * n, 3 + n * n + n
    bias = n * n
    for k in range(n):
        ck, sk = w[cosine + k], w[sine + k]
        torque = gravity_torque(p[moments + k], ck, sk, p[1], p[2])
        torque += tip_force_torque(p[lengths + k], ck, sk, tip_x, tip_y)
        for other in range(n):
            coupling = p[3 + k * n + other]
            cp, sp = w[cosine + other], w[sine + other]
            # The diagonal's angle is zero, so 3.8 and 3.3-3.5 are one expression.
            w[k * n + other] = inertia_coupling(coupling, ck * cp + sk * sp)
            torque += centrifugal_torque(coupling, sk * cp - ck * sp, w[speed + other])
        w[bias + k] = torque
    w[bias + n - 1] += tip_torque
    for k in range(n - 2, -1, -1):
        w[bias + k] += w[bias + k + 1]
        for other in range(n):
            w[k * n + other] += w[(k + 1) * n + other]
    for k in range(n):
        for other in range(n - 2, -1, -1):
            w[k * n + other] += w[k * n + other + 1]


@njit(**OPTIONS)
def factor_free(n, locked, w):
    """Cholesky factor of the inertia matrix w [n, n] in place, locked joints left out."""
    for k in range(n):
        if locked[k] != 0.0:
            for other in range(n):
                w[k * n + other] = 0.0
                w[other * n + k] = 0.0
            w[k * n + k] = 1.0
    for k in range(n):
        for other in range(k + 1):
            total = w[k * n + other]
            for i in range(other):
                total -= w[k * n + i] * w[other * n + i]
            if other == k:
                w[k * n + k] = math.sqrt(total)
            else:
                w[k * n + other] = total / w[other * n + other]


@njit(**OPTIONS)
def substitute(n, locked, w, right):
    """Solve for right [n] in place with the factor w; 0 for locked joints."""
    for k in range(n):
        total = right[k] if locked[k] == 0.0 else 0.0
        for i in range(k):
            total -= w[k * n + i] * right[i]
        right[k] = total / w[k * n + k]
    for k in range(n - 1, -1, -1):
        total = right[k]
        for i in range(k + 1, n):
            total -= w[i * n + k] * right[i]
        right[k] = total / w[k * n + k]


@njit(**OPTIONS)
def acceleration(n, p, q, v, torque, tip_x, tip_y, tip_torque, locked, out, w):
    """Joint accelerations out [n] (rad/s^2) by 3.11, zero for joints on their limit."""
    joint_equations(n, p, q, v, tip_x, tip_y, tip_torque, w)
    for k in range(n):
        out[k] = w[n * n + k] + torque[k]
    factor_free(n, locked, w)
    substitute(n, locked, w, out)


@njit(**OPTIONS)
def reaction(n, p, q, v, torque, tip_x, tip_y, tip_torque, acceleration, out, w):
    """Torque out [n] (N m) that the limit puts on each joint at given accelerations."""
    joint_equations(n, p, q, v, tip_x, tip_y, tip_torque, w)
    for k in range(n):
        total = -w[n * n + k] - torque[k]
        for other in range(n):
            total += w[k * n + other] * acceleration[other]
        out[k] = total


@njit(**OPTIONS)
def impact(n, p, q, v, locked, w):
    """Stop the joints in `locked` dead: v [n] becomes the velocity after the impulse.

    The momenta of the free joints are kept: M_ff v_f' = M_ff v_f + M_fl v_l.
    """
    joint_equations(n, p, q, v, 0.0, 0.0, 0.0, w)
    momentum = w[n * n : n * n + n]
    for k in range(n):
        total = 0.0
        for other in range(n):
            total += w[k * n + other] * v[other]
        momentum[k] = total
    factor_free(n, locked, w)
    substitute(n, locked, w, momentum)
    for k in range(n):
        v[k] = momentum[k]


@njit(**OPTIONS)
def bias_slopes(n, p, v, acceleration, tip_x, tip_y, w, by_angle, by_velocity):
    """Slopes of (torque of motion, gravity and load) - (inertia matrix) (acceleration).

    by_angle, by_velocity: [n, n], change of the torque about joint k (row) with the angle or
    velocity of a joint (column), accelerations held. w: as `joint_equations` has left it, of
    which sines, cosines and segment velocities are read.
    """
    cosine, sine, speed = n * n + n, n * n + 2 * n, n * n + 3 * n
    moments, lengths = 3 + n * n, 3 + n * n + n
    for k in range(n):
        ck, sk = w[cosine + k], w[sine + k]
        own = p[moments + k] * (-sk * p[2] - ck * p[1])
        own += p[lengths + k] * (-sk * tip_y - ck * tip_x)
        spin = 0.0
        for other in range(n):
            cp, sp = w[cosine + other], w[sine + other]
            spin += acceleration[other]
            turn = w[speed + other]
            coupling = p[3 + k * n + other]
            between_sine, between_cosine = sk * cp - ck * sp, ck * cp + sk * sp
            by_velocity[k, other] = -2.0 * coupling * between_sine * turn
            if other != k:
                pull = coupling * (between_cosine * turn * turn - between_sine * spin)
                by_angle[k, other] = pull
                own -= pull
        by_angle[k, k] = own
    for matrix in (by_angle, by_velocity):
        for k in range(n - 2, -1, -1):
            for other in range(n):
                matrix[k, other] += matrix[k + 1, other]
        for k in range(n):
            for other in range(n - 2, -1, -1):
                matrix[k, other] += matrix[k, other + 1]
