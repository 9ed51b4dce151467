"""Moment arm that follows from the path, the report's possible development of its assumption 2.

Report symbols: r_M moment_arm, l_M+T muscle_tendon_length, alpha joint_angle.
"""

from limb_nodes.levels.contracts import register
from limb_nodes.levels.equation import Law, equation
from limb_nodes.levels.muscle.path import GEOMETRY, PARAMETERS


@equation("virtual work", "moment_arm")
def moment_arm(path_slope: float, role: float) -> float:
    """Moment arm (m) with which force and shortening do the same work as torque and turning.

    The shortening per angle, -dl_MT/dalpha, is positive for a flexor and negative for an extensor.
    """
    return role * path_slope


geometric_moment_arm = register(
    Law(
        "path",
        "geometric_moment_arm",
        (*GEOMETRY, moment_arm),
        PARAMETERS,
        source="An, Takahashi, Harrigan and Chao, J Biomech Eng 106 (1984) 280",
    )
)
