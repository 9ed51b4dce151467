"""Where every number of a limb stands in the flat arrays that compiled code reads.

Motor units of one muscle that differ only in what the activation does to them (threshold,
frequencies, number of fibres) share length and velocity of their sarcomeres, so that 2.25 may be
evaluated once for all of them: such units form a *group*, whose activity is the mean of theirs
weighted by `parallel_sarcomeres`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np

from limb_nodes.foundation.arrays import FloatArray, IntArray
from limb_nodes.levels import Law
from limb_nodes.levels.limb.chain import first_moment, own_inertia
from limb_nodes.model.limb import Limb, MotorUnit, Muscle
from limb_nodes.model.system import BoundEquation, System, muscle_system, unit_system

Kind = TypeVar("Kind")

UNIT_PROCESSES = ("sarcomere", "force_length", "force_frequency", "passive_force", "recruitment")
MUSCLE_PROCESSES = ("path", "tendon", "aponeurosis", "activation_dynamics")

MUSCLE_INDEX = ("kind", "joint", "parameters", "state", "drive", "first", "last", "work")
GROUP_INDEX = ("kind", "parameters", "state", "drive", "work")
UNIT_INDEX = ("kind", "parameters", "group", "muscle")

# So many groups of a muscle get code of their own; more share a loop, which is slower and compiles faster.
MOST_WRITTEN_OUT = 3


@dataclass(frozen=True)
class UnitKind:
    """Motor units with the same laws, and what is computed when.

    Stages: `load` once, `drive` once per input sample, `before` without and `loop` with the fibre
    velocity, `rates` for the states. `columns` are the numbers kept per unit, `drives` those per
    sample, `kept` what the later stages need from `before`.
    """

    laws: Mapping[str, Law]
    steady_activation: bool

    @cached_property
    def system(self) -> System:
        """The unit's equations."""
        return unit_system(self.laws)

    @cached_property
    def stages(self) -> dict[str, list[BoundEquation]]:
        """Equations by stage, each in the order of evaluation."""
        depends = self.system.dependence()
        stages: dict[str, list[BoundEquation]] = {stage: [] for stage in ("load", "drive", "before", "loop")}
        for bound in self.system.ordered():
            roots = depends[bound.defines]
            if not roots:
                stage = "load"
            elif roots == {"activation"} and self.steady_activation:
                stage = "drive"
            elif "fibre_velocity" in roots:
                stage = "loop"
            else:
                stage = "before"
            stages[stage].append(bound)
        return stages

    @cached_property
    def drives(self) -> list[str]:
        """Variables of the drive stage that later stages use."""
        return self.used_later("drive", ("before", "loop"))

    @cached_property
    def kept(self) -> list[str]:
        """Variables and states that the loop stage and the unit's outputs need from before."""
        states = [state.name for state, _ in self.system.states]
        used = {symbol for bound in self.stages["loop"] for symbol in bound.symbols}
        rates = {state.rate for state, _ in self.system.states} | {"fibre_force"}
        before = [bound.defines for bound in self.stages["before"]]
        available = [*before, *states, *self.drives, "fibre_length"]
        return [name for name in available if name in used | rates]

    @cached_property
    def columns(self) -> list[str]:
        """Parameters and computed parameters that compiled code reads."""
        later = [b for stage in ("drive", "before", "loop") for b in self.stages[stage]]
        used = {symbol for bound in later for symbol in bound.symbols}
        loaded = [bound.defines for bound in self.stages["load"]]
        return [name for name in (*self.system.parameters, *loaded) if name in used]

    @property
    def groupable(self) -> bool:
        """Whether activity enters 2.25 alone, so that units may share an evaluation."""
        return self.drives == ["force_frequency_factor"] and not any(
            "force_frequency_factor" in bound.symbols and bound.defines != "fibre_force"
            for bound in self.system.equations
        )

    def used_later(self, stage: str, later: tuple[str, ...]) -> list[str]:
        """Variables of one stage that others use."""
        used = {s for name in later for bound in self.stages[name] for s in bound.symbols}
        return [bound.defines for bound in self.stages[stage] if bound.defines in used]


@dataclass(frozen=True)
class MuscleKind:
    """Muscles with the same laws. Stages as in `UnitKind`; `loop` needs the total fibre force.

    groups: the kinds of its groups of units, by index and in order; none where they are too many to be
        written out one by one.
    """

    laws: Mapping[str, Law]
    groups: tuple[int, ...] = ()

    @cached_property
    def system(self) -> System:
        """The muscle's equations."""
        return muscle_system(self.laws)

    @cached_property
    def steady_activation(self) -> bool:
        """Whether the activation follows from the input alone."""
        return self.system.dependence()["activation"] <= {"excitation"}

    @cached_property
    def closes_loop(self) -> bool:
        """Whether the fibre velocity depends on the force that it is to give."""
        return "total_fibre_force" in self.system.dependence()["fibre_velocity"]

    @cached_property
    def stages(self) -> dict[str, list[BoundEquation]]:
        """Equations by stage, each in the order of evaluation."""
        depends = self.system.dependence()
        chain = self.upstream("fibre_velocity")
        stages: dict[str, list[BoundEquation]] = {stage: [] for stage in ("load", "drive", "before", "loop", "after")}
        for bound in self.system.ordered():
            roots = depends[bound.defines]
            if not roots:
                stage = "load"
            elif roots == {"excitation"}:
                stage = "drive"
            elif "total_fibre_force" not in roots:
                stage = "before"
            elif bound.defines in chain:
                stage = "loop"
            else:
                stage = "after"
            stages[stage].append(bound)
        return stages

    @cached_property
    def drives(self) -> list[str]:
        """What the muscle itself needs per sample beside its units' drives."""
        used = {s for n in ("before", "loop", "after") for b in self.stages[n] for s in b.symbols}
        available = ["excitation", *(bound.defines for bound in self.stages["drive"])]
        return [name for name in available if name in used]

    @cached_property
    def columns(self) -> list[str]:
        """Parameters and computed parameters that compiled code reads."""
        later = [b for n in ("drive", "before", "loop", "after") for b in self.stages[n]]
        used = {symbol for bound in later for symbol in bound.symbols}
        loaded = [bound.defines for bound in self.stages["load"]]
        outputs = {"tendon_length", "tendon_velocity", "pennation_angle", "moment_arm"}
        used |= outputs & set(loaded)
        return [name for name in (*self.system.parameters, *loaded) if name in used]

    def upstream(self, variable: str) -> set[str]:
        """Variables on which one depends, itself included."""
        definitions = {bound.defines: bound for bound in self.system.equations}
        found: set[str] = set()
        waiting = [variable]
        while waiting:
            name = waiting.pop()
            if name not in found and name in definitions:
                found.add(name)
                waiting += definitions[name].symbols
        return found


@dataclass(frozen=True)
class Layout:
    """A limb as flat arrays.

    parameters: float64, first the chain's block, then a row per muscle, group and unit.
    index: int64, one record per muscle (`MUSCLE_INDEX`), group (`GROUP_INDEX`) and unit
        (`UNIT_INDEX`), in this order.
    initial_states: float64 [internal states], initial values of tendons, aponeuroses and laws.
    state_names, state_scales: of the same.
    """

    limb: Limb
    muscle_kinds: tuple[MuscleKind, ...]
    unit_kinds: tuple[UnitKind, ...]
    parameters: FloatArray
    index: IntArray
    initial_states: FloatArray
    state_names: tuple[str, ...]
    state_scales: FloatArray
    joints: int
    muscles: int
    groups: int
    units: int
    drives: int
    work: int

    @property
    def states(self) -> int:
        """Number of internal states."""
        return len(self.state_names)


def chain_block(limb: Limb) -> list[float]:
    """Constants of the chain: base angle, gravity, couplings [n, n], then per segment first
    moment, length, lowest and highest joint angle.
    """
    segments = limb.segments
    count = len(segments)
    distal = [sum(segment.mass for segment in segments[k + 1 :]) for k in range(count)]
    moments = [first_moment(s.mass, s.com_distance, s.length, mass) for s, mass in zip(segments, distal, strict=True)]
    couplings = [
        own_inertia(
            segments[k].inertia,
            segments[k].mass,
            segments[k].com_distance,
            segments[k].length,
            distal[k],
        )
        if k == p
        else segments[min(k, p)].length * moments[max(k, p)]
        for k in range(count)
        for p in range(count)
    ]
    ranges = [segment.joint_range or (-np.inf, np.inf) for segment in segments]
    return [
        limb.base_angle,
        *limb.gravity,
        *couplings,
        *moments,
        *(segment.length for segment in segments),
        *(lowest for lowest, _ in ranges),
        *(highest for _, highest in ranges),
    ]


def evaluate(equations: list[BoundEquation], values: dict[str, float]) -> None:
    """Evaluate equations in order and add what they define to `values`."""
    for bound in equations:
        values[bound.defines] = bound.equation.function(*(values[s] for s in bound.symbols))


def unit_values(unit: MotorUnit, kind: UnitKind) -> dict[str, float]:
    """All given and computed parameters of a unit, by symbol."""
    values = dict(unit.values)
    for process, chosen in unit.laws.items():
        values.update({f"{process}__{name}": value for name, value in chosen.values.items()})
    evaluate(kind.stages["load"], values)
    return values


def muscle_values(muscle: Muscle, kind: MuscleKind) -> dict[str, float]:
    """All given and computed parameters of a muscle, by symbol."""
    values = {"role": muscle.role}
    for process, chosen in muscle.laws.items():
        values.update({f"{process}__{name}": value for name, value in chosen.values.items()})
    evaluate(kind.stages["load"], values)
    return values


SUMMED = ("parallel_sarcomeres", "maximum_passive_force")


def group_key(kind_index: int, kind: UnitKind, values: dict[str, float], number: int) -> tuple[object, ...]:
    """Units with equal keys share a group."""
    if not kind.groupable:
        return (number,)
    mechanical = {s for n in ("before", "loop") for b in kind.stages[n] for s in b.symbols}
    return (
        kind_index,
        *(values[name] for name in kind.columns if name in mechanical and name not in SUMMED),
    )


class Packer:
    """Collects rows of numbers and the index records that point at them."""

    def __init__(self, limb: Limb) -> None:
        self.limb = limb
        self.numbers = chain_block(limb)
        self.muscle_kinds: list[MuscleKind] = []
        self.unit_kinds: list[UnitKind] = []
        self.muscle_records: list[list[int]] = []
        self.group_records: list[list[int]] = []
        self.unit_records: list[list[int]] = []
        self.initial: list[float] = []
        self.names: list[str] = []
        self.scales: list[float] = []
        self.drives = 0
        self.work = 0

    def row(self, columns: list[str], values: dict[str, float]) -> int:
        """Append a row; its offset."""
        offset = len(self.numbers)
        self.numbers += [values[name] for name in columns]
        return offset

    def add_states(self, system: System, values: dict[str, float], owner: str) -> int:
        """Append the states of a system; the offset of the first."""
        offset = len(self.initial)
        for state, process in system.states:
            parameter = f"{process}__{state.initial}"
            self.initial.append(values[parameter if parameter in values else state.initial])
            self.names.append(f"{owner}.{state.name}")
            self.scales.append(state.scale)
        return offset

    def reserve(self, drives: int, work: int) -> tuple[int, int]:
        """Room for drives and scratch numbers; their offsets."""
        offsets = self.drives, self.work
        self.drives += drives
        self.work += work
        return offsets

    def add_muscle(self, number: int, muscle: Muscle) -> None:
        """Append a muscle with its groups and units."""
        laws = {name: muscle.laws[name].law for name in MUSCLE_PROCESSES}
        kind = next((known for known in self.muscle_kinds if known.laws == laws), MuscleKind(laws))
        values = muscle_values(muscle, kind)
        parameters = self.row(kind.columns, values)
        state = self.add_states(kind.system, values, muscle.name)
        drive, work = self.reserve(len(kind.drives), 2)
        first = len(self.group_records)
        groups: dict[tuple[object, ...], int] = {}
        totals: dict[int, dict[str, float]] = {}
        for unit in muscle.units:
            unit_kind = UnitKind({name: unit.laws[name].law for name in UNIT_PROCESSES}, kind.steady_activation)
            unit_index, unit_kind = find_or_add(self.unit_kinds, unit_kind, lambda k: (k.laws, k.steady_activation))
            unit_numbers = unit_values(unit, unit_kind)
            key = group_key(unit_index, unit_kind, unit_numbers, len(self.unit_records))
            if key in groups:
                group = groups[key]
                for name in SUMMED:
                    totals[group][name] += unit_numbers[name]
            else:
                group = groups[key] = len(self.group_records)
                totals[group] = dict(unit_numbers)
                unit_state = self.add_states(unit_kind.system, unit_numbers, f"{muscle.name}.{unit.name}")
                unit_drive, unit_work = self.reserve(len(unit_kind.drives), 2 * len(unit_kind.kept))
                self.group_records.append([unit_index, 0, unit_state, unit_drive, unit_work])
            self.unit_records.append([unit_index, self.row(unit_kind.columns, unit_numbers), group, number])
        for group, summed in totals.items():
            record = self.group_records[group]
            record[1] = self.row(self.unit_kinds[record[0]].columns, summed)
        kinds = tuple(record[0] for record in self.group_records[first:])
        whole = MuscleKind(laws, kinds if len(kinds) <= MOST_WRITTEN_OUT else ())
        kind_index, _ = find_or_add(self.muscle_kinds, whole, lambda known: (known.laws, known.groups))
        self.muscle_records.append(
            [kind_index, muscle.joint, parameters, state, drive, first, len(self.group_records), work]
        )

    def layout(self) -> Layout:
        """The arrays."""
        records = [*self.muscle_records, *self.group_records, *self.unit_records]
        return Layout(
            limb=self.limb,
            muscle_kinds=tuple(self.muscle_kinds),
            unit_kinds=tuple(self.unit_kinds),
            parameters=np.array(self.numbers, dtype=np.float64),
            index=np.array([n for record in records for n in record], dtype=np.int64),
            initial_states=np.array(self.initial, dtype=np.float64),
            state_names=tuple(self.names),
            state_scales=np.array(self.scales, dtype=np.float64),
            joints=len(self.limb.segments),
            muscles=len(self.muscle_records),
            groups=len(self.group_records),
            units=len(self.unit_records),
            drives=self.drives,
            work=self.work,
        )


def find_or_add(kinds: list[Kind], new: Kind, key: Callable[[Kind], object]) -> tuple[int, Kind]:
    """The kind with the same laws, added where there is none yet."""
    for index, kind in enumerate(kinds):
        if key(kind) == key(new):
            return index, kind
    kinds.append(new)
    return len(kinds) - 1, new


def build_layout(limb: Limb) -> Layout:
    """Put a limb's numbers into flat arrays."""
    packer = Packer(limb)
    for number, muscle in enumerate(limb.muscles):
        packer.add_muscle(number, muscle)
    return packer.layout()
