"""The chain's equations of motion over arrays, compiled.

The equations of `levels.limb.chain` hold for segment angles. Here they are summed from each joint
outwards, which turns them into equations for joint angles in which the torque of a joint appears
once, and in which a joint that rests on its limit is simply left out.

Arguments of all functions, for n joints: block, the constants that `model.chain.chain_of` takes apart;
load [3], force on the tip in x and y (N) and torque on it (N m); angle, velocity, torque, locked [n] as in
`solve.data`; scratch, `scratch_size` numbers, of which each function says what it needs there and leaves there.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from numba import njit

from limb_nodes.levels.limb import chain
from limb_nodes.model.chain import chain_of
from limb_nodes.solve.inner import inner

OPTIONS = {"error_model": "numpy", "cache": True}

inertia_coupling = njit(**OPTIONS)(chain.inertia_coupling)
centrifugal_torque = njit(**OPTIONS)(chain.centrifugal_torque)
tip_force_torque = njit(**OPTIONS)(chain.tip_force_torque)
gravity_torque = njit(**OPTIONS)(chain.gravity_torque)
constants = inner(chain_of)


class Scratch(NamedTuple):
    """Views of the numbers between the stages of an evaluation, of n joints.

    inertia: [n, n], kg m^2, inertia matrix of the joints, then its Cholesky factor. bias: [n], N m, torque of
    motion, gravity and load about each joint. cosine, sine: [n], of the segments' absolute angles.
    speed: [n], rad/s, of the segments.
    """

    inertia: Any
    bias: Any
    cosine: Any
    sine: Any
    speed: Any


def scratch_size(n: int) -> int:
    """How many numbers `Scratch` takes."""
    return n * n + 4 * n


@inner
def parts(scratch, n):
    """`Scratch` of a flat array."""
    at = n * n
    return Scratch(
        scratch[:at].reshape((n, n)),
        scratch[at : at + n],
        scratch[at + n : at + 2 * n],
        scratch[at + 2 * n : at + 3 * n],
        scratch[at + 3 * n : at + 4 * n],
    )


@njit(**OPTIONS)
def joint_equations(block, load, angle, velocity, scratch):
    """Fill scratch with the inertia matrix of the joints, the bias and what both are made of."""
    n = angle.size
    segments = constants(block, n)
    own = parts(scratch, n)
    absolute, turn = segments.base_angle, 0.0
    for k in range(n):
        absolute += angle[k]
        turn += velocity[k]
        own.cosine[k] = math.cos(absolute)
        own.sine[k] = math.sin(absolute)
        own.speed[k] = turn
    for k in range(n):
        ck, sk = own.cosine[k], own.sine[k]
        torque = gravity_torque(segments.moments[k], ck, sk, segments.gravity_x, segments.gravity_y)
        torque += tip_force_torque(segments.lengths[k], ck, sk, load[0], load[1])
        for other in range(n):
            coupling = segments.couplings[k, other]
            cp, sp = own.cosine[other], own.sine[other]
            # The diagonal's angle is zero, so 3.8 and 3.3-3.5 are one expression.
            own.inertia[k, other] = inertia_coupling(coupling, ck * cp + sk * sp)
            torque += centrifugal_torque(coupling, sk * cp - ck * sp, own.speed[other])
        own.bias[k] = torque
    own.bias[n - 1] += load[2]
    for k in range(n - 2, -1, -1):
        own.bias[k] += own.bias[k + 1]
        for other in range(n):
            own.inertia[k, other] += own.inertia[k + 1, other]
    for k in range(n):
        for other in range(n - 2, -1, -1):
            own.inertia[k, other] += own.inertia[k, other + 1]


@njit(**OPTIONS)
def factor_free(locked, inertia):
    """Cholesky factor of an inertia matrix [n, n] in place, locked joints left out."""
    n = locked.size
    for k in range(n):
        if locked[k] != 0.0:
            for other in range(n):
                inertia[k, other] = 0.0
                inertia[other, k] = 0.0
            inertia[k, k] = 1.0
    for k in range(n):
        for other in range(k + 1):
            total = inertia[k, other]
            for i in range(other):
                total -= inertia[k, i] * inertia[other, i]
            if other == k:
                inertia[k, k] = math.sqrt(total)
            else:
                inertia[k, other] = total / inertia[other, other]


@njit(**OPTIONS)
def solve_free(locked, factor, right):
    """Solve for right [n] in place with a Cholesky factor [n, n]; 0 for locked joints."""
    n = locked.size
    for k in range(n):
        total = right[k] if locked[k] == 0.0 else 0.0
        for i in range(k):
            total -= factor[k, i] * right[i]
        right[k] = total / factor[k, k]
    for k in range(n - 1, -1, -1):
        total = right[k]
        for i in range(k + 1, n):
            total -= factor[i, k] * right[i]
        right[k] = total / factor[k, k]


@njit(**OPTIONS)
def acceleration(block, load, angle, velocity, torque, locked, out, scratch):
    """Joint accelerations out [n] (rad/s^2) by 3.11, zero for locked joints; leaves the inertia's factor."""
    joint_equations(block, load, angle, velocity, scratch)
    own = parts(scratch, angle.size)
    for k in range(angle.size):
        out[k] = own.bias[k] + torque[k]
    factor_free(locked, own.inertia)
    solve_free(locked, own.inertia, out)


@njit(**OPTIONS)
def reaction(block, load, angle, velocity, torque, acceleration, out, scratch):
    """Torque out [n] (N m) that the limit puts on each joint at given accelerations [n]."""
    n = angle.size
    joint_equations(block, load, angle, velocity, scratch)
    own = parts(scratch, n)
    for k in range(n):
        total = -own.bias[k] - torque[k]
        for other in range(n):
            total += own.inertia[k, other] * acceleration[other]
        out[k] = total


@njit(**OPTIONS)
def impact(block, load, angle, velocity, locked, scratch):
    """Stop the locked joints dead: velocity [n] becomes that after the impulse.

    The momenta of the free joints are kept: M_ff v_f' = M_ff v_f + M_fl v_l.
    """
    n = angle.size
    joint_equations(block, load, angle, velocity, scratch)
    own = parts(scratch, n)
    momentum = own.bias
    for k in range(n):
        total = 0.0
        for other in range(n):
            total += own.inertia[k, other] * velocity[other]
        momentum[k] = total
    factor_free(locked, own.inertia)
    solve_free(locked, own.inertia, momentum)
    for k in range(n):
        velocity[k] = momentum[k]


@njit(**OPTIONS)
def solve_with_factor(locked, right, scratch):
    """Solve for right [n] in place with the factor that `acceleration` has left in scratch."""
    solve_free(locked, parts(scratch, locked.size).inertia, right)


@njit(**OPTIONS)
def bias_slopes(block, load, acceleration, scratch, by_angle, by_velocity):
    """Slopes of (torque of motion, gravity and load) - (inertia matrix) (acceleration).

    by_angle, by_velocity: [n, n], change of the torque about joint k (column) with the angle or
    velocity of a joint (row), accelerations held. Needs what `joint_equations` leaves in scratch.
    """
    n = acceleration.size
    segments = constants(block, n)
    own = parts(scratch, n)
    for k in range(n):
        ck, sk = own.cosine[k], own.sine[k]
        pull_on_self = segments.moments[k] * (-sk * segments.gravity_y - ck * segments.gravity_x)
        pull_on_self += segments.lengths[k] * (-sk * load[1] - ck * load[0])
        spin = 0.0
        for other in range(n):
            cp, sp = own.cosine[other], own.sine[other]
            spin += acceleration[other]
            turn = own.speed[other]
            coupling = segments.couplings[k, other]
            between_sine, between_cosine = sk * cp - ck * sp, ck * cp + sk * sp
            by_velocity[other, k] = -2.0 * coupling * between_sine * turn
            if other != k:
                pull = coupling * (between_cosine * turn * turn - between_sine * spin)
                by_angle[other, k] = pull
                pull_on_self -= pull
        by_angle[k, k] = pull_on_self
    for matrix in (by_angle, by_velocity):
        for k in range(n - 2, -1, -1):
            for other in range(n):
                matrix[other, k] += matrix[other, k + 1]
        for k in range(n):
            for other in range(n - 2, -1, -1):
                matrix[other, k] += matrix[other + 1, k]
