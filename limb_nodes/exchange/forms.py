"""How the messages of a run look: all of a topic are the same bytes but for their time and their numbers.

Building a message object and turning it into bytes, or back, costs several times what the transport does; here the
bytes are made once, and afterwards only the numbers in them are written or read.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from limb_nodes.bags.columns import MessageLayout
from limb_nodes.bags.types import limb_typestore, make_message
from limb_nodes.exchange.identity import LENGTH, TEXT
from limb_nodes.foundation.topics import TOPIC_TYPES
from limb_nodes.model import Limb
from limb_nodes.model.layout import build_layout
from limb_nodes.model.points import point_names
from limb_nodes.solve.outputs import MUSCLE_FIELDS, SARCOMERE_FIELDS, UNIT_FIELDS
from limb_nodes.solve.small import finite, within_unit

# Where the body of a message begins, from which its numbers are aligned.
BODY = 4
NUMBER = np.dtype("<f8")


class Form:
    """The messages of a topic of one limb.

    data: an example, in CDR. numbers: field -> its place, type and shape, of fields that hold numbers.
    """

    def __init__(self, topic: str, fields: Mapping[str, Any], share: bool = False) -> None:
        """share: its numbers are from 0 to 1."""
        self.topic, self.type = topic, TOPIC_TYPES[topic]
        message = make_message(self.type, 0, **fields)
        message.header.frame_id = "0" * LENGTH
        data = bytes(limb_typestore().serialize_cdr(message, self.type))
        layout = MessageLayout(data, limb_typestore())
        layout.message(self.type, "")
        # What may follow is no part of the message, and readers of bags refuse it.
        self.data = data[: layout.end]
        self.numbers = {
            name: (start, dtype, shape, int(np.prod(shape, dtype=np.int64)))
            for name, (start, dtype, shape) in layout.numbers.items()
        }
        # Whoever receives a message has looked at its identity.
        constant = [(a, b) for a, b in layout.constant if (a, b) != (TEXT.start, TEXT.stop)]
        self._constant = [(slice(a, b), self.data[a:b]) for a, b in joined(constant)]
        places = [
            np.arange(count) + (start - BODY) // NUMBER.itemsize
            for start, dtype, _, count in self.numbers.values()
            if dtype == NUMBER
        ]
        self._places = np.concatenate([np.empty(0, dtype=np.int64), *places])
        self._words = (len(self.data) - BODY) // NUMBER.itemsize
        self._good, self._needed = (within_unit, "numbers from 0 to 1") if share else (finite, "finite numbers")

    def check(self, data: bytes) -> None:
        """Raise ValueError if a message does not look like these, or holds numbers that it may not."""
        if len(data) != len(self.data) or any(data[at] != text for at, text in self._constant):
            raise ValueError(f"is no {self.type} with the names and the numbers of values of this limb")
        if not self._good(np.frombuffer(data, NUMBER, self._words, BODY)[self._places]):
            raise ValueError(f"has other values than {self._needed}")

    def values(self, data: bytes, name: str) -> np.ndarray:
        """A field of a message, as an array that must not be kept."""
        start, dtype, shape, count = self.numbers[name]
        return np.frombuffer(data, dtype=dtype, count=count, offset=start).reshape(shape)

    def number(self, data: bytes, name: str) -> int:
        """A field that holds one whole number."""
        return int(self.values(data, name))


def forms_of(limb: Limb) -> dict[str, Form]:
    """The forms of all topics of a run of a limb, by topic."""
    joints, muscles, points = limb.joint_names, limb.muscle_names, point_names(limb)
    of_unit = {
        "muscle": [muscle.name for muscle in limb.muscles for _ in muscle.units],
        "unit": [unit.name for muscle in limb.muscles for unit in muscle.units],
    }
    units, layout = len(of_unit["unit"]), build_layout(limb)
    remembered = layout.states + layout.scratch + 2 * (layout.joints + layout.drives) + 1
    corner = make_message("geometry_msgs/msg/Point")
    fields: dict[str, dict[str, Any]] = {
        "activation": {"name": muscles, **zeros(["activation"], len(muscles))},
        "joint_states": {"name": joints, **zeros(["position", "velocity"], len(joints))},
        "joint_torque": {
            "joint": joints,
            **zeros(["torque", "slope_angle", "slope_velocity", "slope_time"], len(joints)),
        },
        "movement_pattern": {
            "joint": joints,
            "point": points,
            **zeros(["angle", "velocity", "acceleration"], len(joints)),
            "position": [corner] * len(points),
        },
        "muscle_state": {"name": muscles, **zeros(MUSCLE_FIELDS, len(muscles))},
        "motor_unit_state": {**of_unit, **zeros(UNIT_FIELDS, units)},
        "sarcomere_state": {**of_unit, **zeros(SARCOMERE_FIELDS, units)},
        "muscle_checkpoint": {"state": [0.0] * remembered},
        "limb_checkpoint": {"state": [0.0] * (4 * layout.joints + 4)},
    }
    return {topic: Form(topic, names, share=topic == "activation") for topic, names in fields.items()}


def zeros(fields: Sequence[str] | Mapping[str, Any], count: int) -> dict[str, list[float]]:
    """Fields with so many numbers each."""
    return {field: [0.0] * count for field in fields}


def joined(ranges: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Ranges with those that touch made one."""
    result: list[tuple[int, int]] = []
    for start, end in ranges:
        if result and result[-1][1] == start:
            result[-1] = result[-1][0], end
        elif end > start:
            result.append((start, end))
    return result
