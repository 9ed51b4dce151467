"""A path with constant moment arms over any number of joints: l_MT = l_0 - sum of r_k (alpha_k - alpha_0,k)."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

from limb_nodes.foundation.parameter import Parameter
from limb_nodes.levels.derivative import written
from limb_nodes.levels.equation import Equation, Law
from limb_nodes.levels.muscle.spanning_path import LENGTH, spanning

SOURCE = "An, Takahashi, Harrigan and Chao, J Biomech Eng 106 (1984) 280: an arm that stays, work-consistent"
LENGTH_AT_REFERENCE = Parameter("length", "m", "muscle-tendon length at the reference angles", above=0.0, below=10.0)
MOMENT_ARM = Parameter(
    "moment_arms", "m", "moment arm on each joint, > 0 if it pulls the angle up", above=-1.0, below=1.0
)
REFERENCE_ANGLE = Parameter(
    "angles", "rad", "reference angle of each joint", 0.0, "zero of the joint", minimum=-10.0, maximum=10.0
)


@lru_cache(maxsize=32)
def linear(joints: int) -> Law:
    """The law over so many joints; its parameters are length, arm_0, reference_angle_0, arm_1, ..."""
    arms = [f"arm_{place}" for place in range(joints)]
    references = [f"reference_angle_{place}" for place in range(joints)]
    angles = tuple(f"joint_angle_{place}" for place in range(joints))
    own = ", ".join(f"{arm}, {reference}" for arm, reference in zip(arms, references, strict=True))
    turned = "".join(
        f" - {arm} * ({angle} - {reference})" for arm, angle, reference in zip(arms, angles, references, strict=True)
    )
    text = f"def muscle_tendon_length({', '.join(angles)}, length, {own}):\n    return length{turned}\n"
    pairs = ((MOMENT_ARM, arms), (REFERENCE_ANGLE, references))
    parameters = [replace(parameter, name=name) for parameter, names in pairs for name in names]
    equation = Equation("linear", LENGTH, written("muscle_tendon_length", text))
    return spanning(Law("path", "linear", (equation,), (LENGTH_AT_REFERENCE, *parameters), source=SOURCE), angles)
