"""What the messages of a limb hold, as columns with a name and a unit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from limb_nodes.bags.columns import Columns
from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.foundation.topics import TOPIC_TYPES


@dataclass(frozen=True)
class Quantity:
    """A field of a message with one value for each name.

    field: of the message. suffix: what follows the name, empty for activations and angles. unit: of SI; empty for none.
    of: the fields that hold the names. part: which number of each value, if a value is a point. apart: the field that
    tells names apart that are the same.
    """

    field: str
    suffix: str
    unit: str
    of: tuple[str, ...] = ("name",)
    part: int | None = None
    apart: str = ""


_UNIT = ("muscle", "unit")
QUANTITIES: dict[str, tuple[Quantity, ...]] = {
    "limb_msgs/msg/MuscleActivation": (Quantity("activation", "", ""),),
    "limb_msgs/msg/EmgEnvelope": (Quantity("envelope", "", ""),),
    "limb_msgs/msg/MovementPattern": (
        Quantity("angle", "", "rad", ("joint",)),
        Quantity("velocity", "velocity", "rad/s", ("joint",)),
        Quantity("acceleration", "acceleration", "rad/s^2", ("joint",)),
        Quantity("position", "x", "m", ("point",), 0),
        Quantity("position", "y", "m", ("point",), 1),
    ),
    "sensor_msgs/msg/JointState": (
        Quantity("position", "", "rad"),
        Quantity("velocity", "velocity", "rad/s"),
        Quantity("effort", "effort", "N m"),
    ),
    "limb_msgs/msg/JointTorque": (Quantity("torque", "torque", "N m", ("joint",)),),
    "limb_msgs/msg/MuscleState": (
        *(
            Quantity(f"{part}_{what}", f"{part}_{what}", unit)
            for part in ("muscle_tendon", "muscle", "tendon", "aponeurosis", "fibre")
            for what, unit in (("length", "m"), ("velocity", "m/s"))
        ),
        Quantity("pennation_angle", "pennation_angle", "rad"),
        Quantity("fibre_force", "fibre_force", "N"),
        Quantity("muscle_force", "muscle_force", "N"),
        Quantity("torque", "torque", "N m", ("torque_muscle",), apart="torque_joint"),
    ),
    "limb_msgs/msg/MotorUnitState": (
        Quantity("stimulation_frequency", "stimulation_frequency", "Hz", _UNIT),
        Quantity("force_frequency_factor", "force_frequency_factor", "", _UNIT),
        Quantity("force_length_factor", "force_length_factor", "", _UNIT),
        Quantity("passive_force", "passive_force", "N", _UNIT),
        Quantity("force", "force", "N", _UNIT),
    ),
    "limb_msgs/msg/SarcomereState": (
        Quantity("length", "sarcomere_length", "m", _UNIT),
        Quantity("velocity", "sarcomere_velocity", "m/s", _UNIT),
        Quantity("force", "sarcomere_force", "N", _UNIT),
    ),
}
"""Type of message -> its quantities."""

# The first of two columns with the same name keeps it: of a run, what was simulated.
ORDER = ("activation", "emg_envelope", "movement_pattern", "joint_states", "reference_angle", "joint_torque")
UNASKED = ("motor_unit_state", "sarcomere_state")
"""Topics with many columns, which are exported only if they are asked for."""


@dataclass(frozen=True)
class Column:
    """A column of the table: its name, its unit (empty for none), and the topic that it is made of."""

    name: str
    unit: str
    topic: str

    def titled(self) -> str:
        """The name with the unit behind it: `knee_torque [N m]`."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name


def in_order(topics: Sequence[str]) -> list[str]:
    """Absolute names of topics in the order of their columns: the order of a limb's chain, others behind by name."""
    known = (*ORDER, *TOPIC_TYPES)
    ranks = {topic: known.index(name) if (name := base(topic)) in known else len(known) for topic in topics}
    return sorted(topics, key=lambda topic: (ranks[topic], topic))


def base(topic: str) -> str:
    """The last part of a topic's name."""
    return topic.rpartition("/")[2]


def naming(fields: Columns, quantity: Quantity) -> tuple[str, ...]:
    """The fields that hold the names of a quantity; in bags of former versions each torque is that of a muscle."""
    return ("name",) if quantity.apart and not len(fields.get(quantity.apart, ())) else quantity.of


def names_of(fields: Columns, quantity: Quantity) -> list[str]:
    """What the values of a quantity belong to; a motor unit is named after its muscle and itself."""
    of = naming(fields, quantity)
    names = ["_".join(map(str, parts)) for parts in zip(*(fields[key] for key in of), strict=True)]
    if not quantity.apart or of != quantity.of or len(set(names)) == len(names):
        return names
    apart = fields[quantity.apart]
    return [f"{name}_{apart[place]}" if names.count(name) > 1 else name for place, name in enumerate(names)]


def values_of(fields: Columns, quantity: Quantity) -> FloatArray:
    """The values [times, names] of a quantity; [times, 0] if the messages leave them out."""
    values = fields[quantity.field] if quantity.part is None else fields[quantity.field][:, :, quantity.part]
    return values.astype(np.float64)
