"""Muscle-tendon path over the joint (2.43-2.48).

Report symbols: alpha joint_angle, omega joint_velocity, r_M moment_arm, d_M^prox
proximal_distance, d_M^dist distal_distance, l_M+T muscle_tendon_length,
v_M+T muscle_tendon_velocity. role is +1 for a flexor and -1 for an extensor.
"""

import math

from limb_nodes.foundation.parameter import Parameter
from limb_nodes.levels.contracts import register
from limb_nodes.levels.equation import Law, equation


@equation("2.43-2.44", "muscle_tendon_length")
def muscle_tendon_length(
    joint_angle: float,
    role: float,
    moment_arm: float,
    proximal_distance: float,
    distal_distance: float,
) -> float:
    """Length (m) from origin to insertion over a pulley at the joint."""
    bend = 2.0 * role * moment_arm * math.sin(0.5 * joint_angle)
    return math.sqrt(
        moment_arm * moment_arm + proximal_distance * proximal_distance - bend * proximal_distance
    ) + math.sqrt(moment_arm * moment_arm + distal_distance * distal_distance - bend * distal_distance)


@equation("-dl/dalpha", "path_slope")
def path_slope(
    joint_angle: float,
    role: float,
    moment_arm: float,
    proximal_distance: float,
    distal_distance: float,
) -> float:
    """Shortening per joint angle, -dl_MT/dalpha (m/rad), the factor of omega in 2.45-2.48."""
    bend = 2.0 * role * moment_arm * math.sin(0.5 * joint_angle)
    proximal = math.sqrt(moment_arm * moment_arm + proximal_distance * proximal_distance - bend * proximal_distance)
    distal = math.sqrt(moment_arm * moment_arm + distal_distance * distal_distance - bend * distal_distance)
    return (
        0.5
        * role
        * moment_arm
        * math.cos(0.5 * joint_angle)
        * (proximal_distance / proximal + distal_distance / distal)
    )


@equation("2.45-2.48", "muscle_tendon_velocity")
def muscle_tendon_velocity(path_slope: float, joint_velocity: float) -> float:
    """Shortening velocity (m/s) of the muscle-tendon unit."""
    return path_slope * joint_velocity


@equation("assumption 2", "moment_arm")
def constant_arm(moment_arm: float) -> float:
    """Moment arm (m), the same at every angle."""
    return moment_arm


PARAMETERS = (
    Parameter(
        "moment_arm",
        "m",
        "distance of the path from the joint's axis, r_M",
        source="depends on the muscle",
        above=0.0,
        below=1.0,
    ),
    Parameter(
        "proximal_distance",
        "m",
        "distance from the origin to the joint, d_M^prox",
        source="depends on the muscle",
        above=0.0,
        below=10.0,
    ),
    Parameter(
        "distal_distance",
        "m",
        "distance from the insertion to the joint, d_M^dist",
        source="depends on the muscle",
        above=0.0,
        below=10.0,
    ),
)
GEOMETRY = (muscle_tendon_length, path_slope, muscle_tendon_velocity)

constant_moment_arm = register(
    Law(
        "path",
        "constant_moment_arm",
        (*GEOMETRY, constant_arm),
        PARAMETERS,
        source="report, assumption 2",
    )
)
