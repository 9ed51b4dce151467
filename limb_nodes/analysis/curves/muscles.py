"""Characteristics of the laws of muscles."""

from __future__ import annotations

import math

import numpy as np
from scipy.optimize import brentq

from limb_nodes.analysis.curves.characteristic import Axis, Characteristic, Curve
from limb_nodes.analysis.curves.motor_units import POINTS, unit_lengths
from limb_nodes.analysis.curves.movement import moved, states_by_name
from limb_nodes.analysis.curves.uses import Use, law_names, legend, muscle_uses, shared, words
from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.model import ChosenLaw, Limb, Muscle
from limb_nodes.model.along_joint import along_joint
from limb_nodes.model.probe import Probe, given, initial_states

# A limb without limits on its joints turns once around.
FREE = (-math.pi, math.pi)
# Time (s) at which the excitation of the diagram of activation ends, and that of its end.
SWITCH, END = 0.2, 0.5
JOINT_ANGLE = Axis("joint angle", "rad")


def activation_dynamics(limb: Limb) -> Characteristic:
    """Activation after the excitation goes from 0 to 1 and, later, back to 0."""
    time, activation = Axis("time", "s"), Axis("activation", "1")
    diagram = Characteristic("activation_dynamics", "Activation", time, activation, owners="muscles")
    diagram.note = f"excitation 1 for {SWITCH:g} s, then 0"
    uses = [use for use in muscle_uses(limb, "activation_dynamics") if use.chosen.law.states]
    diagram.laws = law_names(use.chosen for use in uses)
    times = np.linspace(0.0, END, POINTS)
    for use in shared(uses):
        diagram.add(Curve(words(use.labels), times, switched_activation(use.chosen, times), use.labels[0]))
    return diagram


def switched_activation(chosen: ChosenLaw, times: FloatArray) -> FloatArray:
    """Activation at some times (s) of a law that starts at rest and is excited up to the time SWITCH."""
    probe = Probe(chosen, given(chosen), {})
    start = initial_states(chosen, probe)
    states = np.array([0.0 if name == "activation" else value for name, value in start.items()])
    activations: list[float] = []
    rise, fall = times[times <= SWITCH], np.append(SWITCH, times[times > SWITCH])
    for excitation, span, first in ((1.0, rise, 0), (0.0, fall, 1)):
        point = {"excitation": excitation}
        course = moved(chosen, probe, point, states, span, 1e-8)
        activations += [
            probe.at(**point, **states_by_name(chosen, values))["activation"] for values in course.T[first:]
        ]
        states = course[:, -1]
    return np.array(activations)


def greatest_force(muscle: Muscle) -> float:
    """Isometric force (N) of all motor units at their optimal length."""
    total = 0.0
    for unit in muscle.units:
        chosen = unit.laws["sarcomere"]
        best = unit_lengths(unit)["optimal_sarcomere_length"]
        point = {"sarcomere_velocity": 0.0, "sarcomere_length": best, "sarcomere_frequency": 0.0}
        probe = Probe(chosen, given(chosen), {})
        values = probe.at(**point, **initial_states(chosen, probe))
        total += unit.values["parallel_sarcomeres"] * values["maximum_sarcomere_force"]
    return total


def tendon(limb: Limb) -> Characteristic:
    """Force of a tendon at rest by its stretch, up to the muscle's greatest isometric force."""
    stretch, force = Axis("stretch of the tendon", "m"), Axis("force", "N")
    diagram = Characteristic("tendon", "Tendon", stretch, force, owners="muscles")
    every = muscle_uses(limb, "tendon")
    uses = [use for use in every if "tendon_length" in {state.name for state in use.chosen.law.states}]
    diagram.laws = law_names(use.chosen for use in uses)
    rigid = [use.muscle.name for use in every if use not in uses]
    if rigid:
        diagram.note = f"rigid: {words(rigid)}"
    for use in uses:
        forces = np.linspace(0.0, greatest_force(use.muscle), 101)
        diagram.add(Curve(legend(use, diagram), resting_stretch(use.chosen, forces), forces, use.muscle.name))
    return diagram


def resting_stretch(chosen: ChosenLaw, forces: FloatArray) -> FloatArray:
    """Length beyond the slack length (m) of a tendon at rest by its force (N), the first of which is 0."""
    probe = Probe(chosen, given(chosen), {})
    states = initial_states(chosen, probe)
    slack = chosen.values.get("slack_length", states["tendon_length"])
    return np.array([0.0, *(resting_length(probe, states, float(force), slack) - slack for force in forces[1:])])


def resting_length(probe: Probe, states: dict[str, float], force: float, slack: float) -> float:
    """Length (m) at which a tendon under a force neither lengthens nor shortens."""

    def velocity(length: float) -> float:
        return probe.at(**{**states, "tendon_force": -force, "tendon_length": length})["tendon_velocity"]

    longest = 1.05 * slack + 1e-3
    while velocity(longest) > 0.0 and longest < 1e3:
        longest += longest - slack
    return float(brentq(velocity, slack, longest, xtol=1e-12)) if velocity(slack) > 0.0 else slack


def joint_angles(limb: Limb, joint: int) -> FloatArray:
    """Angles (rad) over the range of a joint."""
    low, high = limb.segments[joint].joint_range or FREE
    return np.linspace(low, high, POINTS)


def path_values(limb: Limb, muscle: Muscle, joint: int, angles: FloatArray, variable: str) -> FloatArray:
    """A variable of a muscle's path by the angle of one of its joints, the others as at the start."""
    return np.array([point[variable] for point in along_joint(limb, muscle, joint, angles)])


def paths(limb: Limb) -> Characteristic:
    """Muscle-tendon length by joint angle (2.43, 2.44)."""
    length = Axis("muscle-tendon length", "m")
    diagram = Characteristic("path", "Path", JOINT_ANGLE, length, owners="muscles", zero=False)
    return by_angle(limb, "muscle_tendon_length", diagram)


def moment_arms(limb: Limb) -> Characteristic:
    """Moment arm by joint angle."""
    diagram = Characteristic("moment_arm", "Moment arm", JOINT_ANGLE, Axis("moment arm", "m"), owners="muscles")
    return by_angle(limb, "moment_arm", diagram)


def by_angle(limb: Limb, variable: str, diagram: Characteristic) -> Characteristic:
    """The diagram with a variable of each muscle's path by joint angle."""
    diagram.laws = law_names(muscle.laws["path"] for muscle in limb.muscles)
    for number, joint in limb.crossings:
        muscle, angles = limb.muscles[number], joint_angles(limb, joint)
        label = muscle.name if len(muscle.joints) == 1 else f"{muscle.name}, {limb.joint_names[joint]}"
        values = path_values(limb, muscle, joint, angles, variable)
        diagram.add(Curve(label, angles, values, muscle.name, style=muscle.joints.index(joint)))
    if any(len(muscle.joints) > 1 for muscle in limb.muscles):
        diagram.note = "one joint turns"
    return diagram


def pennation(limb: Limb) -> Characteristic:
    """Pennation angle by muscle length over the joint's range, for pennate muscles."""
    length, angle = Axis("muscle length", "m"), Axis("pennation angle", "rad")
    diagram = Characteristic("pennation", "Pennation", length, angle, owners="muscles", zero=False)
    pennate: list[Use] = []
    for use in muscle_uses(limb, "aponeurosis"):
        slack = use.muscle.laws["tendon"].values.get("slack_length", 0.0)
        lengths = -slack + np.concatenate(
            [
                path_values(limb, use.muscle, joint, joint_angles(limb, joint), "muscle_tendon_length")
                for joint in use.muscle.joints
            ]
        )
        span = np.linspace(max(1e-4, float(lengths.min())), float(lengths.max()), POINTS)
        probe = Probe(use.chosen, given(use.chosen), {"muscle_velocity": 0.0, "total_fibre_force": 0.0})
        states = initial_states(use.chosen, probe)
        angles = np.array([probe.at(**states, muscle_length=float(length))["pennation_angle"] for length in span])
        if np.nanmax(np.abs(angles), initial=0.0) > 0.0:
            pennate.append(use)
            diagram.add(Curve(use.muscle.name, span, angles, use.muscle.name))
            if states:
                diagram.note = "aponeurosis at its length at the start"
    diagram.laws = law_names(use.chosen for use in pennate)
    return diagram
