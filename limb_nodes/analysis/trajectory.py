"""What a limb did, alike from the whole-model solve and from the bag of a run."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from limb_nodes.bags.read import BagReader
from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.model.limb import Limb
from limb_nodes.solve.outputs import MUSCLE_FIELDS, SARCOMERE_FIELDS, STATE_FIELDS, UNIT_FIELDS
from limb_nodes.solve.whole import Movement


@dataclass(frozen=True)
class Trajectory:
    """The movement of T instants, n joints. SI units, radians.

    time: [T]. angle, velocity, acceleration, torque: of the joints [T, n]. activation: of the muscles, as given [T, m].
    muscle, unit, sarcomere: by field of MuscleState [T, m], MotorUnitState and SarcomereState [T, units]; empty
    if they were not recorded.
    """

    time: FloatArray
    angle: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    torque: FloatArray
    activation: FloatArray
    muscle: dict[str, FloatArray] = field(default_factory=dict)
    unit: dict[str, FloatArray] = field(default_factory=dict)
    sarcomere: dict[str, FloatArray] = field(default_factory=dict)


def joint_torque(limb: Limb, movement: Movement) -> FloatArray:
    """The torque of all muscles on each joint (N m) [T, n] (2.61) of a movement that was solved with its outputs."""
    torque = np.zeros_like(movement.angle)
    for crossing, (_, joint) in enumerate(limb.crossings):
        torque[:, joint] += movement.muscle["muscle_torque"][:, crossing]
    return torque


def trajectory_of_movement(limb: Limb, movement: Movement) -> Trajectory:
    """The trajectory of a movement that was solved with its outputs."""
    return Trajectory(
        time=movement.time,
        angle=movement.angle,
        velocity=movement.velocity,
        acceleration=movement.acceleration,
        torque=joint_torque(limb, movement),
        activation=movement.excitation,
        muscle={key: movement.muscle[name] for key, name in MUSCLE_FIELDS.items()},
        unit={key: movement.unit[name] for key, name in UNIT_FIELDS.items()},
        sarcomere={key: movement.unit[name] for key, name in SARCOMERE_FIELDS.items()},
    )


def trajectory_of_bag(path: str | Path) -> Trajectory:
    """The trajectory that the bag of a run holds, states at every tick or not at all. Raises UserError."""
    with BagReader(path) as bag:
        pattern = bag.table("movement_pattern")
        states: dict[str, dict[str, FloatArray]] = {topic: {} for topic in STATE_FIELDS}
        for topic, fields in STATE_FIELDS.items():
            if bag.has(topic):
                table = bag.table(topic)
                states[topic] = {key: table[key] for key in fields}
        return Trajectory(
            time=pattern["time"],
            angle=pattern["angle"],
            velocity=pattern["velocity"],
            acceleration=pattern["acceleration"],
            torque=bag.table("joint_torque")["torque"],
            activation=bag.table("activation")["activation"],
            muscle=states["muscle_state"],
            unit=states["motor_unit_state"],
            sarcomere=states["sarcomere_state"],
        )
