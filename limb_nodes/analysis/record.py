"""Write a solved movement as a bag with the topics of a run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from limb_nodes.analysis.trajectory import joint_torque
from limb_nodes.bags.bulk import write_table
from limb_nodes.bags.types import make_message
from limb_nodes.bags.write import BagWriter
from limb_nodes.foundation.topics import LATCHED_TOPICS, TOPIC_TYPES
from limb_nodes.model import Limb
from limb_nodes.model.points import point_names, points
from limb_nodes.solve.outputs import MUSCLE_FIELDS, SARCOMERE_FIELDS, UNIT_FIELDS
from limb_nodes.solve.ranges import LEFT, OUT_OF_RANGE, Ranges
from limb_nodes.solve.whole import Movement

# Bytes that wait for the writer while the solve goes on.
MOST_WAITING = 2**22
# Level of a report that something is not as it should be.
WARN = 1


class Topic(NamedTuple):
    """What a topic holds at every instant: names by field [entries], numbers by field [T, ...]."""

    name: str
    names: Mapping[str, Sequence[str]]
    numbers: Mapping[str, NDArray[Any]]


class MovementBag:
    """A bag that is being written of the parts of a movement; a context manager, as `BagWriter`, and closed likewise.

    count: of all instants of the movement. rate: of the instants, Hz. ranges: looks at the parts; what it has seen
    when the bag is closed is told on `/diagnostics`, as in a run.
    Raises UserError if the folder exists or cannot be made.
    """

    def __init__(
        self, path: str | Path, limb: Limb, count: int, rate: float, run_info: Mapping[str, Any], ranges: Ranges
    ) -> None:
        self._limb, self._count, self._period, self._ranges = limb, count, round(1e9 / rate), ranges
        self._done = 0
        self._writer = BagWriter(path, run_info, latched=LATCHED_TOPICS, most_waiting=MOST_WAITING)

    def write(self, part: Movement) -> None:
        """Write every instant of the next part on every topic of a run; slopes of the torque are left empty.

        Raises RunError if it cannot be written.
        """
        tick = np.arange(self._done, self._done + len(part.time), dtype=np.uint64)
        self._done += len(tick)
        stamps = tick.astype(np.int64) * self._period
        for topic in (*movement_topics(self._limb, part, tick, self._count - 1), *state_topics(self._limb, part, tick)):
            write_table(self._writer, topic.name, TOPIC_TYPES[topic.name], stamps, topic.names, topic.numbers)

    def __enter__(self) -> MovementBag:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._tell_ranges()
        self._writer.__exit__(kind, error, trace)

    def _tell_ranges(self) -> None:
        """Write which lengths of muscles have left their range, if any."""
        if not (told := self._ranges.told()):
            return
        values = [
            make_message("diagnostic_msgs/msg/KeyValue", key=OUT_OF_RANGE + length, value=words)
            for length, words in told.items()
        ]
        status = make_message(
            "diagnostic_msgs/msg/DiagnosticStatus", level=WARN, name="limb_simulate", message=LEFT, values=values
        )
        now = max(0, self._done - 1) * self._period
        self._writer.write("/diagnostics", now, make_message(TOPIC_TYPES["/diagnostics"], now, status=[status]))


def movement_topics(limb: Limb, movement: Movement, tick: NDArray[np.uint64], last_tick: int) -> list[Topic]:
    """What goes between the nodes, and the movement pattern, at ticks [T]."""
    count = len(tick)
    last = np.full(count, last_tick)
    joints, muscles, names = limb.joint_names, limb.muscle_names, point_names(limb)
    torque = joint_torque(limb, movement)
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


def state_topics(limb: Limb, movement: Movement, tick: NDArray[np.uint64]) -> list[Topic]:
    """The states of muscles, motor units and sarcomeres at ticks [T]; none of a limb without muscles."""
    if not limb.muscles:
        return []
    owners = [muscle.name for muscle in limb.muscles for _ in muscle.units]
    of_torques = dict(zip(("torque_muscle", "torque_joint"), limb.crossing_names, strict=True))
    units = {"muscle": owners, "unit": [unit.name for muscle in limb.muscles for unit in muscle.units]}
    return [
        Topic(name, names, {"tick": tick, **{field: values[output] for field, output in fields.items()}})
        for name, names, fields, values in (
            ("muscle_state", {"name": limb.muscle_names, **of_torques}, MUSCLE_FIELDS, movement.muscle),
            ("motor_unit_state", units, UNIT_FIELDS, movement.unit),
            ("sarcomere_state", units, SARCOMERE_FIELDS, movement.unit),
        )
    ]
