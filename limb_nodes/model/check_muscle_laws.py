"""Checks of the laws of muscles: path, tendon, aponeurosis, activation dynamics."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import product

from limb_nodes.model.chosen import ChosenLaw
from limb_nodes.model.curve_checks import curve_fault, grid, number_text, point_text
from limb_nodes.model.probe import Probe, given, initial_states, states_fault
from limb_nodes.model.system import crossings_of

# By how much a joint is turned at least to tell a length's slope (rad).
LEAST_TURN = 1e-6
# Corners of the ranges of so many joints are all tried, and so many points between.
MOST_CORNERS, POINTS_BETWEEN = 8, 200
FORCES = [0.0, 1.0, 10.0, 100.0, 1000.0]


def path_fault(chosen: ChosenLaw, context: dict[str, float]) -> str:
    """Length positive, velocity its rate, moment arm finite over the joint's range."""
    if (crossings := crossings_of(chosen.law)) != ("",):
        return spanning_fault(chosen, context, crossings)
    variable = "joint_angle"
    probe = Probe(chosen, given(chosen), {"role": context["role"]})
    low, high = chosen.law.ranges.get(variable, (context["lowest_angle"], context["highest_angle"]))
    # Without the ends: stretched out, a path may lie in its joint's axis.
    angles = grid(low, high, 20)[1:-1]
    points = [probe.at(joint_angle=angle, joint_velocity=1.0) for angle in angles]
    for name in ("muscle_tendon_length", "muscle_tendon_velocity", "moment_arm"):
        least = 0.0 if name == "muscle_tendon_length" else -math.inf
        fault = curve_fault(name, variable, angles, [point[name] for point in points], least=least)
        if fault:
            return fault
    # Over less, rounding of the lengths would tell more than their slope.
    small = max(1e-5 * (high - low), LEAST_TURN)
    for angle, point in zip(angles, points, strict=True):
        before, after = (
            probe.at(joint_angle=angle + step, joint_velocity=1.0)["muscle_tendon_length"] for step in (-small, small)
        )
        shortening = (before - after) / (2.0 * small)
        velocity = point["muscle_tendon_velocity"]
        if abs(shortening - velocity) > 1e-5 * (abs(shortening) + abs(velocity)) + 1e-9:
            return (
                f"muscle_tendon_velocity is {velocity:.6g} m/s at {point_text(variable, angle)} and 1 rad/s, "
                f"but the length shortens by {shortening:.6g} m/s"
            )
    return ""


def spanning_fault(chosen: ChosenLaw, context: dict[str, float], crossings: tuple[str, ...]) -> str:
    """Length positive, moment arms finite wherever the joints of the muscle may be."""
    probe = Probe(chosen, given(chosen), {"role": context["role"]})
    still = {f"joint_velocity{one}": 0.0 for one in crossings}
    ranges = [(context[f"lowest_angle{one}"], context[f"highest_angle{one}"]) for one in crossings]
    for shares in spread(len(crossings)):
        angles = {
            f"joint_angle{one}": low + share * (high - low)
            for one, (low, high), share in zip(crossings, ranges, shares, strict=True)
        }
        point = probe.at(**angles, **still)
        for name in ("muscle_tendon_length", *(f"moment_arm{one}" for one in crossings)):
            value = point[name]
            if not math.isfinite(value) or (name == "muscle_tendon_length" and value <= 0.0):
                at = " and ".join(f"{angle:.4g}" for angle in angles.values())
                needed = "a number > 0" if math.isfinite(value) else "a finite number"
                return f"{name} is {number_text(value)} at the joint angles {at} rad; {needed} is needed"
    return ""


def spread(dimensions: int) -> list[list[float]]:
    """Points all over a cube of edges from 0 to 1: its corners, if they are not too many, and some between."""
    # Takes as long to import as many limbs to load.
    from scipy.stats import qmc

    corners = product((0.0, 1.0), repeat=dimensions) if dimensions <= MOST_CORNERS else ()
    between = qmc.Halton(dimensions, scramble=False).random(POINTS_BETWEEN)
    return [*map(list, corners), *between.tolist()]


def tendon_fault(chosen: ChosenLaw, context: dict[str, float]) -> str:
    """A tendon with a state lengthens the faster, the more it is pulled and the shorter it is."""
    name, variable = "tendon_velocity", "tendon_length"
    probe = Probe(chosen, given(chosen), {})
    slack = chosen.values.get("slack_length", 0.0) or 0.1
    states = initial_states(chosen, probe)
    pulls = sorted(-force for force in FORCES)
    if variable not in states:
        points = [probe.at(**states, tendon_force=pull, tendon_length=slack) for pull in pulls]
        return curve_fault(name, "tendon_force", pulls, [point[name] for point in points])
    low, high = chosen.law.ranges.get(variable, (0.9 * slack, 1.2 * slack))
    lengths = grid(low, high, 40)
    for pull in pulls[::2]:
        velocities = [probe.at(**{**states, "tendon_force": pull, variable: length})[name] for length in lengths]
        words = f" and {point_text('tendon_force', pull)}"
        fault = curve_fault(name, variable, lengths, velocities, direction=-1, suffix=words)
        if fault:
            return fault
    for length in lengths[::20]:
        velocities = [probe.at(**{**states, "tendon_force": pull, variable: length})[name] for pull in pulls]
        words = f" and {point_text(variable, length)}"
        fault = curve_fault(name, "tendon_force", pulls, velocities, direction=-1, suffix=words)
        if fault:
            return fault
    return ""


def aponeurosis_fault(chosen: ChosenLaw, context: dict[str, float]) -> str:
    """Muscle force and fibre velocity rise with the force of the fibres, so that the loop closes once."""
    variable = "total_fibre_force"
    probe = Probe(chosen, given(chosen), {"muscle_velocity": 0.0})
    states = initial_states(chosen, probe)
    optimal = context["optimal_length"]
    lengths = grid(0.5 * optimal, 1.5 * optimal, 4)
    if states:
        # Only some lengths go with a state; if none does, `check_geometry` says so.
        lengths = [max(optimal, 2.0 * max(states.values()))]
    for length in lengths:
        points = [probe.at(**states, muscle_length=length, total_fibre_force=force) for force in FORCES]
        words = f" and {point_text('muscle_length', length)}"
        for name, direction, least in (
            ("muscle_force", 1, 0.0),
            ("fibre_velocity", 1, -math.inf),
            ("fibre_length", 0, 0.0),
            ("pennation_angle", 0, -math.inf),
        ):
            values = [point[name] for point in points]
            fault = curve_fault(name, variable, FORCES, values, direction=direction, least=least, suffix=words)
            if fault:
                return fault
    return ""


def activation_fault(chosen: ChosenLaw, context: dict[str, float]) -> str:
    """Finite; without states it rises with the excitation and is not negative."""
    probe = Probe(chosen, given(chosen), {})
    excitations = grid(0.0, 1.0, 20)
    if not chosen.law.states:
        activations = [probe.at(excitation=excitation)["activation"] for excitation in excitations]
        return curve_fault("activation", "excitation", excitations, activations, direction=1, least=0.0)
    points = (
        ({"excitation": excitation}, f" and {point_text('excitation', excitation)}") for excitation in excitations
    )
    return states_fault(chosen, probe, points)


MUSCLE_CHECKS: dict[str, Callable[[ChosenLaw, dict[str, float]], str]] = {
    "path": path_fault,
    "tendon": tendon_fault,
    "aponeurosis": aponeurosis_fault,
    "activation_dynamics": activation_fault,
}
