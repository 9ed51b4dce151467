"""Checks of the laws of a joint's tissue."""

from __future__ import annotations

from limb_nodes.model.chosen import ChosenLaw
from limb_nodes.model.curve_checks import curve_fault, grid, number_text, point_text
from limb_nodes.model.probe import Probe, given

VELOCITIES = (-20.0, -5.0, -1.0, -0.1, 0.1, 1.0, 5.0, 20.0)


def tissue_fault(chosen: ChosenLaw, context: dict[str, float]) -> str:
    """Finite over the joint's range, acts somewhere in it, and gives no energy over a closed cycle.

    What the angle alone gives back was put in; what the velocity adds must act against it.
    """
    name, angle, velocity = "passive_moment", "joint_angle", "joint_velocity"
    if chosen.law.states:
        return f"it has the state {chosen.law.states[0].name}; a law of tissue has none"
    probe = Probe(chosen, given(chosen), {})
    low, high = chosen.law.ranges.get(angle, (context["lowest_angle"], context["highest_angle"]))
    angles = grid(low, high, 40)
    at_rest = [probe.at(joint_angle=a, joint_velocity=0.0)[name] for a in angles]
    acts = any(at_rest)
    for speed in VELOCITIES:
        moments = [probe.at(joint_angle=a, joint_velocity=speed)[name] for a in angles]
        for moment, resting, a in zip(moments, at_rest, angles, strict=True):
            added = moment - resting
            if added * speed > 1e-9 * abs(resting * speed):
                where = f"{point_text(angle, a)} and {point_text(velocity, speed)}"
                return (
                    f"{name} is {number_text(moment)} at {where} and {number_text(resting)} at rest there: "
                    "it feeds energy in; what the velocity adds must act against it"
                )
        acts = acts or any(moments)
        words = f" and {point_text(velocity, speed)}"
        if fault := curve_fault(name, angle, angles, moments, suffix=words):
            return fault
    if not acts:
        return f"{name} is 0 at every {angle} from {low:.6g} to {high:.6g} rad, the joint's range; it never acts"
    return ""


TISSUE_CHECKS = {"tissue": tissue_fault}
