"""The chain's equations of motion over arrays, compiled.

The equations of `levels.limb.chain` hold for segment angles. Here they are summed from each joint
outwards, which turns them into equations for joint angles in which the torque of a joint appears
once, and in which a joint that rests on its limit is simply left out.

Arguments of all functions, for n joints: world, segments: the constants of `limb_nodes.model.chain`. load: [3],
force on the tip in x and y (N) and torque on it (N m). y: [2 n or more], joint angles, then velocities. torque,
locked: [n] as in `limb_nodes.solve.data`. scratch: [4 + n, n], rows as named below.
"""

from __future__ import annotations

import math

from numba import njit

from limb_nodes.levels.limb import chain
from limb_nodes.model.chain import BASE_ANGLE, COUPLING, GRAVITY_X, GRAVITY_Y, LENGTH, MOMENT

# Inlined: to hand over eight arrays takes as long as the equations of one joint.
OPTIONS = {"error_model": "numpy", "cache": True, "forceinline": True}

FORCE_X, FORCE_Y, TIP_TORQUE = 0, 1, 2
# What an impulse may miss, of the sum of its parts.
ROUNDING = 1e-13
# A joint that would leave its limit and be back before it is so far away (rad) stays: two that throw each other off in
# turn, ever more slowly, would do so without end.
BOUNCE = 1e-11
# Rows of the numbers between the stages of an evaluation: torque of motion, gravity and load about each joint (N m);
# cosine and sine of each segment's absolute angle, and its speed (rad/s); then n rows of the inertia matrix of the
# joints (kg m^2), which its Cholesky factor replaces.
BIAS, COSINE, SINE, SPEED, INERTIA = 0, 1, 2, 3, 4

inertia_coupling = njit(**OPTIONS)(chain.inertia_coupling)
centrifugal_torque = njit(**OPTIONS)(chain.centrifugal_torque)
tip_force_torque = njit(**OPTIONS)(chain.tip_force_torque)
gravity_torque = njit(**OPTIONS)(chain.gravity_torque)


@njit(**OPTIONS)
def joint_equations(world, segments, load, y, scratch):
    """Fill scratch with the inertia matrix of the joints, the bias and what both consist of."""
    n = scratch.shape[1]
    angle, turn = world[BASE_ANGLE], 0.0
    for k in range(n):
        angle += y[k]
        turn += y[n + k]
        scratch[COSINE, k] = math.cos(angle)
        scratch[SINE, k] = math.sin(angle)
        scratch[SPEED, k] = turn
    for k in range(n):
        ck, sk = scratch[COSINE, k], scratch[SINE, k]
        torque = gravity_torque(segments[MOMENT, k], ck, sk, world[GRAVITY_X], world[GRAVITY_Y])
        torque += tip_force_torque(segments[LENGTH, k], ck, sk, load[FORCE_X], load[FORCE_Y])
        for other in range(n):
            coupling = segments[COUPLING + k, other]
            cp, sp = scratch[COSINE, other], scratch[SINE, other]
            # The diagonal's angle is zero, so 3.8 and 3.3-3.5 are one expression.
            scratch[INERTIA + k, other] = inertia_coupling(coupling, ck * cp + sk * sp)
            torque += centrifugal_torque(coupling, sk * cp - ck * sp, scratch[SPEED, other])
        scratch[BIAS, k] = torque
    scratch[BIAS, n - 1] += load[TIP_TORQUE]
    for k in range(n - 2, -1, -1):
        scratch[BIAS, k] += scratch[BIAS, k + 1]
        for other in range(n):
            scratch[INERTIA + k, other] += scratch[INERTIA + k + 1, other]
    for k in range(n):
        for other in range(n - 2, -1, -1):
            scratch[INERTIA + k, other] += scratch[INERTIA + k, other + 1]


@njit(**OPTIONS)
def factor_free(locked, scratch):
    """Cholesky factor of the inertia matrix in place, locked joints left out."""
    n = scratch.shape[1]
    for k in range(n):
        if locked[k] != 0.0:
            for other in range(n):
                scratch[INERTIA + k, other] = 0.0
                scratch[INERTIA + other, k] = 0.0
            scratch[INERTIA + k, k] = 1.0
    for k in range(n):
        for other in range(k + 1):
            total = scratch[INERTIA + k, other]
            for i in range(other):
                total -= scratch[INERTIA + k, i] * scratch[INERTIA + other, i]
            if other == k:
                scratch[INERTIA + k, k] = math.sqrt(total)
            else:
                scratch[INERTIA + k, other] = total / scratch[INERTIA + other, other]


@njit(**OPTIONS)
def solve_free(locked, right, scratch):
    """Solve for right [n] in place with the factor of the inertia matrix; 0 for locked joints."""
    n = scratch.shape[1]
    for k in range(n):
        total = right[k] if locked[k] == 0.0 else 0.0
        for i in range(k):
            total -= scratch[INERTIA + k, i] * right[i]
        right[k] = total / scratch[INERTIA + k, k]
    for k in range(n - 1, -1, -1):
        total = right[k]
        for i in range(k + 1, n):
            total -= scratch[INERTIA + i, k] * right[i]
        right[k] = total / scratch[INERTIA + k, k]


@njit(**OPTIONS)
def acceleration(world, segments, load, y, torque, locked, out, scratch):
    """Joint accelerations out [n] (rad/s^2) by 3.11, zero for locked joints; leaves the inertia's factor."""
    joint_equations(world, segments, load, y, scratch)
    for k in range(scratch.shape[1]):
        out[k] = scratch[BIAS, k] + torque[k]
    factor_free(locked, scratch)
    solve_free(locked, out, scratch)


@njit(**OPTIONS)
def reaction(world, segments, load, y, torque, acceleration, out, scratch):
    """Torque out [n] (N m) that the limit puts on each joint at given accelerations [n]."""
    n = scratch.shape[1]
    joint_equations(world, segments, load, y, scratch)
    for k in range(n):
        total = -scratch[BIAS, k] - torque[k]
        for other in range(n):
            total += scratch[INERTIA + k, other] * acceleration[other]
        out[k] = total


@njit(**OPTIONS)
def stop(world, segments, load, y, locked, after, scratch):
    """The velocities after [n] of an impulse that stops the locked joints dead.

    The momenta of the free joints are kept: M_ff v_f' = M_ff v_f + M_fl v_l.
    """
    n = scratch.shape[1]
    joint_equations(world, segments, load, y, scratch)
    for k in range(n):
        after[k] = momentum_of(k, y[n:], scratch)
    factor_free(locked, scratch)
    solve_free(locked, after, scratch)


@njit(**OPTIONS)
def momentum_of(joint, velocity, scratch):
    """The momentum about a joint (N m s) at velocities [n]."""
    total = 0.0
    for other in range(scratch.shape[1]):
        total += scratch[INERTIA + joint, other] * velocity[other]
    return total


@njit(**OPTIONS)
def wrong_stop(y, locked, side, pressed, after, scratch):
    """The first joint on its limit that is held though its limit would have to pull, or flies through it; -1 if none.

    pressed: by how much each is accelerated towards its limit (rad/s^2), 0 or more. Needs the inertia matrix in
    scratch.
    """
    n = scratch.shape[1]
    for k in range(n):
        if side[k] == 0.0:
            continue
        if locked[k] == 0.0:
            if side[k] * after[k] > 0.0:
                return k
            continue
        pull, size = 0.0, 0.0
        for other in range(n):
            part = scratch[INERTIA + k, other] * (after[other] - y[n + other])
            pull += part
            size += abs(part)
        slow = math.sqrt(2.0 * BOUNCE * pressed[k])
        if side[k] * pull > ROUNDING * size + slow * scratch[INERTIA + k, k]:
            return k
    return -1


@njit(**OPTIONS)
def press(world, segments, load, y, torque, locked, pressed, work, scratch):
    """By how much each joint would be accelerated towards its limit, were it free: pressed [n] (rad/s^2), 0 or more."""
    acceleration(world, segments, load, y, torque, locked, pressed, scratch)
    reaction(world, segments, load, y, torque, pressed, work, scratch)
    for k in range(scratch.shape[1]):
        pressed[k] = max(0.0, -locked[k] * work[k] / scratch[INERTIA + k, k])


@njit(**OPTIONS)
def impact(world, segments, load, y, torque, locked, pressed, work, scratch):
    """The velocities in y become those after the impulses of the limits, on which the locked joints are.

    A limit only pushes: a joint that it would have to hold flies off, and is locked no more. That is a linear
    complementarity problem, impulse against velocity, whose matrix is positive definite; Murty's pivots, of the first
    joint that is wrong each time, end with its one solution (Mathematical Programming 7 (1974) 138).
    pressed: [n], is overwritten. work: [2 n or more].
    """
    n = scratch.shape[1]
    press(world, segments, load, y, torque, locked, pressed, work, scratch)
    after, side = work[:n], work[n:]
    for k in range(n):
        side[k] = locked[k]
    for _ in range(2**n + 1):
        stop(world, segments, load, y, locked, after, scratch)
        joint_equations(world, segments, load, y, scratch)
        wrong = wrong_stop(y, locked, side, pressed, after, scratch)
        if wrong < 0:
            break
        locked[wrong] = side[wrong] if locked[wrong] == 0.0 else 0.0
    for k in range(n):
        y[n + k] = after[k]


@njit(**OPTIONS)
def bias_slopes(world, segments, load, acceleration, by_angle, by_velocity, scratch):
    """Slopes of (torque of motion, gravity and load) - (inertia matrix) (acceleration).

    by_angle, by_velocity: [n, n], change of the torque about joint k (column) with the angle or
    velocity of a joint (row), accelerations held. Needs what `joint_equations` leaves in scratch.
    """
    n = scratch.shape[1]
    for k in range(n):
        ck, sk = scratch[COSINE, k], scratch[SINE, k]
        own = segments[MOMENT, k] * (-sk * world[GRAVITY_Y] - ck * world[GRAVITY_X])
        own += segments[LENGTH, k] * (-sk * load[FORCE_Y] - ck * load[FORCE_X])
        spin = 0.0
        for other in range(n):
            cp, sp = scratch[COSINE, other], scratch[SINE, other]
            spin += acceleration[other]
            turn = scratch[SPEED, other]
            coupling = segments[COUPLING + k, other]
            between_sine, between_cosine = sk * cp - ck * sp, ck * cp + sk * sp
            by_velocity[other, k] = -2.0 * coupling * between_sine * turn
            if other != k:
                pull = coupling * (between_cosine * turn * turn - between_sine * spin)
                by_angle[other, k] = pull
                own -= pull
        by_angle[k, k] = own
    for matrix in (by_angle, by_velocity):
        for k in range(n - 2, -1, -1):
            for other in range(n):
                matrix[other, k] += matrix[other, k + 1]
        for k in range(n):
            for other in range(n - 2, -1, -1):
                matrix[other, k] += matrix[other + 1, k]
