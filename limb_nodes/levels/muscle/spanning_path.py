"""Paths over any number of joints: a law gives the muscle-tendon length alone, and virtual work the rest.

Of a length l_MT of the joint angles alpha_k, the moment arm on joint k is -dl_MT/dalpha_k, positive if the muscle pulls
the angle up, and the muscle-tendon unit shortens by the sum of moment arm times joint velocity: force and shortening do
the same work as torques and turning. These are extensions of the report, which knows one joint.

The joints of a muscle are counted from proximal to distal: its variables are joint_angle_0, joint_angle_1, ...
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

from limb_nodes.levels.derivative import partial_derivative, written
from limb_nodes.levels.equation import Equation, Law

LENGTH = "muscle_tendon_length"


@lru_cache(maxsize=256)
def spanning(law: Law, angles: tuple[str, ...]) -> Law:
    """A law that also gives moment arms and velocity, from one whose equation of the length uses joint angles.

    angles: names that the law has for the angles of the muscle's joints, from proximal to distal.
    Raises UnsupportedCode if the length cannot be differentiated.
    """
    numbered = {name: f"joint_angle_{place}" for place, name in enumerate(angles)}
    given = [replace(one, named=tuple(numbered.get(name, name) for name in one.uses)) for one in law.equations]
    (length,) = (one for one in given if one.defines == LENGTH)
    arms = [moment_arm(length, place) for place in range(len(angles))]
    return replace(law, functions=(*given, *arms, velocity(len(angles))))


def moment_arm(length: Equation, place: int) -> Equation:
    """The moment arm (m) on a joint, -dl_MT/dalpha_k."""
    arguments = ", ".join(length.arguments)
    angle = f"joint_angle_{place}"
    if angle not in length.uses:
        return Equation("virtual work", f"moment_arm_{place}", written("no_arm", "def no_arm():\n    return 0.0\n"))
    slope = partial_derivative(length.function, length.arguments[length.uses.index(angle)])
    text = f"def moment_arm({arguments}):\n    return -slope({arguments})\n"
    return Equation("virtual work", f"moment_arm_{place}", written("moment_arm", text, slope=slope), length.uses)


@lru_cache(maxsize=32)
def velocity(joints: int) -> Equation:
    """The shortening velocity (m/s) of the muscle-tendon unit, the sum of moment arm times joint velocity."""
    pairs = [(f"moment_arm_{place}", f"joint_velocity_{place}") for place in range(joints)]
    arguments = ", ".join(name for pair in pairs for name in pair)
    total = " + ".join(f"{arm} * {turning}" for arm, turning in pairs)
    text = f"def shortening({arguments}):\n    return {total}\n"
    return Equation("virtual work", "muscle_tendon_velocity", written("shortening", text))
