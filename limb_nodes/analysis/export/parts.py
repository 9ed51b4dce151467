"""The columns that the topics of a bag give, and how their values are computed."""

from __future__ import annotations

import fnmatch
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from limb_nodes.analysis.export.quantities import (
    QUANTITIES,
    Column,
    Quantity,
    base,
    names_of,
    naming,
    values_of,
)
from limb_nodes.bags.columns import Columns
from limb_nodes.errors import FieldError, UserError
from limb_nodes.foundation.arrays import FloatArray

Fields = dict[str, Columns]
"""Topic -> its fields."""


@dataclass(frozen=True)
class Part:
    """Columns that are computed together.

    needs: the topics that hold what is needed. values: fields of the topics -> [rows, columns]. energetic: whether
    these are powers, behind which the works belong.
    """

    columns: tuple[Column, ...]
    needs: tuple[str, ...]
    values: Callable[[Fields], FloatArray]
    energetic: bool = False


def parts_of(source: str, types: dict[str, str], first: Fields) -> list[Part]:
    """All parts that topics give, their columns with different names.

    source: the bag. types: topic, in the order of the columns -> type. first: the fields of one row.

    Raises UserError if a message is not as its type has it, or holds a name twice.
    """
    parts = [
        part
        for topic, kind in types.items()
        for quantity in QUANTITIES[kind]
        if (part := _direct(source, topic, quantity, first[topic])) is not None
    ]
    parts += _joint_power(types, first)
    parts += [_muscle_power(topic, first[topic]) for topic, kind in types.items() if kind.endswith("/MuscleState")]
    taken: set[str] = set()
    return [replace(part, columns=tuple(_unlike(source, column, taken) for column in part.columns)) for part in parts]


def chosen_parts(source: str, parts: list[Part], patterns: tuple[str, ...]) -> list[tuple[Part, list[int]]]:
    """The parts of which a pattern matches columns, and the places of these columns; all without patterns.

    A pattern is as of a shell, for the name or for the name with its unit.

    Raises FieldError `columns` if a pattern matches none.
    """
    if not patterns:
        return [(part, list(range(len(part.columns)))) for part in parts]
    for pattern in patterns:
        if not any(_matches(column, pattern) for part in parts for column in part.columns):
            names = ", ".join(column.name for part in parts for column in part.columns)
            raise FieldError("columns", f"is {pattern}; a name or a pattern of {names} is needed", source)
    chosen = [
        (part, [i for i, column in enumerate(part.columns) if any(_matches(column, pattern) for pattern in patterns)])
        for part in parts
    ]
    return [(part, places) for part, places in chosen if places]


def in_degrees(columns: list[Column]) -> tuple[list[Column], FloatArray]:
    """Columns with angles in degrees, and the factor [columns] that makes them so."""
    turned = [column.unit.split("/")[0] == "rad" for column in columns]
    return [
        replace(column, unit=f"deg{column.unit[3:]}") if turn else column
        for column, turn in zip(columns, turned, strict=True)
    ], np.where(turned, math.degrees(1.0), 1.0)


def _direct(source: str, topic: str, quantity: Quantity, fields: Columns) -> Part | None:
    """The columns of one quantity; None if the messages leave its values out."""
    missing = [name for name in (quantity.field, *naming(fields, quantity)) if name not in fields]
    if missing:
        raise UserError(f"{source}: topic {topic} has no field {missing[0]}; a bag that limb wrote is needed")
    names, width = names_of(fields, quantity), values_of(fields, quantity).shape[1]
    if not width:
        return None
    if len(names) != width:
        raise UserError(
            f"{source}: topic {topic}: {len(names)} names and {width} values of {quantity.field}; one each is needed"
        )
    columns = tuple(Column(_joined(name, quantity.suffix), quantity.unit, topic) for name in names)
    return Part(columns, (topic,), partial(_of_topic, topic, quantity))


def _joint_power(types: dict[str, str], first: Fields) -> Iterator[Part]:
    """Torque times velocity, of the joints of which both are known."""
    torques = [topic for topic, kind in types.items() if kind.endswith("/JointTorque")]
    movements = {
        topic: "joint" if kind.endswith("/MovementPattern") else "name"
        for topic, kind in types.items()
        if kind.endswith(("/MovementPattern", "/JointState")) and first[topic]["velocity"].size
    }
    for topic in torques:
        movement = next((other for other in movements if _prefix(other) == _prefix(topic)), None)
        if movement is None:
            continue
        moving, turned = list(first[movement][movements[movement]]), list(first[topic]["joint"])
        joints = [name for name in turned if name in moving]
        of_torque, of_velocity = [turned.index(name) for name in joints], [moving.index(name) for name in joints]
        yield Part(
            _energies(joints, topic),
            (topic, movement),
            partial(_product, (topic, "torque", of_torque), (movement, "velocity", of_velocity)),
            energetic=True,
        )


def _muscle_power(topic: str, fields: Columns) -> Part:
    """Force along the tendon times the shortening velocity of the muscle-tendon unit."""
    every = list(range(len(fields["name"])))
    factors = (topic, "muscle_force", every), (topic, "muscle_tendon_velocity", every)
    return Part(_energies(list(fields["name"]), topic), (topic,), partial(_product, *factors), energetic=True)


def _energies(names: list[str], topic: str) -> tuple[Column, ...]:
    """The columns of powers, then those of works."""
    return tuple(
        Column(_joined(str(name), what), unit, topic)
        for what, unit in (("power", "W"), ("work", "J"))
        for name in names
    )


def _of_topic(topic: str, quantity: Quantity, fields: Fields) -> FloatArray:
    return values_of(fields[topic], quantity)


def _product(one: tuple[str, str, list[int]], other: tuple[str, str, list[int]], fields: Fields) -> FloatArray:
    first, second = (fields[topic][field][:, places] for topic, field, places in (one, other))
    product: FloatArray = first * second
    return product


def _prefix(topic: str) -> str:
    return topic.rpartition("/")[0]


def _joined(name: str, suffix: str) -> str:
    return f"{name}_{suffix}" if suffix else name


def _unlike(source: str, column: Column, taken: set[str]) -> Column:
    """The column with a name that is not taken: the topic's name, then all of it, stands behind the later of two."""
    endings = ("", base(column.topic), column.topic.strip("/").replace("/", "_"))
    names = [_joined(column.name, ending) for ending in endings]
    free = next((name for name in names if name not in taken), None)
    if free is None:
        raise UserError(f"{source}: topic {column.topic} holds {column.name} twice; different names are needed")
    taken.add(free)
    return replace(column, name=free)


def _matches(column: Column, pattern: str) -> bool:
    return pattern == column.titled() or fnmatch.fnmatchcase(column.name, pattern)
