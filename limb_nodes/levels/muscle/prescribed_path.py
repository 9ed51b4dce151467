"""A path whose length is prescribed, for a muscle on a bench instead of over a joint.

The bench hands over the muscle-tendon length as the joint's angle and its rate of change as the
joint's velocity. Not among the laws that a limb's file can choose: over a joint it means nothing.
"""

from limb_nodes.levels.equation import Law, equation


@equation("prescribed length", "muscle_tendon_length")
def prescribed_length(joint_angle: float) -> float:
    """Muscle-tendon length (m), as given."""
    return joint_angle


@equation("prescribed velocity", "muscle_tendon_velocity")
def prescribed_velocity(joint_velocity: float) -> float:
    """Shortening velocity (m/s), the given rate of change with its sign turned (2.26)."""
    return -joint_velocity


@equation("no joint", "moment_arm")
def unit_arm() -> float:
    """Moment arm (m) of 1: the torque of the role is then the force."""
    return 1.0


prescribed = Law(
    "path",
    "prescribed",
    (prescribed_length, prescribed_velocity, unit_arm),
    source="a muscle on a bench",
)
