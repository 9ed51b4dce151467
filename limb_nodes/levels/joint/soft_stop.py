"""A seat, a bumper or another limb against which a joint presses; not from the report.

The contact of Hunt and Crossley: with p the depth beyond the stop's angle, |M_P| = k p^1.5 (1 + c dp/dt), k stiffness,
c damping; it never pulls. Damped in proportion to the depth, the moment begins and ends at zero.
"""

import math

from limb_nodes.foundation.parameter import Parameter
from limb_nodes.levels.contracts import law, register
from limb_nodes.levels.equation import equation

PARAMETERS = (
    Parameter(
        "stop_angle",
        "rad",
        "angle at which it touches",
        source="depends on what is there",
        minimum=-10.0,
        maximum=10.0,
    ),
    Parameter(
        "stiffness",
        "N m/rad^1.5",
        "moment at a depth of 1 rad, k",
        source="depends on what is there",
        above=0.0,
        maximum=1e7,
    ),
    Parameter(
        "damping",
        "s/rad",
        "share by which the moment grows with the velocity, c",
        0.5,
        "estimate; Hunt and Crossley: 1.5 times what restitution loses per velocity",
        minimum=0.0,
        maximum=1e3,
    ),
)
SOURCE = "Hunt and Crossley, J Appl Mech 42 (1975) 440"


def pressed(depth: float, speed: float, stiffness: float, damping: float) -> float:
    """Moment (N m) of the contact, not negative. speed: of the depth (rad/s)."""
    if depth <= 0.0:
        return 0.0
    return stiffness * depth * math.sqrt(depth) * max(0.0, 1.0 + damping * speed)


@register
@law("tissue", *PARAMETERS, source=SOURCE)
@equation("Hunt-Crossley, above", "passive_moment")
def upper_stop(joint_angle: float, joint_velocity: float, stop_angle: float, stiffness: float, damping: float) -> float:
    """Moment (N m) against angles above that of the stop."""
    return -pressed(joint_angle - stop_angle, joint_velocity, stiffness, damping)


@register
@law("tissue", *PARAMETERS, source=SOURCE)
@equation("Hunt-Crossley, below", "passive_moment")
def lower_stop(joint_angle: float, joint_velocity: float, stop_angle: float, stiffness: float, damping: float) -> float:
    """Moment (N m) against angles below that of the stop."""
    return pressed(stop_angle - joint_angle, -joint_velocity, stiffness, damping)
