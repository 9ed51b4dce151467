"""The equations of motor units and muscles, bound together as a limb's laws choose them.

Equations meet by the names of their variables. Parameters of a law are known inside that law
only, so two laws may both have a `slack_length`; outside they are called ``process__name``.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from limb_nodes.levels import Equation, Law, State, motor_unit, muscle, sarcomere

UNIT_PARAMETERS = (
    *(parameter.name for parameter in motor_unit.PARAMETERS),
    "unit_threshold",
    "unit_rank",
)
UNIT_INPUTS = ("activation", "fibre_length", "fibre_velocity")
MUSCLE_INPUTS = ("excitation", "joint_angle", "joint_velocity", "total_fibre_force")


@dataclass(frozen=True)
class BoundEquation:
    """An equation with the symbols of its arguments, in order, and the process it belongs to."""

    equation: Equation
    symbols: tuple[str, ...]
    process: str

    @property
    def defines(self) -> str:
        """The variable on the left-hand side."""
        return self.equation.defines


@dataclass(frozen=True)
class System:
    """The equations of a motor unit or of a muscle around its units.

    parameters: symbols of the given numbers; inputs: variables defined by another level.
    states: variables that are integrated, each with its law.
    """

    equations: tuple[BoundEquation, ...]
    parameters: tuple[str, ...]
    inputs: tuple[str, ...]
    states: tuple[tuple[State, str], ...]

    def __post_init__(self) -> None:
        defined = set(self.inputs) | set(self.parameters) | {state.name for state, _ in self.states}
        for bound in self.equations:
            if bound.defines in defined:
                raise ValueError(f"{bound.process}: {bound.defines} is defined twice")
            defined.add(bound.defines)
        for bound in self.equations:
            for symbol in bound.symbols:
                if symbol not in defined:
                    raise ValueError(
                        f"{bound.process}: equation {bound.equation.number} uses {symbol}, which nothing defines"
                    )
        for state, process in self.states:
            if state.rate not in defined:
                raise ValueError(f"{process}: nothing defines {state.rate}")

    def dependence(self) -> dict[str, frozenset[str]]:
        """For every variable the inputs and states on which it depends, through any chain."""
        roots = {*self.inputs, *(state.name for state, _ in self.states)}
        known: dict[str, frozenset[str]] = {root: frozenset({root}) for root in roots}
        known.update({name: frozenset() for name in self.parameters})
        for bound in self.ordered():
            known[bound.defines] = frozenset().union(*(known[s] for s in bound.symbols))
        return known

    def ordered(self) -> list[BoundEquation]:
        """The equations, each behind those that define what it uses.

        Raises ValueError with the variables of a closed chain.
        """
        known = {*self.inputs, *self.parameters, *(state.name for state, _ in self.states)}
        waiting, order = list(self.equations), []
        while waiting:
            ready = [bound for bound in waiting if known.issuperset(bound.symbols)]
            if not ready:
                chain = ", ".join(bound.defines for bound in waiting)
                raise ValueError(f"these variables define each other: {chain}")
            order += ready
            known.update(bound.defines for bound in ready)
            waiting = [bound for bound in waiting if bound not in ready]
        return order


def unit_system(laws: Mapping[str, Law]) -> System:
    """The equations of a motor unit with the laws of its processes."""
    shared = {"sarcomere": tuple(parameter.name for parameter in sarcomere.PARAMETERS)}
    return assemble((*motor_unit.EQUATIONS,), UNIT_PARAMETERS, UNIT_INPUTS, laws, shared, sarcomere.EQUATIONS)


def muscle_system(laws: Mapping[str, Law]) -> System:
    """The equations of a muscle around its units, `total_fibre_force` taken as given."""
    return assemble(muscle.EQUATIONS, ("role",), MUSCLE_INPUTS, laws, {}, ())


def assemble(
    level: Iterable[Equation],
    parameters: tuple[str, ...],
    inputs: tuple[str, ...],
    laws: Mapping[str, Law],
    shared: Mapping[str, tuple[str, ...]],
    sarcomere_equations: Iterable[Equation],
) -> System:
    """Bind the equations of a level and of its laws."""
    bound = [BoundEquation(item, item.uses, "") for item in level]
    symbols = list(parameters)
    states = []
    for process, law in laws.items():
        own = (*shared.get(process, ()), *(parameter.name for parameter in law.parameters))
        symbols += [f"{process}__{name}" for name in own]
        equations = (*sarcomere_equations, *law.equations) if process in shared else law.equations
        for item in equations:
            names = tuple(f"{process}__{name}" if name in own else name for name in item.uses)
            bound.append(BoundEquation(item, names, process))
        states += [(state, process) for state in law.states]
    return System(tuple(bound), tuple(symbols), inputs, tuple(states))
