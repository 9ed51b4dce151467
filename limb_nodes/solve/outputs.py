"""What muscles, motor units, sarcomeres and torques show, and under which names the messages carry it."""

from __future__ import annotations

MUSCLE_OUTPUTS = (
    "activation",
    "muscle_tendon_length",
    "muscle_tendon_velocity",
    "muscle_length",
    "muscle_velocity",
    "tendon_length",
    "tendon_velocity",
    "aponeurosis_length",
    "aponeurosis_velocity",
    "pennation_angle",
    "fibre_length",
    "fibre_velocity",
    "total_fibre_force",
    "muscle_force",
)
# What a muscle shows on each joint that it crosses.
CROSSING_OUTPUTS = ("moment_arm", "muscle_torque")
# Those of a muscle that have a range (`limb_nodes.solve.ranges`).
LENGTHS = ("muscle_tendon_length", "muscle_length", "tendon_length", "aponeurosis_length", "fibre_length")
UNIT_OUTPUTS = (
    "stimulation_frequency",
    "force_frequency_factor",
    "force_length_factor",
    "passive_force",
    "fibre_force",
    "fibre_length_norm",
    "sarcomere_length",
    "sarcomere_velocity",
    "sarcomere_force",
)

# Field of MuscleState, MotorUnitState and SarcomereState -> output.
MUSCLE_FIELDS = {
    "muscle_tendon_length": "muscle_tendon_length",
    "muscle_tendon_velocity": "muscle_tendon_velocity",
    "muscle_length": "muscle_length",
    "muscle_velocity": "muscle_velocity",
    "tendon_length": "tendon_length",
    "tendon_velocity": "tendon_velocity",
    "aponeurosis_length": "aponeurosis_length",
    "aponeurosis_velocity": "aponeurosis_velocity",
    "pennation_angle": "pennation_angle",
    "fibre_length": "fibre_length",
    "fibre_velocity": "fibre_velocity",
    "fibre_force": "total_fibre_force",
    "muscle_force": "muscle_force",
    "torque": "muscle_torque",
}
UNIT_FIELDS = {
    "stimulation_frequency": "stimulation_frequency",
    "force_frequency_factor": "force_frequency_factor",
    "force_length_factor": "force_length_factor",
    "passive_force": "passive_force",
    "force": "fibre_force",
}
SARCOMERE_FIELDS = {"length": "sarcomere_length", "velocity": "sarcomere_velocity", "force": "sarcomere_force"}
# By topic.
STATE_FIELDS = {"muscle_state": MUSCLE_FIELDS, "motor_unit_state": UNIT_FIELDS, "sarcomere_state": SARCOMERE_FIELDS}
# Fields of JointTorque, in the order of the rows in which a torque of n joints stands [2 + 2 n, n].
TORQUE_FIELDS = ("torque", "slope_time", "slope_angle", "slope_velocity")
