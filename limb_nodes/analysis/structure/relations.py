"""Equations seen from afar: which variable each one defines, which it uses, and up to which derivative."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from limb_nodes.levels import Equation


class Variable(NamedTuple):
    """A variable of one muscle, motor unit or segment, its `owner`."""

    owner: str
    name: str

    def __str__(self) -> str:
        return f"{self.owner}.{self.name}" if self.owner else self.name


class Term(NamedTuple):
    """A variable or one of its derivatives by time."""

    variable: Variable
    order: int = 0


@dataclass(frozen=True)
class Relation:
    """One scalar equation.

    number: that of the report, or a name. level: the level or sub-level it belongs to.
    process: of the law that brings the equation, empty if it belongs to the level itself.
    offered: inputs of the level that a law of this process may use and this one does not.
    """

    number: str
    owner: str
    level: str
    defines: Term
    uses: tuple[Term, ...]
    process: str = ""
    offered: tuple[Variable, ...] = ()

    @property
    def label(self) -> str:
        """Number without component of a vector; a name without number tells its process."""
        number = self.number[:-2] if self.number.endswith((" x", " y")) else self.number
        return f"{number} ({self.process.replace('_', ' ')})" if self.process and number.isidentifier() else number

    @property
    def name(self) -> str:
        """Number and owner, which tell an equation from all others of a limb."""
        number = self.number if self.number[:1].isdigit() else self.label
        return f"{number} of {self.owner}" if self.owner else number

    def incidence(self) -> dict[Variable, int]:
        """Every variable of the equation with its highest derivative in it, the defined one first."""
        highest: dict[Variable, int] = {}
        for variable, order in (self.defines, *self.uses):
            highest[variable] = max(order, highest.get(variable, 0))
        return highest

    @property
    def differential(self) -> bool:
        """Whether a derivative occurs."""
        return any(self.incidence().values())


@dataclass(frozen=True)
class EquationSet:
    """Equations with their unknowns and what is given from outside.

    name: of the level; title: what it is, in words; laws: by process; members: the muscles, motor units or joints
    that have these equations.
    """

    name: str
    title: str
    relations: tuple[Relation, ...]
    unknowns: tuple[Variable, ...]
    inputs: tuple[Variable, ...]
    laws: Mapping[str, str] = field(default_factory=dict)
    members: tuple[str, ...] = ()


@dataclass
class Assembly:
    """Equations of several levels, and the level to which each variable and each parameter belongs."""

    relations: list[Relation] = field(default_factory=list)
    variables: dict[Variable, str] = field(default_factory=dict)
    parameters: dict[Variable, str] = field(default_factory=dict)

    def add(self, relation: Relation) -> None:
        """Append an equation; what it defines belongs to its level unless another came first."""
        self.relations.append(relation)
        self.variables.setdefault(relation.defines.variable, relation.level)

    def view(
        self,
        name: str,
        title: str,
        levels: Iterable[str],
        chosen: Callable[[Relation], bool] = lambda relation: True,
        owned: Callable[[Variable], bool] = lambda variable: True,
        laws: Mapping[str, str] | None = None,
        members: Sequence[str] = (),
    ) -> EquationSet:
        """The equations of some levels: what belongs to these levels is unknown, all else that they use is given.

        Parameters of other levels count as given from there, those of the own levels are left out.
        """
        inside = set(levels)
        relations = [relation for relation in self.relations if relation.level in inside and chosen(relation)]
        own = {v for v, level in self.variables.items() if level in inside and owned(v)}
        hidden = {v for v, level in self.parameters.items() if level in inside}
        kept = []
        unknowns: dict[Variable, None] = {relation.defines.variable: None for relation in relations}
        inputs: dict[Variable, None] = {}
        for relation in relations:
            uses = tuple(term for term in relation.uses if term.variable not in hidden)
            kept.append(replace(relation, uses=uses, offered=tuple(v for v in relation.offered if v not in own)))
            for term in uses:
                (unknowns if term.variable in own else inputs).setdefault(term.variable)
        for variable in (v for relation in kept for v in relation.offered):
            inputs.setdefault(variable)
        unknowns.update(dict.fromkeys(v for v in self.variables if v in own))
        return EquationSet(
            name,
            title,
            tuple(kept),
            tuple(unknowns),
            tuple(v for v in inputs if v not in unknowns),
            dict(laws or {}),
            tuple(members),
        )


def relate(
    equation: Equation, level: str, owner: str, defines: Term, given: Mapping[str, Iterable[Term]], process: str = ""
) -> Relation:
    """An equation whose arguments stand for the terms in `given`; constants stand for none.

    Raises KeyError for an argument that is not in `given`.
    """
    uses = dict.fromkeys(term for argument in equation.uses for term in given[argument])
    return Relation(equation.number, owner, level, defines, tuple(uses), process)


def substitute(relations: Iterable[Relation], names: Iterable[str]) -> list[Relation]:
    """Put the equations of the variables called `names` into those that use them."""
    gone = set(names)
    relations = list(relations)
    definitions = {r.defines.variable: r for r in relations if r.defines.variable.name in gone}

    def expanded(terms: Iterable[Term]) -> list[Term]:
        result: dict[Term, None] = {}
        for term in terms:
            if term.variable in definitions:
                inner = expanded(definitions[term.variable].uses)
                result.update(dict.fromkeys(Term(v, order + term.order) for v, order in inner))
            else:
                result[term] = None
        return list(result)

    return [replace(r, uses=tuple(expanded(r.uses))) for r in relations if r.defines.variable not in definitions]
