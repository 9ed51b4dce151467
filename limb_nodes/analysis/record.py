"""Write a solved movement as a bag with the topics of a run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from limb_nodes.bags.bulk import write_table
from limb_nodes.bags.write import BagWriter
from limb_nodes.foundation.topics import LATCHED_TOPICS, TOPIC_TYPES
from limb_nodes.model import Limb
from limb_nodes.model.points import point_names, points
from limb_nodes.solve.outputs import MUSCLE_FIELDS, SARCOMERE_FIELDS, UNIT_FIELDS
from limb_nodes.solve.whole import Movement, WholeModel


class Topic(NamedTuple):
    """What a topic holds at every instant: names by field [entries], numbers by field [T, ...]."""

    name: str
    names: Mapping[str, Sequence[str]]
    numbers: Mapping[str, NDArray[Any]]


def write_movement(
    path: str | Path, model: WholeModel, movement: Movement, rate: float, run_info: Mapping[str, Any]
) -> None:
    """Write every instant of a movement on every topic of a run; slopes of the torque are left empty.

    rate: of the instants, Hz. Raises UserError if the folder exists or cannot be made.
    """
    stamps = np.arange(len(movement.time), dtype=np.int64) * round(1e9 / rate)
    with BagWriter(path, run_info, latched=LATCHED_TOPICS) as writer:
        for topic in (*movement_topics(model.limb, movement), *state_topics(model.limb, movement)):
            write_table(writer, topic.name, TOPIC_TYPES[topic.name], stamps, topic.names, topic.numbers)


def movement_topics(limb: Limb, movement: Movement) -> list[Topic]:
    """What goes between the nodes, and the movement pattern."""
    count = len(movement.time)
    tick, last = np.arange(count, dtype=np.uint64), np.full(count, count - 1)
    joints, muscles, names = limb.joint_names, limb.muscle_names, point_names(limb)
    torque = np.zeros((count, len(joints)))
    for index, muscle in enumerate(limb.muscles):
        torque[:, muscle.joint] += movement.muscle["muscle_torque"][:, index]
    position = np.zeros((count, len(names), 3))
    position[:, :, :2] = [points(limb, angle) for angle in movement.angle]
    driven = {"tick": tick, "last_tick": last, "activation": movement.excitation}
    states = {"position": movement.angle, "velocity": movement.velocity, "effort": np.empty((count, 0))}
    pattern = {
        "tick": tick,
        "angle": movement.angle,
        "velocity": movement.velocity,
        "acceleration": movement.acceleration,
        "position": position,
    }
    return [
        Topic("activation", {"name": muscles}, driven),
        Topic("joint_states", {"name": joints}, states),
        Topic("joint_torque", {"joint": joints}, {"tick": tick, "last_tick": last, "torque": torque}),
        Topic("movement_pattern", {"joint": joints, "point": names}, pattern),
    ]


def state_topics(limb: Limb, movement: Movement) -> list[Topic]:
    """The states of muscles, motor units and sarcomeres; none of a limb without muscles."""
    if not limb.muscles:
        return []
    tick = np.arange(len(movement.time), dtype=np.uint64)
    owners = [muscle.name for muscle in limb.muscles for _ in muscle.units]
    units = {"muscle": owners, "unit": [unit.name for muscle in limb.muscles for unit in muscle.units]}
    return [
        Topic(name, names, {"tick": tick, **{field: values[output] for field, output in fields.items()}})
        for name, names, fields, values in (
            ("muscle_state", {"name": limb.muscle_names}, MUSCLE_FIELDS, movement.muscle),
            ("motor_unit_state", units, UNIT_FIELDS, movement.unit),
            ("sarcomere_state", units, SARCOMERE_FIELDS, movement.unit),
        )
    ]
