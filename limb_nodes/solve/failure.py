"""Why a solve could not go on, and which part of the limb is to blame."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from limb_nodes.errors import RunError
from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.foundation.records import Record
from limb_nodes.model.chosen import ChosenLaw
from limb_nodes.model.kinds import MuscleKind, UnitKind
from limb_nodes.model.probe import BrokenLaw, Step, value_of
from limb_nodes.model.system import BoundEquation
from limb_nodes.solve.integrate import NOT_FINITE, STEP_TOO_SMALL, TOO_MANY_STEPS

if TYPE_CHECKING:
    from limb_nodes.solve.whole import WholeModel

FAILURES = {
    TOO_MANY_STEPS: "it needs too many steps",
    STEP_TOO_SMALL: "the step became too small",
    NOT_FINITE: "a rate is not a finite number",
}
# So far (s) behind the last good state the first bad one is looked for.
AHEAD = (0.0, *(10.0**power for power in range(-15, -3)))
# Motor units that are alike, of which so many are named.
MOST_NAMED = 3


class SolveError(RunError):
    """The equations could not be solved further; says when, where and why."""


def where(model: WholeModel, status: int, t: float, state: FloatArray, inputs: FloatArray, data: Record) -> str:
    """The part of a limb that stops a solve, to stand behind the reason; "" if it is not known.

    t, state: where the solve stops (s, [states]). inputs, data: its own there.
    """
    rates, bad, good = np.empty(state.size), np.empty(state.size), data.scratch.copy()
    records = model.layout.model.address, data.address
    model.program.rates(t, state, inputs, *records, rates)
    if status != NOT_FINITE:
        fastest = int(np.argmax(np.abs(rates) / np.maximum(model.state_scale, np.abs(state))))
        return f"; {_state_name(model, fastest)} changes fastest, by {rates[fastest]:.4g} per s"
    if np.isfinite(rates).all():
        good = data.scratch.copy()
    else:
        rates[:] = 0.0
    for ahead in AHEAD:
        moved = state + ahead * rates
        model.program.rates(t + ahead, moved, inputs, *records, bad)
        if not np.isfinite(bad).all():
            break
    else:
        return ""
    if fault := fault_of(model, moved, data, good):
        return f": {fault}"
    return f": that of {_state_name(model, int(np.flatnonzero(~np.isfinite(bad))[0]))}"


def fault_of(model: WholeModel, state: FloatArray, data: Record, good: FloatArray) -> str:
    """In words, the first thing of a muscle or its units that is not finite in a state; "" if there is none.

    good: scratch numbers before it was.
    """
    for number in range(model.layout.muscles):
        for fault in _faults(model, number, state, data, good):
            return fault
    return ""


def _state_name(model: WholeModel, index: int) -> str:
    joints = model.limb.joint_names
    names = [f"{joint} {what}" for what in ("angle", "velocity") for joint in joints]
    return (*names, *model.layout.state_names)[index]


class Part(NamedTuple):
    """A muscle or a group of alike motor units: its name, its laws by process, and its numbers by symbol."""

    name: str
    laws: Mapping[str, ChosenLaw]
    values: dict[str, float]

    def said(self, bound: BoundEquation) -> str:
        """That what an equation defines is not finite."""
        value, values = self.values[bound.defines], self.values
        chosen = self.laws.get(bound.process)
        by = f"equation {bound.equation.number}"
        if chosen is not None:
            by = f"law {chosen.module + ':' if chosen.module else ''}{chosen.law.name} of {bound.process}"
        at = ", ".join(f"{name} {values[name]:.6g}" for name in bound.symbols if "__" not in name and name in values)
        return f"{self.name}, {by}: {bound.defines} is {value:g}" + (f" at {at}" if at else "")

    def walk(self, equations: Iterable[BoundEquation]) -> Iterator[str]:
        """Evaluate equations in their order; what is not finite although all that it uses is."""
        for bound in equations:
            given = [self.values.get(symbol, math.nan) for symbol in bound.symbols]
            try:
                value = value_of(Step(bound.equation, bound.symbols), self.values) if np.isfinite(given).all() else None
            except BrokenLaw:
                value = math.nan
            self.values[bound.defines] = math.nan if value is None else value
            if value is not None and not math.isfinite(value):
                yield self.said(bound)


def _faults(model: WholeModel, number: int, state: FloatArray, data: Record, good: FloatArray) -> Iterator[str]:
    """What of a muscle and its units is not finite, in the order of evaluation. good: scratch numbers before it was."""
    layout, n, muscle = model.layout, model.layout.joints, model.limb.muscles[number]
    own, internal = layout.model.muscles[number], state[2 * n :]
    kind = layout.muscle_kinds[own.kind]
    part = Part(f"muscle {muscle.name}", muscle.laws, _given(model, kind, own, internal, data))
    for one, joint in zip(kind.crossings, muscle.joints, strict=True):
        part.values[f"joint_angle{one}"], part.values[f"joint_velocity{one}"] = state[joint], state[n + joint]
    part.values["total_fibre_force"] = float(good[own.scratch])
    yield from _drives(part, kind)
    yield from part.walk(kind.stages["before"])
    faults = list(part.walk(kind.stages["loop"]))
    units = [unit for one in model.limb.muscles for unit in one.units]
    for index in range(own.group, own.group_end):
        group = layout.model.groups[index]
        members = [unit for unit, row in zip(units, layout.model.units, strict=True) if row.group == index]
        names = ", ".join(unit.name for unit in members[:MOST_NAMED]) + ", ..." * (len(members) > MOST_NAMED)
        unit_kind = layout.unit_kinds[group.kind]
        fibres = Part(f"{part.name}, unit {names}", members[0].laws, _given(model, unit_kind, group, internal, data))
        for name in ("activation", "fibre_length", "fibre_velocity"):
            fibres.values[name] = part.values.get(name, math.nan)
        yield from _drives(fibres, unit_kind)
        yield from fibres.walk(unit_kind.stages["before"] + unit_kind.stages["loop"])
    yield from faults
    yield from part.walk(kind.stages["after"])


def _given(
    model: WholeModel, kind: MuscleKind | UnitKind, own: Any, internal: FloatArray, data: Record
) -> dict[str, float]:
    """Parameters, drives and states of a muscle or a group of units, by symbol."""
    rows = (kind.columns, model.layout.model.parameters, own.parameters), (kind.drives, data.drives, own.drive)
    values = {name: float(array[start + i]) for names, array, start in rows for i, name in enumerate(names)}
    return values | {state.name: float(internal[own.state + i]) for i, (state, _) in enumerate(kind.system.states)}


def _drives(part: Part, kind: MuscleKind | UnitKind) -> Iterator[str]:
    """What the input becomes, if it is not finite."""
    for bound in kind.stages["drive"]:
        if not math.isfinite(part.values.get(bound.defines, 0.0)):
            yield part.said(bound)
