"""How the messages of a run look: all of a topic are the same bytes but for their time and their numbers.

Building a message object and turning it into bytes, or back, costs several times what the transport does; here the
bytes are made once, and afterwards only the numbers in them are written or read.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from limb_nodes.bags.columns import MessageLayout
from limb_nodes.bags.types import limb_typestore, make_message
from limb_nodes.exchange.identity import BYTES, LENGTH, bytes_of
from limb_nodes.foundation.topics import TOPIC_TYPES
from limb_nodes.model import Limb
from limb_nodes.model.layout import build_layout
from limb_nodes.model.points import point_names
from limb_nodes.solve.delay import DelayLine, delays_of
from limb_nodes.solve.fits import OTHER_FORM, OTHER_NUMBERS, fits
from limb_nodes.solve.outputs import MUSCLE_FIELDS, SARCOMERE_FIELDS, UNIT_FIELDS

DOUBLE, TICK = np.dtype("<f8"), struct.Struct("<q")
# Stands in an example where messages have the identity of their run.
NOBODY = "0" * LENGTH
# The frame of the limb's base, the root of its URDF.
BASE = "base"


class Form:
    """The messages of a topic of one limb.

    data: an example, in CDR. numbers: field -> its place, type and shape, of fields that hold numbers. run: where the
    identity of the run stands, as `bytes_of` gives it; nowhere in messages of a type that has no field for it.
    """

    def __init__(self, topic: str, fields: Mapping[str, Any], *, frame: str = "", share: bool = False) -> None:
        """frame: of the header. share: its numbers are from 0 to 1."""
        self.topic, self.type = topic, TOPIC_TYPES[topic]
        message = make_message(self.type, 0, **fields)
        message.header.frame_id = frame
        if hasattr(message, "run"):
            message.run = NOBODY
        data = bytes(limb_typestore().serialize_cdr(message, self.type))
        start = data.find(bytes_of(NOBODY))
        self.run = slice(start, start + BYTES) if start >= 0 else slice(0, 0)
        layout = MessageLayout(data, limb_typestore())
        layout.message(self.type, "")
        # What may follow is no part of the message, and readers of bags refuse it.
        self.data = data[: layout.end]
        self.numbers = {
            name: (start, dtype, shape, int(np.prod(shape, dtype=np.int64)))
            for name, (start, dtype, shape) in layout.numbers.items()
        }
        # Whoever receives a message has looked at its identity.
        constant = [np.setdiff1d(np.arange(a, b), np.arange(self.run.start, self.run.stop)) for a, b in layout.constant]
        doubles = [start + 8 * np.arange(count) for start, dtype, _, count in self.numbers.values() if dtype == DOUBLE]
        self._example = np.frombuffer(self.data, dtype=np.uint8)
        self._constant, self._doubles = (np.concatenate([np.empty(0, np.int64), *all_]) for all_ in (constant, doubles))
        self._share = share
        self._tick_at, self._last_at = (
            self.numbers[name][0] if name in self.numbers else None for name in ("tick", "last_tick")
        )

    def check(self, data: bytes) -> None:
        """Raise ValueError if a message does not look like these, or holds numbers that it may not."""
        told = fits(np.frombuffer(data, np.uint8), self._example, self._constant, self._doubles, self._share)
        if told == OTHER_FORM:
            raise ValueError(f"is no {self.type} with the names and the numbers of values of this limb")
        if told == OTHER_NUMBERS:
            raise ValueError(f"has other values than {'numbers from 0 to 1' if self._share else 'finite numbers'}")

    def tick_of(self, data: bytes, otherwise: int) -> int:
        """The tick that a message tells beside its stamp, if those of its topic do."""
        return otherwise if self._tick_at is None else int(TICK.unpack_from(data, self._tick_at)[0])

    def ends_before(self, data: bytes, tick: int) -> bool:
        """Whether a message tells a last tick of the run that has been before."""
        return self._last_at is not None and -1 != TICK.unpack_from(data, self._last_at)[0] < tick

    def values(self, data: bytes, name: str) -> np.ndarray:
        """A field of a message, as an array that must not be kept."""
        start, dtype, shape, count = self.numbers[name]
        return np.frombuffer(data, dtype=dtype, count=count, offset=start).reshape(shape)

    def number(self, data: bytes, name: str) -> int:
        """A field that holds one whole number."""
        return int(self.values(data, name))


def forms_of(limb: Limb, rate: float) -> dict[str, Form]:
    """The forms of all topics of a run of a limb, by topic. rate: ticks per second (Hz)."""
    joints, muscles, points = limb.joint_names, limb.muscle_names, point_names(limb)
    of_unit = {
        "muscle": [muscle.name for muscle in limb.muscles for _ in muscle.units],
        "unit": [unit.name for muscle in limb.muscles for unit in muscle.units],
    }
    torque = {
        "joint": joints,
        **zeros(["torque", "slope_time"], len(joints)),
        **zeros(["slope_angle", "slope_velocity"], len(joints) ** 2),
    }
    units, layout = len(of_unit["unit"]), build_layout(limb)
    remembered = layout.states + layout.scratch + 2 * (layout.joints + layout.drives) + 1
    remembered += DelayLine(delays_of(limb, rate)).remembered.size
    corner = make_message("geometry_msgs/msg/Point")
    fields: dict[str, dict[str, Any]] = {
        "activation": {"name": muscles, **zeros(["activation"], len(muscles))},
        "limb_state": {"joint": joints, **zeros(["angle", "velocity"], len(joints))},
        "joint_torque": torque,
        "limb_impact": {"joint": joints, **zeros(["angle", "velocity_before", "velocity_after"], len(joints))},
        "impact_torque": {**torque, "last_tick": -1},
        "movement_pattern": {
            "joint": joints,
            "point": points,
            **zeros(["angle", "velocity", "acceleration", "torque", "command"], len(joints)),
            "load": [0.0] * 3,
            "position": [corner] * len(points),
        },
        "muscle_state": {
            "name": muscles,
            **zeros(MUSCLE_FIELDS, len(muscles)),
            "torque_muscle": limb.crossing_names[0],
            "torque_joint": limb.crossing_names[1],
            **zeros(["torque"], len(limb.crossings)),
        },
        "motor_unit_state": {**of_unit, **zeros(UNIT_FIELDS, units)},
        "sarcomere_state": {**of_unit, **zeros(SARCOMERE_FIELDS, units)},
        "muscle_checkpoint": {"state": [0.0] * remembered},
        "limb_checkpoint": {"state": [0.0] * (4 * layout.joints + 4)},
    }
    frames = {"movement_pattern": BASE}
    return {
        topic: Form(topic, names, frame=frames.get(topic, ""), share=topic == "activation")
        for topic, names in fields.items()
    }


def joint_states_form(limb: Limb, prefix: str = "") -> Form:
    """The form of joint_states, which every tool of ROS knows; prefix: of the names of frames."""
    names = limb.joint_names
    fields = {"name": names, **zeros(["position", "velocity", "effort"], len(names))}
    return Form("joint_states", fields, frame=f"{prefix}{BASE}")


def zeros(fields: Sequence[str] | Mapping[str, Any], count: int) -> dict[str, list[float]]:
    """Fields with so many numbers each."""
    return {field: [0.0] * count for field in fields}
