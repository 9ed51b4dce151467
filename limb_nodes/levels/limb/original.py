"""The limb in its original form: every segment a free body, tied by the forces in the joints (2.56-2.65).

Positions and accelerations of the centres of mass and the forces in the joints are unknowns here, which makes it a
system of differential and algebraic equations of index 3. The transformed form (`chain`, `transformed`) is what is
solved; this one serves the analysis of the structure and, put to a solved movement, gives the forces in the joints.

Report symbols: alpha joint_angle, omega joint_velocity, alpha^s segment_angle, omega^s segment_velocity,
s com_position, v com_velocity, a com_acceleration, F_L joint_force (of the proximal neighbour on the segment),
M_L joint_torque, F_load and M_load tip_force and tip_torque, theta inertia, m mass, l length, l_COM com_distance.
The vectors r^1 and r^2 from the centre of mass to the joints lie along the segment: r^1 = -l_COM u and
r^2 = (l - l_COM) u with u = (cos alpha^s, sin alpha^s). The load is what the environment exerts on the tip, so it
enters 2.58 and 2.64 with the opposite sign of the report's reaction. A name that ends in `_rate` is the derivative by
time of the variable before it. 2.65 itself is `chain.point_x` and `chain.point_y`.
"""

import math

from limb_nodes.levels.equation import equation


@equation("2.56", "segment_angle_rate")
def segment_angle_rate(segment_velocity: float) -> float:
    """Derivative (rad/s) of the angle of a segment."""
    return segment_velocity


@equation("r^1 x F_L", "proximal_moment")
def proximal_moment(segment_angle: float, joint_force_x: float, joint_force_y: float, com_distance: float) -> float:
    """Moment (N m) about the centre of mass of the force in the proximal joint."""
    return -com_distance * (math.cos(segment_angle) * joint_force_y - math.sin(segment_angle) * joint_force_x)


@equation("r^2 x F_L", "distal_moment")
def distal_moment(
    segment_angle: float, distal_force_x: float, distal_force_y: float, com_distance: float, length: float
) -> float:
    """Moment (N m) about the centre of mass of a force at the distal end: that of the next joint, or the load."""
    across = math.cos(segment_angle) * distal_force_y - math.sin(segment_angle) * distal_force_x
    return (length - com_distance) * across


@equation("2.57", "segment_velocity_rate")
def segment_velocity_rate(
    joint_torque: float, next_joint_torque: float, proximal_moment: float, distal_moment: float, inertia: float
) -> float:
    """Angular acceleration (rad/s^2) of a segment that carries another one, on which the distal force acts."""
    return (joint_torque - next_joint_torque + proximal_moment - distal_moment) / inertia


@equation("2.58", "segment_velocity_rate")
def last_segment_velocity_rate(
    joint_torque: float, tip_torque: float, proximal_moment: float, distal_moment: float, inertia: float
) -> float:
    """Angular acceleration (rad/s^2) of the last segment, whose tip bears the load."""
    return (joint_torque + tip_torque + proximal_moment + distal_moment) / inertia


@equation("2.59 x", "com_velocity_x")
def com_velocity_x(com_position_x_rate: float) -> float:
    """Velocity (m/s) of the centre of mass in x."""
    return com_position_x_rate


@equation("2.59 y", "com_velocity_y")
def com_velocity_y(com_position_y_rate: float) -> float:
    """Velocity (m/s) of the centre of mass in y."""
    return com_position_y_rate


@equation("2.60 x", "com_acceleration_x")
def com_acceleration_x(com_velocity_x_rate: float) -> float:
    """Acceleration (m/s^2) of the centre of mass in x."""
    return com_velocity_x_rate


@equation("2.60 y", "com_acceleration_y")
def com_acceleration_y(com_velocity_y_rate: float) -> float:
    """Acceleration (m/s^2) of the centre of mass in y."""
    return com_velocity_y_rate


@equation("2.62", "joint_angle")
def joint_angle(segment_angle: float, previous_segment_angle: float) -> float:
    """Joint angle (rad) between a segment and the one before it; the base angle is before the first."""
    return segment_angle - previous_segment_angle


@equation("2.62 rate", "joint_velocity")
def joint_velocity(segment_velocity: float, previous_segment_velocity: float) -> float:
    """Joint velocity (rad/s): 2.62 differentiated."""
    return segment_velocity - previous_segment_velocity


@equation("2.63 x", "joint_force_x")
def joint_force_x(next_joint_force_x: float, mass: float, com_acceleration_x: float, gravity_x: float) -> float:
    """Force (N) in x on a segment in its proximal joint."""
    return next_joint_force_x + mass * (com_acceleration_x - gravity_x)


@equation("2.63 y", "joint_force_y")
def joint_force_y(next_joint_force_y: float, mass: float, com_acceleration_y: float, gravity_y: float) -> float:
    """Force (N) in y on a segment in its proximal joint."""
    return next_joint_force_y + mass * (com_acceleration_y - gravity_y)


@equation("2.64 x", "joint_force_x")
def last_joint_force_x(tip_force_x: float, mass: float, com_acceleration_x: float, gravity_x: float) -> float:
    """Force (N) in x on the last segment in its proximal joint."""
    return mass * (com_acceleration_x - gravity_x) - tip_force_x


@equation("2.64 y", "joint_force_y")
def last_joint_force_y(tip_force_y: float, mass: float, com_acceleration_y: float, gravity_y: float) -> float:
    """Force (N) in y on the last segment in its proximal joint."""
    return mass * (com_acceleration_y - gravity_y) - tip_force_y
