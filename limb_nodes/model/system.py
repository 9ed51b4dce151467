"""The equations of motor units and muscles, bound together as a limb's laws choose them.

Equations meet by the names of their variables. Parameters of a law are known inside that law
only, so two laws may both have a `slack_length`; outside they are called ``process__name``.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from limb_nodes.foundation.parameter import Parameter
from limb_nodes.levels import CONTRACTS, Equation, Law, State, motor_unit, muscle, sarcomere

UNIT_PARAMETERS = (
    *(parameter.name for parameter in motor_unit.PARAMETERS),
    "unit_threshold",
    "unit_rank",
)
MUSCLE_PARAMETERS = ("role",)
UNIT_INPUTS = ("activation", "fibre_length", "fibre_velocity")
# What laws are given and no movement changes.
CONSTANTS = frozenset({*UNIT_PARAMETERS, *MUSCLE_PARAMETERS, *(item.defines for item in sarcomere.EQUATIONS)})


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

    parameters: symbols of the given numbers. inputs: variables that another level defines.
    states: variables that are integrated, each with the process of its law.
    """

    equations: tuple[BoundEquation, ...]
    parameters: tuple[str, ...]
    inputs: tuple[str, ...]
    states: tuple[tuple[State, str], ...]

    def checked(self) -> System:
        """This system. Raises ValueError for a variable that is defined twice or not at all."""
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
        return self

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


def all_parameters(law: Law) -> tuple[Parameter, ...]:
    """The parameters that are known inside a law only: those of its process, and its own."""
    return (*(sarcomere.PARAMETERS if law.process == "sarcomere" else ()), *law.parameters)


def all_equations(law: Law) -> tuple[Equation, ...]:
    """The equations that a law brings along: those that its process has whatever the law, and its own."""
    return (*(sarcomere.EQUATIONS if law.process == "sarcomere" else ()), *law.equations)


def unit_system(laws: Mapping[str, Law]) -> System:
    """The equations of a motor unit with the laws of its processes. Raises ValueError as `System.checked`."""
    return unit_equations(laws).checked()


def muscle_system(laws: Mapping[str, Law]) -> System:
    """The equations of a muscle around its units, `total_fibre_force` taken as given. Raises ValueError likewise."""
    return muscle_equations(laws).checked()


def unit_equations(laws: Mapping[str, Law]) -> System:
    """The equations of a motor unit, whether they can be solved or not."""
    return assemble(motor_unit.EQUATIONS, UNIT_PARAMETERS, UNIT_INPUTS, laws)


def muscle_equations(laws: Mapping[str, Law]) -> System:
    """The equations of a muscle around its units, whether they can be solved or not."""
    crossings = crossings_of(laws["path"])
    inputs = (
        "excitation",
        "total_fibre_force",
        *(f"joint_{of}{one}" for of in ("angle", "velocity") for one in crossings),
    )
    return assemble(muscle.muscle_equations(crossings), MUSCLE_PARAMETERS, inputs, laws)


def given_of(law: Law) -> tuple[str, ...]:
    """The variables that a law is given."""
    given = CONTRACTS[law.process].given
    if law.process != "path":
        return given
    endings = crossings_of(law)
    return tuple(f"{name}{one}" for name in given for one in (endings if name.startswith("joint_") else ("",)))


def owed_by(law: Law) -> tuple[str, ...]:
    """The variables that a law owes."""
    owed = CONTRACTS[law.process].defines
    if law.process != "path":
        return owed
    endings = crossings_of(law) or ("",)
    return tuple(f"{name}{one}" for name in owed for one in (endings if name == "moment_arm" else ("",)))


def crossings_of(path: Law) -> tuple[str, ...]:
    """What stands behind the names of variables that a muscle has for each joint that it crosses.

    Nothing if the law of the path knows of one joint only, else _0, _1, ... from proximal to distal.
    """
    return tuple(
        item.defines.removeprefix("moment_arm") for item in path.equations if item.defines.startswith("moment_arm")
    )


def tissue_system(law: Law) -> System:
    """The equations of one law of a joint's tissue. Raises ValueError as `System.checked`."""
    return assemble((), (), ("joint_angle", "joint_velocity"), {"tissue": law}).checked()


def assemble(
    level: Iterable[Equation], parameters: Iterable[str], inputs: tuple[str, ...], laws: Mapping[str, Law]
) -> System:
    """Bind the equations of a level and of its laws."""
    bound = [BoundEquation(item, item.uses, "") for item in level]
    symbols = list(parameters)
    states = []
    for process, law in laws.items():
        own = {parameter.name: f"{process}__{parameter.name}" for parameter in all_parameters(law)}
        symbols += own.values()
        for item in all_equations(law):
            bound.append(BoundEquation(item, tuple(own.get(name, name) for name in item.uses), process))
        states += [(state, process) for state in law.states]
    return System(tuple(bound), tuple(symbols), inputs, tuple(states))
