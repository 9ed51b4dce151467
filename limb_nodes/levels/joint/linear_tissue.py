"""A spring and a damper about a rest angle; not from the report.

M_P = -K (alpha - alpha_0) - B omega, the passive part that 2.61 does not have: K stiffness, B damping,
alpha joint_angle, alpha_0 rest_angle, omega joint_velocity.
"""

from limb_nodes.foundation.parameter import Parameter
from limb_nodes.levels.contracts import law, register
from limb_nodes.levels.equation import equation

DAMPING = Parameter(
    "damping",
    "N m s/rad",
    "moment against the velocity, B",
    0.0,
    "depends on the joint; 0: none",
    minimum=0.0,
    maximum=1e4,
)


@register
@law(
    "tissue",
    Parameter(
        "stiffness",
        "N m/rad",
        "moment per angle, K",
        source="depends on the joint",
        minimum=0.0,
        maximum=1e5,
    ),
    DAMPING,
    Parameter(
        "rest_angle",
        "rad",
        "angle without moment, alpha_0",
        0.0,
        "depends on the joint",
        minimum=-10.0,
        maximum=10.0,
    ),
    source="spring and damper side by side",
)
@equation("linear tissue", "passive_moment")
def linear(joint_angle: float, joint_velocity: float, stiffness: float, damping: float, rest_angle: float) -> float:
    """Moment (N m) that raises the angle."""
    return -stiffness * (joint_angle - rest_angle) - damping * joint_velocity
