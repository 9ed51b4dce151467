"""Kinds of motor units, muscles and tissues: those with the same laws, and when each equation is evaluated."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from limb_nodes.levels import Law
from limb_nodes.model.system import BoundEquation, System, crossings_of, muscle_system, tissue_system, unit_system


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

    groups: the kinds of its groups of units, by index and in order; none if they are too many to be
        written out one by one.
    """

    laws: Mapping[str, Law]
    groups: tuple[int, ...] = ()

    @cached_property
    def system(self) -> System:
        """The muscle's equations."""
        return muscle_system(self.laws)

    @cached_property
    def crossings(self) -> tuple[str, ...]:
        """Endings of the names of variables that there are for each joint that the muscle crosses."""
        return crossings_of(self.laws["path"])

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
        outputs = {"tendon_length", "tendon_velocity", "pennation_angle"}
        outputs |= {f"moment_arm{one}" for one in self.crossings}
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
class TissueKind:
    """Tissues of joints with the same law. Stages as in `UnitKind`: `load`, and `loop` for the rest."""

    law: Law

    @cached_property
    def system(self) -> System:
        """The tissue's equations."""
        return tissue_system(self.law)

    @cached_property
    def stages(self) -> dict[str, list[BoundEquation]]:
        """Equations by stage, each in the order of evaluation."""
        depends = self.system.dependence()
        stages: dict[str, list[BoundEquation]] = {"load": [], "loop": []}
        for bound in self.system.ordered():
            stages["loop" if depends[bound.defines] else "load"].append(bound)
        return stages

    @cached_property
    def columns(self) -> list[str]:
        """Parameters and computed parameters that compiled code reads."""
        used = {symbol for bound in self.stages["loop"] for symbol in bound.symbols}
        loaded = [bound.defines for bound in self.stages["load"]]
        return [name for name in (*self.system.parameters, *loaded) if name in used]
