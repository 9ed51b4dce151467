"""Topics of a limb: their names relative to the limb's namespace, their types, and which of them are latched."""

from __future__ import annotations

TOPIC_TYPES: dict[str, str] = {
    "emg": "std_msgs/msg/Float64MultiArray",
    "emg_raw": "std_msgs/msg/Float32MultiArray",
    "emg_envelope": "limb_msgs/msg/MuscleActivation",
    "reference_angle": "sensor_msgs/msg/JointState",
    "activation": "limb_msgs/msg/MuscleActivation",
    "joint_torque": "limb_msgs/msg/JointTorque",
    "joint_states": "sensor_msgs/msg/JointState",
    "movement_pattern": "limb_msgs/msg/MovementPattern",
    "muscle_state": "limb_msgs/msg/MuscleState",
    "motor_unit_state": "limb_msgs/msg/MotorUnitState",
    "sarcomere_state": "limb_msgs/msg/SarcomereState",
    "muscle_checkpoint": "limb_msgs/msg/Checkpoint",
    "limb_checkpoint": "limb_msgs/msg/Checkpoint",
    "external_load": "geometry_msgs/msg/WrenchStamped",
    "run_info": "std_msgs/msg/String",
    "robot_description": "std_msgs/msg/String",
    "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
}
"""Topic -> message type."""

LATCHED_TOPICS = frozenset({"robot_description", "joint_states"})
"""Topics whose newest message a late subscriber still gets (transient-local)."""

NODES = ("activation_input", "muscle_stack", "limb_dynamics", "recorder")
"""The nodes of a run."""

STATES = ("muscle_state", "motor_unit_state", "sarcomere_state")
"""Topics that muscle_stack sends on request."""

SENDERS = {
    "activation": "activation_input",
    "joint_states": "limb_dynamics",
    "joint_torque": "muscle_stack",
    "movement_pattern": "limb_dynamics",
    **dict.fromkeys(STATES, "muscle_stack"),
    "muscle_checkpoint": "muscle_stack",
    "limb_checkpoint": "limb_dynamics",
}
"""Topic of a run, with a message for each tick or for every so many -> the node that sends it."""
