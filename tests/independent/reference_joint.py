"""The reference joint of the report's section 3.3: one segment, a flexor and an extensor of one slow unit each.

Equations by their number on the model's page; SI units. The role of a muscle is +1 in a flexor, -1 in an extensor. The
muscles have elastic tendons where a tendon's length is given, else rigid ones of no length.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from scipy.optimize import brentq
from scipy.special import ellipk

MASS, LENGTH, COM, INERTIA, GRAVITY = 1.25, 0.35, 0.175, 0.0127604, 9.81
ABOUT_JOINT = INERTIA + MASS * COM**2
WEIGHT = MASS * GRAVITY * COM
START = math.pi / 6
ARM, PROXIMAL, DISTAL = 0.0215, 0.10, 0.03
STIFFNESS, DAMPING, SLACK = 1e5, 1e4, 0.03
ROLES = (1.0, -1.0)

# Rabbit psoas: force over velocity of one sarcomere.
ISOMETRIC = 11e-9 / 45e-9 * 4e-12
FASTEST = 11e-9 * 230.0 * 3e-3 / (230.0 / 0.76e6 + 3e-3)
ELASTICITY, PLATEAU = 3.0 / 11.0, 1.4
# The unit: lengths (m) of its fibres, and their greatest force (N).
SERIES, PARALLEL = 42000, 1e14
SHORTEST, OPTIMAL, LONGEST = SERIES * 0.9 * 1.6e-6, SERIES * 2 * 1.35e-6, SERIES * (1.6e-6 + 2 * 1.35e-6)
STRONGEST = PARALLEL * ISOMETRIC
PASSIVE, THRESHOLD = 30.0, 0.8

Drive = Callable[[float], Sequence[float]]
"""Of a time (s): a number for the flexor and one for the extensor."""


def pendulum(gravity: float = GRAVITY, load: float = 0.0) -> float:
    """Frequency (Hz) of the segment as a pendulum from `START`, a load (N) at its tip, by its elliptic integral."""
    small = math.sqrt((MASS * gravity * COM + load * LENGTH) / ABOUT_JOINT)
    return small / (4.0 * float(ellipk(math.sin(START / 2) ** 2)))


def force_velocity(norm: float, elasticity: float = ELASTICITY, plateau: float = PLATEAU) -> float:
    """2.12: force of a sarcomere over its isometric force at a shortening velocity over 1.15 of the greatest (2.11)."""
    if norm <= 0.0:
        bend = (plateau - 1.0) / (1.0 + elasticity / 0.15)
        return 1.0 - (plateau - 1.0) * norm / (bend - norm)
    # At lower velocities it is 0 to the last digit, and the exponential overflows.
    back = 1.0 / math.expm1(0.15 / norm) if norm > 1e-3 else 0.0
    return -math.expm1(-0.15 / norm) * (1.0 - elasticity * (norm / 0.15 - back) - norm)


def length_norm(length: float) -> float:
    """2.20: 0 at the shortest, 1 at the optimal, 2 at the longest fibre length (m)."""
    if length < OPTIMAL:
        return max(0.0, (length - SHORTEST) / (OPTIMAL - SHORTEST))
    return 1.0 + (length - OPTIMAL) / (LONGEST - OPTIMAL)


def frequency_factor(activation: float) -> float:
    """2.23 and 2.36: share of the force at the frequency that the unit has at an activation."""
    if activation < THRESHOLD:
        return 0.0
    low, high, here = (1.0 / (1.0 + math.exp((0.5 - x) / 0.15)) for x in (0.0, 1.0, (activation - THRESHOLD) / 0.2))
    return (here - low) / (high - low)


def fibre_force(length: float, velocity: float, factor: float) -> float:
    """2.25: force (N) of the unit at fibre length (m), shortening velocity (m/s) and frequency factor."""
    norm = length_norm(length)
    passive = PASSIVE * (max(0.0, norm - 1.2) / 0.8) ** 2
    if factor == 0.0:
        return passive
    by_length = math.exp(-(abs((norm**2.3 - 1.0) / 1.12) ** 1.61))
    return STRONGEST * by_length * factor * force_velocity(velocity / SERIES / (1.15 * FASTEST)) + passive


def path(angle: float, role: float) -> tuple[float, float]:
    """2.43, 2.44 and 2.45, 2.47: muscle-tendon length (m) and its slope in the angle (m/rad)."""
    length = slope = 0.0
    for distance in (PROXIMAL, DISTAL):
        part = math.sqrt(ARM**2 + distance**2 - role * 2.0 * ARM * distance * math.sin(angle / 2.0))
        length += part
        slope -= role * ARM * distance * math.cos(angle / 2.0) / (2.0 * part)
    return length, slope


def tension(tendon: float) -> float:
    """Force (N) of a tendon of some length (m) that does not move."""
    return STIFFNESS * max(0.0, tendon - SLACK)


def force_on_tendon(length: float, velocity: float, factor: float, tendon: float) -> float:
    """2.30: force (N) of a muscle in series with a tendon, of muscle-tendon length and shortening velocity."""

    def excess(force: float) -> float:
        lengthening = (force - tension(tendon)) / DAMPING
        return fibre_force(length - tendon, velocity + lengthening, factor) - force

    highest = excess(0.0)
    # The fibres' force falls with their velocity, which rises with the force.
    return float(brentq(excess, 0.0, highest, xtol=1e-12, rtol=1e-14)) if highest > 0.0 else 0.0


def rates(drive: Drive, tendons: bool = False, factors: bool = False) -> Callable[..., list[float]]:
    """The right-hand side of angle, velocity and, with `tendons`, the lengths of both tendons.

    `drive` gives activations, or frequency factors where `factors` says so.
    """

    def slopes(time: float, state: Sequence[float]) -> list[float]:
        angle, velocity, *lengths = state
        torque, lengthening = -WEIGHT * math.sin(angle), []
        for index, (role, number) in enumerate(zip(ROLES, drive(time), strict=True)):
            factor = number if factors else frequency_factor(number)
            length, slope = path(angle, role)
            if tendons:
                force = force_on_tendon(length, -slope * velocity, factor, lengths[index])
                lengthening.append((force - tension(lengths[index])) / DAMPING)
            else:
                force = max(0.0, fibre_force(length, -slope * velocity, factor))
            torque += role * force * ARM
        return [velocity, torque / ABOUT_JOINT, *lengthening]

    return slopes


def settled_tendon(length: float, factor: float) -> float:
    """Length (m) of the tendon of a muscle at rest, of muscle-tendon length (m)."""

    def excess(tendon: float) -> float:
        return fibre_force(length - tendon, 0.0, factor) - tension(tendon)

    return float(brentq(excess, SLACK, SLACK + 0.01, xtol=1e-16)) if excess(SLACK) > 0.0 else SLACK


def equilibrium(activations: Sequence[float], tendons: bool) -> tuple[float, list[float]]:
    """Angle (rad) at which muscles and weight balance, and there the lengths (m) of the tendons, if there are any."""
    factors = [frequency_factor(activation) for activation in activations]

    def stretched(angle: float) -> list[float]:
        return [settled_tendon(path(angle, role)[0], f) for role, f in zip(ROLES, factors, strict=True)]

    def torque(angle: float) -> float:
        lengths = stretched(angle) if tendons else []
        return rates(lambda _: factors, tendons, factors=True)(0.0, [angle, 0.0, *lengths])[1]

    angle = float(brentq(torque, 0.0, 1.0, xtol=1e-14))
    return angle, stretched(angle) if tendons else []
