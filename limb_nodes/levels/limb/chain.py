"""Equations of motion of a planar chain in segment angles (3.3-3.11, 3.15).

Report symbols: alpha^s segment_angle, omega^s segment_velocity, theta inertia, m mass, l length,
l_COM com_distance, a_kp inertia_coupling, F_k centrifugal_torque and tip_force_torque,
G_k gravity_torque.

Two combinations of the masses occur again and again: `first_moment` of segment k,
m_k l_COM,k + l_k (sum of the masses beyond k), and `coupling` of two segments, the length of the
proximal one times the first moment of the distal one.
"""

import math

from limb_nodes.levels.equation import equation


@equation("first moment", "first_moment")
def first_moment(mass: float, com_distance: float, length: float, distal_mass: float) -> float:
    """First moment (kg m) of a segment that carries `distal_mass` at its end."""
    return mass * com_distance + length * distal_mass


@equation("3.8-3.9", "own_inertia")
def own_inertia(inertia: float, mass: float, com_distance: float, length: float, distal_mass: float) -> float:
    """Diagonal element a_kk of the inertia matrix (kg m^2)."""
    return inertia + mass * com_distance * com_distance + length * length * distal_mass


@equation("3.3-3.5", "inertia_coupling")
def inertia_coupling(coupling: float, cosine: float) -> float:
    """Off-diagonal element a_kp (kg m^2); `cosine` is that of the angle between the segments."""
    return coupling * cosine


@equation("3.6", "centrifugal_torque")
def centrifugal_torque(coupling: float, sine: float, segment_velocity: float) -> float:
    """Torque (N m) on segment k by the turning of segment p; `sine` is of alpha_k - alpha_p."""
    return -coupling * sine * segment_velocity * segment_velocity


@equation("3.6 load", "tip_force_torque")
def tip_force_torque(length: float, cosine: float, sine: float, tip_force_x: float, tip_force_y: float) -> float:
    """Torque (N m) on a segment, l_k (u_k x F), by the force on the tip."""
    return length * (cosine * tip_force_y - sine * tip_force_x)


@equation("3.7", "gravity_torque")
def gravity_torque(first_moment: float, cosine: float, sine: float, gravity_x: float, gravity_y: float) -> float:
    """Torque (N m) on a segment by gravity."""
    return first_moment * (cosine * gravity_y - sine * gravity_x)


@equation("2.65 x", "point_x")
def point_x(origin_x: float, distance: float, segment_angle: float) -> float:
    """x (m) of a point at `distance` along a segment that starts at `origin_x`."""
    return origin_x + distance * math.cos(segment_angle)


@equation("2.65 y", "point_y")
def point_y(origin_y: float, distance: float, segment_angle: float) -> float:
    """y (m) of a point at `distance` along a segment that starts at `origin_y`."""
    return origin_y + distance * math.sin(segment_angle)
