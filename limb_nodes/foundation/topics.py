"""Topics of a limb: their names relative to the limb's namespace, their types, and which of them are latched."""

from __future__ import annotations

TOPIC_TYPES: dict[str, str] = {
    "emg": "std_msgs/msg/Float64MultiArray",
    "emg_raw": "std_msgs/msg/Float32MultiArray",
    "emg_envelope": "limb_msgs/msg/EmgEnvelope",
    "reference_angle": "sensor_msgs/msg/JointState",
    "activation": "limb_msgs/msg/MuscleActivation",
    "limb_state": "limb_msgs/msg/LimbState",
    "joint_torque": "limb_msgs/msg/JointTorque",
    "limb_impact": "limb_msgs/msg/LimbImpact",
    "impact_torque": "limb_msgs/msg/JointTorque",
    "joint_states": "sensor_msgs/msg/JointState",
    "movement_pattern": "limb_msgs/msg/MovementPattern",
    "muscle_state": "limb_msgs/msg/MuscleState",
    "motor_unit_state": "limb_msgs/msg/MotorUnitState",
    "sarcomere_state": "limb_msgs/msg/SarcomereState",
    "muscle_checkpoint": "limb_msgs/msg/Checkpoint",
    "limb_checkpoint": "limb_msgs/msg/Checkpoint",
    "external_load": "geometry_msgs/msg/WrenchStamped",
    "joint_command": "sensor_msgs/msg/JointState",
    "claim": "limb_msgs/msg/Claim",
    "recorded": "limb_msgs/msg/Recorded",
    "run_info": "std_msgs/msg/String",
    "robot_description": "std_msgs/msg/String",
    "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
}
"""Topic -> message type."""

LATCHED_TOPICS = frozenset({"robot_description"})
"""Topics whose newest message a late subscriber still gets (transient-local)."""

NODES = ("activation_input", "muscle_stack", "limb_dynamics", "recorder")
"""The nodes of a run."""

STATES = ("muscle_state", "motor_unit_state", "sarcomere_state")
"""Topics that muscle_stack sends on request."""

SENDERS = {
    "activation": "activation_input",
    "limb_state": "limb_dynamics",
    "joint_torque": "muscle_stack",
    "limb_impact": "limb_dynamics",
    "impact_torque": "muscle_stack",
    "movement_pattern": "limb_dynamics",
    **dict.fromkeys(STATES, "muscle_stack"),
    "muscle_checkpoint": "muscle_stack",
    "limb_checkpoint": "limb_dynamics",
}
"""Topic of a run, with a message for each tick, for every so many or for each impact -> the node that sends it."""

IMPACTS = ("limb_impact", "impact_torque")
"""Topics that have a message for each impact within a tick: what has struck, and the torque behind it."""

RECORDED = tuple(topic for topic in SENDERS if topic not in ("limb_state", *IMPACTS))
"""Those that a bag holds; joint_states, which it holds too, is made of movement_pattern."""

PUBLIC = tuple(topic for topic in RECORDED if not topic.endswith("_checkpoint"))
"""Those that are published a second time, under their own names, for whoever wants to look on."""


def exchanged(topic: str) -> str:
    """The name, hidden in lists of topics, of a topic that the nodes of a run alone are to use.

    Its messages are kept for nodes that start late.
    """
    return f"_run/{topic}"
