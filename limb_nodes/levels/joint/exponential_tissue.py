"""Moments that grow exponentially towards both ends of a joint's range; not from the report.

The form of Riener and Edrich, and of Anderson, Madigan and Nussbaum: M_P = B_1 exp(k_1 alpha) + B_2 exp(k_2 alpha).
Here each end has the angle at which its moment is 1 N m and how fast it grows from there, with the sign that pushes
back into the range; B_1 = -exp(-k_1 upper_angle) and k_1 = upper_growth, B_2 = exp(k_2 lower_angle) with
k_2 = -lower_growth.
"""

import math

from limb_nodes.foundation.parameter import Parameter
from limb_nodes.levels.contracts import law, register
from limb_nodes.levels.equation import equation
from limb_nodes.levels.joint.linear_tissue import DAMPING


def growth(end: str) -> Parameter:
    """How fast the moment of one end grows."""
    return Parameter(
        f"{end}_growth",
        "1/rad",
        f"growth of the moment towards the {end} end",
        source="depends on the joint; 2 to 20: Riener and Edrich 1999",
        above=0.0,
        maximum=100.0,
    )


def angle(end: str) -> Parameter:
    """Where the moment of one end is 1 N m."""
    return Parameter(
        f"{end}_angle",
        "rad",
        f"angle at which the moment of the {end} end is 1 N m",
        source="depends on the joint",
        minimum=-10.0,
        maximum=10.0,
    )


@register
@law(
    "tissue",
    angle("upper"),
    growth("upper"),
    angle("lower"),
    growth("lower"),
    DAMPING,
    source="Riener and Edrich, J Biomech 32 (1999) 539; Anderson, Madigan and Nussbaum, J Biomech 40 (2007) 3105",
)
@equation("exponential tissue", "passive_moment")
def exponential(
    joint_angle: float,
    joint_velocity: float,
    upper_angle: float,
    upper_growth: float,
    lower_angle: float,
    lower_growth: float,
    damping: float,
) -> float:
    """Moment (N m) that raises the angle."""
    upper = math.exp(upper_growth * (joint_angle - upper_angle))
    lower = math.exp(lower_growth * (lower_angle - joint_angle))
    return lower - upper - damping * joint_velocity
