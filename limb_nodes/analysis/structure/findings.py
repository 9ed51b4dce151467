"""What the structure of a set of equations tells about whether and how it can be solved."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from limb_nodes.analysis.structure.blocks import strong_components
from limb_nodes.analysis.structure.matching import Parts, dulmage_mendelsohn
from limb_nodes.analysis.structure.pantelides import Offsets, pantelides
from limb_nodes.analysis.structure.relations import EquationSet, Relation, Variable


@dataclass(frozen=True)
class Block:
    """Equations that must be solved together, and the unknowns that they give; derivatives with their order."""

    relations: tuple[int, ...]
    unknowns: tuple[tuple[Variable, int], ...]


@dataclass(frozen=True)
class Findings:
    """The structure of a set of equations."""

    system: EquationSet

    @property
    def degrees_of_freedom(self) -> int:
        """Unknowns less equations."""
        return len(self.system.unknowns) - len(self.system.relations)

    @cached_property
    def incidences(self) -> list[dict[Variable, int]]:
        """The unknowns of each equation with their highest derivatives."""
        unknowns = set(self.system.unknowns)
        return [{v: n for v, n in r.incidence().items() if v in unknowns} for r in self.system.relations]

    @cached_property
    def parts(self) -> Parts[Variable]:
        """The over- and under-determined parts, derivatives not told apart."""
        return dulmage_mendelsohn([list(row) for row in self.incidences], self.system.unknowns)

    @property
    def singular(self) -> bool:
        """Whether the equations cannot determine their unknowns, whatever their numbers."""
        return self.parts.singular

    @cached_property
    def offsets(self) -> Offsets[Variable] | None:
        """How often equations must be differentiated; None for a singular system."""
        return None if self.singular else pantelides(self.incidences)

    @property
    def index(self) -> int | None:
        """The structural differential index; None for a singular system."""
        return self.offsets.index if self.offsets else None

    @property
    def kind(self) -> str:
        """The kind of system in words."""
        if self.singular:
            return "structurally singular"
        if not any(relation.differential for relation in self.system.relations):
            return "algebraic equations"
        return "ordinary differential equations" if self.index == 0 else "differential and algebraic equations"

    @property
    def differentiated(self) -> dict[int, int]:
        """Equations that must be differentiated, and how often."""
        return {i: n for i, n in enumerate(self.offsets.times) if n} if self.offsets else {}

    @cached_property
    def blocks(self) -> list[Block]:
        """Equations to be solved together, in the order of solution; none for a singular system."""
        if not self.offsets:
            return []
        solved, highest, times = self.offsets.solved, self.offsets.highest, self.offsets.times
        unknown_of = {i: v for v, i in solved.items()}
        edges = [
            [solved[v] for v, order in row.items() if order + times[i] == highest[v] and solved[v] != i]
            for i, row in enumerate(self.incidences)
        ]
        return [
            Block(tuple(block), tuple((unknown_of[i], highest[unknown_of[i]]) for i in block))
            for block in strong_components(edges)
        ]

    @property
    def loops(self) -> list[Block]:
        """Blocks of more than one equation."""
        return [block for block in self.blocks if len(block.relations) > 1]

    @property
    def undefined(self) -> list[Variable]:
        """Unknowns that stand on no left-hand side."""
        defined = {relation.defines.variable for relation in self.system.relations}
        return [v for v in self.system.unknowns if v not in defined]

    @property
    def defined_twice(self) -> dict[Variable, list[Relation]]:
        """Unknowns that stand on several left-hand sides, with the equations."""
        counts = Counter(relation.defines.variable for relation in self.system.relations)
        return {
            v: [r for r in self.system.relations if r.defines.variable == v] for v, count in counts.items() if count > 1
        }

    @property
    def sound(self) -> bool:
        """Whether the equations can be solved as they stand: not singular, and nothing to differentiate."""
        return not self.singular and not self.differentiated


def examine(sets: Sequence[EquationSet]) -> list[Findings]:
    """The structure of each set of equations."""
    return [Findings(one) for one in sets]
