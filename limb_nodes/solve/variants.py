"""The limb of a sample: one limb's program with other numbers.

Building a limb anew from its content takes as long as solving some of its seconds. Where a place
such as ``muscles[0].tendon.stiffness`` only puts its number into one place, that place is looked up once, by
building the limb with two values of it; from then on the number goes there directly.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from threading import Lock
from typing import Any, NamedTuple

import numpy as np

from limb_nodes.errors import UserError
from limb_nodes.foundation.arrays import IntArray
from limb_nodes.foundation.parameter import Parameter
from limb_nodes.levels import motor_unit, sarcomere
from limb_nodes.model.check import check_geometry
from limb_nodes.model.chosen import ChosenLaw
from limb_nodes.model.kinds import MuscleKind, UnitKind
from limb_nodes.model.layout import Layout, build_layout, same_structure
from limb_nodes.model.limb import Limb, MotorUnit, Muscle
from limb_nodes.model.load import BASE_ANGLE, SEGMENT_PARAMETERS, TIP_TORQUE, with_values
from limb_nodes.solve.whole import WholeModel

Values = Mapping[str, Any]
LIMB_PARAMETERS = {parameter.name: parameter for parameter in (BASE_ANGLE, TIP_TORQUE)}
UNIT_PARAMETERS = {parameter.name: parameter for parameter in motor_unit.PARAMETERS}
# Numbers that a limb's checks compare with others of the same unit.
COMPARED = {"minimum_frequency", "maximum_frequency", "myosin_length", "actin_length"}
# A program is compiled by one thread at a time.
BUILDING = Lock()
# Numbers of a unit on which the check of a muscle's lengths depends.
LENGTHS = {"series_sarcomeres"}


class Slot(NamedTuple):
    """Where a number of a limb is kept; -1 and "" if an owner has no such index or process."""

    kind: str
    owner: int
    unit: int
    process: str
    name: str


def numbers(limb: Limb) -> Iterator[tuple[Slot, float, Parameter | None]]:
    """Every number of a limb that a place can change, with what declares its range."""
    for name, parameter in LIMB_PARAMETERS.items():
        yield Slot("limb", -1, -1, "", name), getattr(limb, name), parameter
    for index, segment in enumerate(limb.segments):
        for parameter in SEGMENT_PARAMETERS:
            yield Slot("segment", index, -1, "", parameter.name), getattr(segment, parameter.name), parameter
    for m, muscle in enumerate(limb.muscles):
        yield Slot("muscle", m, -1, "", "activation_threshold"), muscle.activation_threshold, None
        yield from law_numbers("law", m, -1, muscle.laws)
        for u, unit in enumerate(muscle.units):
            for name, value in unit.values.items():
                yield Slot("unit", m, u, "", name), value, UNIT_PARAMETERS.get(name)
            yield from law_numbers("unit_law", m, u, unit.laws)


def law_numbers(
    kind: str, owner: int, unit: int, laws: dict[str, ChosenLaw]
) -> Iterator[tuple[Slot, float, Parameter | None]]:
    """The numbers of some laws."""
    for process, chosen in laws.items():
        shared = sarcomere.PARAMETERS if process == "sarcomere" else ()
        declared = {parameter.name: parameter for parameter in (*shared, *chosen.law.parameters)}
        for name, value in chosen.values.items():
            yield Slot(kind, owner, unit, process, name), value, declared.get(name)


Slots = list[tuple[Slot, Parameter]]


class Variants:
    """Models of one limb with other numbers. base: the model of the limb itself.

    Its methods may be called from several threads.
    """

    def __init__(self, limb: Limb) -> None:
        self.limb = limb
        self.base = WholeModel(limb)
        self.driving = drive_entries(self.base.layout)
        self._slots: dict[str, Slots | None] = {}

    def model(self, values: Values) -> WholeModel:
        """The model of a sample. Raises UserError, one line, if a value is not allowed."""
        values = {place: value.item() if isinstance(value, np.generic) else value for place, value in values.items()}
        given = [(place, value, self.slots(place, value)) for place, value in values.items()]
        slots = [slot for _, _, direct in given for slot, _ in direct or ()]
        if any(direct is None for _, _, direct in given) or len(set(slots)) < len(slots):
            return self.adopted(with_values(self.limb, values))
        for place, value, direct in given:
            for _, parameter in direct or ():
                if not parameter.accepts(value):
                    raise UserError(f"{self.limb.file}: {place} is {value}; {parameter.allowed()} is needed")
        changes = {slot: float(value) for _, value, direct in given for slot, _ in direct or ()}
        limb = changed(self.limb, changes)
        if any(slot.kind not in ("limb", "segment") for slot in changes):
            return self.adopted(limb)
        return self.base.sibling(self.base.layout.of_limb(limb))

    def adopted(self, limb: Limb) -> WholeModel:
        """The model of a limb, with the program that is there if its structure is the same."""
        layout = build_layout(limb, self.base.layout)
        if same_structure(self.base.layout, layout):
            return self.base.sibling(layout)
        with BUILDING:
            return WholeModel(limb)

    def same_drives(self, model: WholeModel) -> bool:
        """Whether an input does the same to the motor units of a model as to those of the base."""
        if model.program is not self.base.program:
            return False
        if any(one.delay != other.delay for one, other in zip(model.limb.muscles, self.limb.muscles, strict=True)):
            return False
        new, old = model.layout.model.parameters, self.base.layout.model.parameters
        return bool(np.array_equal(new[self.driving], old[self.driving]))

    def slots(self, place: str, value: Any) -> Slots | None:
        """Where the number of a place goes; None if more than that happens to it."""
        if isinstance(value, bool) or not isinstance(value, int | float):
            return None
        if place not in self._slots:
            try:
                self._slots[place] = direct_slots(self.limb, place, float(value))
            except UserError:
                # The full way says what is wrong with this value; the next may do.
                return None
        return self._slots[place]


def direct_slots(limb: Limb, place: str, value: float) -> Slots | None:
    """The slots that hold just the number of a place, or None if others change too."""
    near = value * (1.0 + 1e-7) + (1e-9 if value == 0.0 else 0.0)
    first = {slot: number for slot, number, _ in numbers(with_values(limb, {place: value}))}
    other = {slot: (number, parameter) for slot, number, parameter in numbers(with_values(limb, {place: near}))}
    if first.keys() != other.keys():
        return None
    direct: Slots = []
    for slot, (number, parameter) in other.items():
        if number == first[slot]:
            continue
        if (first[slot], number) != (value, near) or parameter is None or slot.name in COMPARED:
            return None
        direct.append((slot, parameter))
    return direct or None


def changed(limb: Limb, changes: dict[Slot, float]) -> Limb:
    """A limb with other numbers in some slots. Raises UserError if a muscle cannot work so."""
    owned: dict[str, dict[int, list[tuple[Slot, float]]]] = {"limb": {}, "segment": {}, "muscle": {}}
    for slot, value in changes.items():
        kind = "muscle" if slot.kind in ("law", "unit", "unit_law") else slot.kind
        owned[kind].setdefault(slot.owner, []).append((slot, value))
    own: dict[str, Any] = {slot.name: value for pairs in owned["limb"].values() for slot, value in pairs}
    segments = list(limb.segments)
    for index, pairs in owned["segment"].items():
        given: dict[str, Any] = {slot.name: value for slot, value in pairs}
        segment = segments[index] = replace(segments[index], **given)
        span = segment.joint_range
        if span and not span[0] <= segment.angle <= span[1]:
            raise UserError(
                f"{limb.file}: segments[{index}].angle is {segment.angle}; a number within range {list(span)} in rad"
            )
    muscles = list(limb.muscles)
    for index, pairs in owned["muscle"].items():
        muscles[index] = changed_muscle(muscles[index], pairs)
        if any(slot.kind == "law" or slot.name in LENGTHS for slot, _ in pairs):
            check_geometry(limb.file, muscles[index], segments)
    return replace(limb, segments=tuple(segments), muscles=tuple(muscles), **own)


def changed_muscle(muscle: Muscle, changes: list[tuple[Slot, float]]) -> Muscle:
    """A muscle with other numbers in some slots."""
    laws, units = dict(muscle.laws), list(muscle.units)
    for slot, value in changes:
        if slot.kind == "law":
            laws[slot.process] = changed_law(laws[slot.process], slot.name, value)
            continue
        unit = units[slot.unit]
        if slot.kind == "unit":
            units[slot.unit] = MotorUnit(unit.name, {**unit.values, slot.name: value}, unit.laws)
        else:
            new = changed_law(unit.laws[slot.process], slot.name, value)
            units[slot.unit] = MotorUnit(unit.name, unit.values, {**unit.laws, slot.process: new})
    return replace(muscle, laws=laws, units=tuple(units))


def changed_law(chosen: ChosenLaw, name: str, value: float) -> ChosenLaw:
    """A law with another number."""
    return ChosenLaw(chosen.law, {**chosen.values, name: value}, chosen.place, chosen.module)


def drive_entries(layout: Layout) -> IntArray:
    """The entries of the parameters on which `drives` depends."""
    entries: set[int] = set()
    for muscle in layout.model.muscles:
        entries |= driven(layout.muscle_kinds[muscle.kind], muscle.parameters, set())
    for unit in (*layout.model.groups, *layout.model.units):
        entries |= driven(layout.unit_kinds[unit.kind], unit.parameters, {"parallel_sarcomeres"})
    return np.array(sorted(entries), dtype=np.int64)


def driven(kind: MuscleKind | UnitKind, offset: int, more: set[str]) -> set[int]:
    """Entries of one row that its kind's drive stage reads."""
    used = {symbol for bound in kind.stages["drive"] for symbol in bound.symbols} | more
    return {int(offset) + column for column, name in enumerate(kind.columns) if name in used}
