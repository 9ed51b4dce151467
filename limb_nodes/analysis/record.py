"""Write a solved movement as a bag with the topics of a run."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from limb_nodes.bags.bulk import write_table
from limb_nodes.bags.write import BagWriter
from limb_nodes.foundation.topics import LATCHED_TOPICS, TOPIC_TYPES
from limb_nodes.model.points import point_names, points
from limb_nodes.solve.outputs import MUSCLE_FIELDS, SARCOMERE_FIELDS, UNIT_FIELDS
from limb_nodes.solve.whole import Movement, WholeModel


def write_movement(
    path: str | Path, model: WholeModel, movement: Movement, rate: float, run_info: Mapping[str, Any]
) -> None:
    """Write every instant of a movement on every topic of a run; slopes of the torque are left empty.

    Raises UserError where the folder exists or cannot be made.
    """
    limb = model.limb
    count = len(movement.time)
    tick = np.arange(count, dtype=np.uint64)
    stamps = np.arange(count, dtype=np.int64) * round(1e9 / rate)
    last = np.full(count, count - 1)
    joints, muscles = limb.joint_names, limb.muscle_names
    owners = [muscle.name for muscle in limb.muscles for _ in muscle.units]
    units = [unit.name for muscle in limb.muscles for unit in muscle.units]
    torque = np.zeros((count, len(joints)))
    for index, muscle in enumerate(limb.muscles):
        torque[:, muscle.joint] += movement.muscle["muscle_torque"][:, index]
    position = np.zeros((count, len(point_names(limb)), 3))
    position[:, :, :2] = [points(limb, angle) for angle in movement.angle]
    empty = np.empty((count, 0))
    with BagWriter(path, run_info, latched=LATCHED_TOPICS) as writer:
        write_table(
            writer,
            "activation",
            TOPIC_TYPES["activation"],
            stamps,
            {"name": muscles},
            {"tick": tick, "last_tick": last, "activation": movement.excitation},
        )
        write_table(
            writer,
            "joint_states",
            TOPIC_TYPES["joint_states"],
            stamps,
            {"name": joints},
            {"position": movement.angle, "velocity": movement.velocity, "effort": empty},
        )
        write_table(
            writer,
            "joint_torque",
            TOPIC_TYPES["joint_torque"],
            stamps,
            {"joint": joints},
            {"tick": tick, "last_tick": last, "torque": torque},
        )
        write_table(
            writer,
            "movement_pattern",
            TOPIC_TYPES["movement_pattern"],
            stamps,
            {"joint": joints, "point": point_names(limb)},
            {
                "tick": tick,
                "angle": movement.angle,
                "velocity": movement.velocity,
                "acceleration": movement.acceleration,
                "position": position,
            },
        )
        if not muscles:
            return
        for topic, names, fields, values in (
            ("muscle_state", {"name": muscles}, MUSCLE_FIELDS, movement.muscle),
            ("motor_unit_state", {"muscle": owners, "unit": units}, UNIT_FIELDS, movement.unit),
            ("sarcomere_state", {"muscle": owners, "unit": units}, SARCOMERE_FIELDS, movement.unit),
        ):
            numbers = {field: values[name] for field, name in fields.items()}
            write_table(writer, topic, TOPIC_TYPES[topic], stamps, names, {"tick": tick, **numbers})
