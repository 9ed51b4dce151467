"""Where every number of a limb stands in the flat arrays that compiled code reads.

Motor units of one muscle that differ only in what the activation does to them (threshold,
frequencies, number of fibres) share length and velocity of their sarcomeres, so that 2.25 may be
evaluated once for all of them: such units form a *group*, whose activity is the mean of theirs
weighted by `parallel_sarcomeres`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.foundation.records import Record, whole_numbers
from limb_nodes.levels import MUSCLE_PROCESSES, UNIT_PROCESSES
from limb_nodes.model.chain import segments_of, world_of
from limb_nodes.model.chosen import ChosenLaw
from limb_nodes.model.kinds import MuscleKind, TissueKind, UnitKind
from limb_nodes.model.limb import Limb, MotorUnit, Muscle
from limb_nodes.model.system import BoundEquation, System

Kind = TypeVar("Kind")

# Where a muscle's, a group's and a unit's numbers stand: its kind, and the first of its parameters, internal states,
# drives and scratch numbers; of a muscle also the joints that it crosses (from `crossing` to before `crossing_end`),
# its groups likewise, and the end of its states, those of its groups included.
MUSCLE_RECORD = whole_numbers(
    "kind", "crossing", "crossing_end", "parameters", "state", "state_end", "drive", "group", "group_end", "scratch"
)
# Of a muscle on one of the joints that it crosses: that joint.
CROSSING_RECORD = whole_numbers("joint")
GROUP_RECORD = whole_numbers("kind", "parameters", "state", "drive", "scratch")
UNIT_RECORD = whole_numbers("kind", "parameters", "group", "muscle")
# Of a tissue: its kind, its joint and the first of its parameters.
TISSUE_RECORD = whole_numbers("kind", "joint", "parameters")

# So many groups of a muscle get code of their own; more share a loop, which is slower and compiles faster.
MOST_WRITTEN_OUT = 3


@dataclass(frozen=True)
class Layout:
    """A limb as the flat arrays that compiled code reads.

    model: what does not change during a solve, one record with these fields:
        world, segments: float64 [3], [4 + n, n], the chain, rows as in `limb_nodes.model.chain`.
        parameters: float64, a row per muscle, group, unit and tissue, SI units; which numbers, its kind tells
            (`columns`).
        muscles, crossings, groups, units, tissues: one record for each, `MUSCLE_RECORD`, `CROSSING_RECORD`,
            `GROUP_RECORD`, `UNIT_RECORD`, `TISSUE_RECORD`.
    initial_states: float64 [internal states], initial values of tendons, aponeuroses and laws.
    state_names, state_scales: of the same.
    drives: how many numbers the input becomes (`limb_nodes.solve.whole.WholeModel.drives`).
    scratch: how many numbers muscles and groups keep from one stage of an evaluation to the next.
    """

    limb: Limb
    muscle_kinds: tuple[MuscleKind, ...]
    unit_kinds: tuple[UnitKind, ...]
    tissue_kinds: tuple[TissueKind, ...]
    model: Record
    initial_states: FloatArray
    state_names: tuple[str, ...]
    state_scales: FloatArray
    drives: int
    scratch: int

    @property
    def joints(self) -> int:
        """Number of joints."""
        return len(self.limb.segments)

    @property
    def muscles(self) -> int:
        """Number of muscles."""
        return len(self.model.muscles)

    @property
    def crossings(self) -> int:
        """Number of joints that muscles cross, of all muscles together."""
        return len(self.model.crossings)

    @property
    def groups(self) -> int:
        """Number of groups of motor units."""
        return len(self.model.groups)

    @property
    def units(self) -> int:
        """Number of motor units."""
        return len(self.model.units)

    @property
    def tissues(self) -> int:
        """Number of tissues of all joints."""
        return len(self.model.tissues)

    @property
    def states(self) -> int:
        """Number of internal states."""
        return len(self.state_names)

    def of_limb(self, limb: Limb) -> Layout:
        """The layout of a limb that differs in its chain alone."""
        model = self.model.copy()
        model.world[:], model.segments[:] = world_of(limb), segments_of(limb)
        return replace(self, limb=limb, model=model)


def define(equations: list[BoundEquation], values: dict[str, float]) -> None:
    """Add to `values` what equations define, in their order."""
    for bound in equations:
        values[bound.defines] = bound.equation.function(*(values[s] for s in bound.symbols))


def unit_values(unit: MotorUnit, kind: UnitKind) -> dict[str, float]:
    """All given and computed parameters of a unit, by symbol."""
    values = dict(unit.values)
    for process, chosen in unit.laws.items():
        values.update({f"{process}__{name}": value for name, value in chosen.values.items()})
    define(kind.stages["load"], values)
    return values


def muscle_values(muscle: Muscle, kind: MuscleKind) -> dict[str, float]:
    """All given and computed parameters of a muscle, by symbol."""
    values = {"role": muscle.role}
    for process, chosen in muscle.laws.items():
        values.update({f"{process}__{name}": value for name, value in chosen.values.items()})
    define(kind.stages["load"], values)
    return values


def tissue_values(tissue: ChosenLaw, kind: TissueKind) -> dict[str, float]:
    """All given and computed parameters of a tissue, by symbol."""
    values = {f"tissue__{name}": value for name, value in tissue.values.items()}
    define(kind.stages["load"], values)
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
    """Collects rows of numbers and the records that tell where they stand.

    known: a layout whose kinds need not be taken apart again.
    """

    def __init__(self, limb: Limb, known: Layout | None) -> None:
        self.limb = limb
        self.parameters: list[float] = []
        self.muscle_kinds = list(known.muscle_kinds) if known else []
        self.unit_kinds = list(known.unit_kinds) if known else []
        self.tissue_kinds = list(known.tissue_kinds) if known else []
        self.muscles: list[tuple[int, ...]] = []
        self.crossings: list[tuple[int]] = []
        self.groups: list[tuple[int, ...]] = []
        self.units: list[tuple[int, ...]] = []
        self.tissues: list[tuple[int, ...]] = []
        self.initial: list[float] = []
        self.names: list[str] = []
        self.scales: list[float] = []
        self.drives = 0
        self.scratch = 0

    def row(self, columns: list[str], values: dict[str, float]) -> int:
        """Append a row; its offset."""
        offset = len(self.parameters)
        self.parameters += [values[name] for name in columns]
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

    def reserve(self, drives: int, scratch: int) -> tuple[int, int]:
        """Room for drives and scratch numbers; their offsets."""
        offsets = self.drives, self.scratch
        self.drives += drives
        self.scratch += scratch
        return offsets

    def add_muscle(self, number: int, muscle: Muscle) -> None:
        """Append a muscle with its groups and units."""
        laws = {name: muscle.laws[name].law for name in MUSCLE_PROCESSES}
        kind = next((known for known in self.muscle_kinds if known.laws == laws), MuscleKind(laws))
        values = muscle_values(muscle, kind)
        parameters = self.row(kind.columns, values)
        state = self.add_states(kind.system, values, muscle.name)
        # The total fibre force and its slope.
        drive, scratch = self.reserve(len(kind.drives), 2)
        group = len(self.groups)
        group_kinds = self.add_units(number, muscle, kind.steady_activation)
        whole = MuscleKind(laws, group_kinds if len(group_kinds) <= MOST_WRITTEN_OUT else ())
        kind_index, _ = find_or_add(self.muscle_kinds, whole, lambda known: (known.laws, known.groups))
        crossing = len(self.crossings)
        self.crossings += [(joint,) for joint in muscle.joints]
        self.muscles.append(
            (
                kind_index,
                crossing,
                len(self.crossings),
                parameters,
                state,
                len(self.initial),
                drive,
                group,
                len(self.groups),
                scratch,
            )
        )

    def add_units(self, number: int, muscle: Muscle, steady_activation: bool) -> tuple[int, ...]:
        """Append the units of a muscle and the groups that they form; the kinds of these groups, by index."""
        groups: dict[tuple[object, ...], UnitGroup] = {}
        first = len(self.groups)
        for unit in muscle.units:
            new = UnitKind({name: unit.laws[name].law for name in UNIT_PROCESSES}, steady_activation)
            index, kind = find_or_add(self.unit_kinds, new, lambda known: (known.laws, known.steady_activation))
            values = unit_values(unit, kind)
            key = group_key(index, kind, values, len(self.units))
            if key in groups:
                groups[key].add(values)
            else:
                state = self.add_states(kind.system, values, f"{muscle.name}.{unit.name}")
                drive, scratch = self.reserve(len(kind.drives), 2 * len(kind.kept))
                groups[key] = UnitGroup(first + len(groups), index, dict(values), state, drive, scratch)
            self.units.append((index, self.row(kind.columns, values), groups[key].number, number))
        for group in groups.values():
            offset = self.row(self.unit_kinds[group.kind].columns, group.values)
            self.groups.append((group.kind, offset, group.state, group.drive, group.scratch))
        return tuple(group.kind for group in groups.values())

    def add_tissue(self, joint: int, tissue: ChosenLaw) -> None:
        """Append a tissue of a joint."""
        index, kind = find_or_add(self.tissue_kinds, TissueKind(tissue.law), lambda known: known.law)
        self.tissues.append((index, joint, self.row(kind.columns, tissue_values(tissue, kind))))

    def layout(self) -> Layout:
        """The arrays."""
        world, segments = world_of(self.limb), segments_of(self.limb)
        model = Record(
            np.dtype(
                [
                    ("world", np.float64, world.shape),
                    ("segments", np.float64, segments.shape),
                    ("parameters", np.float64, (len(self.parameters),)),
                    ("muscles", MUSCLE_RECORD, (len(self.muscles),)),
                    ("crossings", CROSSING_RECORD, (len(self.crossings),)),
                    ("groups", GROUP_RECORD, (len(self.groups),)),
                    ("units", UNIT_RECORD, (len(self.units),)),
                    ("tissues", TISSUE_RECORD, (len(self.tissues),)),
                ]
            )
        )
        model.world[:], model.segments[:] = world, segments
        model.parameters[:] = self.parameters
        model.muscles[:] = self.muscles
        model.crossings[:] = self.crossings
        model.groups[:] = self.groups
        model.units[:] = self.units
        model.tissues[:] = self.tissues
        return Layout(
            limb=self.limb,
            muscle_kinds=tuple(self.muscle_kinds),
            unit_kinds=tuple(self.unit_kinds),
            tissue_kinds=tuple(self.tissue_kinds),
            model=model,
            initial_states=np.array(self.initial, dtype=np.float64),
            state_names=tuple(self.names),
            state_scales=np.array(self.scales, dtype=np.float64),
            drives=self.drives,
            scratch=self.scratch,
        )


@dataclass
class UnitGroup:
    """Motor units that share one evaluation. values: by symbol; those in `SUMMED` are of all its units together."""

    number: int
    kind: int
    values: dict[str, float]
    state: int
    drive: int
    scratch: int

    def add(self, values: dict[str, float]) -> None:
        """Take in one more unit."""
        for name in SUMMED:
            self.values[name] += values[name]


def find_or_add(kinds: list[Kind], new: Kind, key: Callable[[Kind], object]) -> tuple[int, Kind]:
    """The kind with the same laws, added if there is none yet."""
    for index, kind in enumerate(kinds):
        if key(kind) == key(new):
            return index, kind
    kinds.append(new)
    return len(kinds) - 1, new


def build_layout(limb: Limb, known: Layout | None = None) -> Layout:
    """Put a limb's numbers into flat arrays. known: a layout of the same laws, which saves taking them apart."""
    packer = Packer(limb, known)
    for number, muscle in enumerate(limb.muscles):
        packer.add_muscle(number, muscle)
    for joint, segment in enumerate(limb.segments):
        for tissue in segment.tissue:
            packer.add_tissue(joint, tissue)
    return packer.layout()


def same_structure(one: Layout, other: Layout) -> bool:
    """Whether two limbs have one program and every number at the same place."""
    records = ("muscles", "crossings", "groups", "units", "tissues")
    return (
        one.muscle_kinds == other.muscle_kinds
        and one.unit_kinds == other.unit_kinds
        and one.tissue_kinds == other.tissue_kinds
        and one.model.kind == other.model.kind
        and all(np.array_equal(getattr(one.model, name), getattr(other.model, name)) for name in records)
    )
