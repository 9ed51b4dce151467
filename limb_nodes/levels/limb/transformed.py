"""The limb in its transformed form: ordinary differential equations in segment angles (3.10, 3.11, 3.15).

The elements of the inertia matrix and the torques of motion, gravity and load are those of `chain`. Report symbols:
alpha^s segment_angle, omega^s segment_velocity, M_k net_torque, M_L joint_torque, M_load tip_torque,
F_k centrifugal_torque and tip_force_torque, G_k gravity_torque, a_kp inertia_coupling.
"""

from limb_nodes.levels.equation import equation


@equation("3.10", "segment_angle_rate")
def segment_angle_rate(segment_velocity: float) -> float:
    """Derivative (rad/s) of the angle of a segment."""
    return segment_velocity


@equation("3.15", "net_torque")
def net_torque(joint_torque: float, next_joint_torque: float) -> float:
    """Torque (N m) of the muscles on a segment, at its proximal and at its distal joint."""
    return joint_torque - next_joint_torque


@equation("3.15 last", "net_torque")
def last_net_torque(joint_torque: float, tip_torque: float) -> float:
    """Torque (N m) of the muscles and of the load on the last segment."""
    return joint_torque + tip_torque


@equation("3.1", "inertial_torque")
def inertial_torque(inertia_coupling: float, segment_velocity_rate: float) -> float:
    """Torque (N m) that the angular acceleration of one segment takes of another, a_kp domega^s_p/dt."""
    return inertia_coupling * segment_velocity_rate


@equation("3.11", "torque_residual")
def torque_residual(
    net_torque: float,
    centrifugal_torque: float,
    tip_force_torque: float,
    gravity_torque: float,
    inertial_torque: float,
) -> float:
    """Row of M + F + G - A domega^s/dt (N m), zero in every movement; F and the inertial torque are sums."""
    return net_torque + centrifugal_torque + tip_force_torque + gravity_torque - inertial_torque
