"""A law evaluated in plain Python at points of its variables."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from numbers import Real

from limb_nodes.levels import Equation
from limb_nodes.model.chosen import ChosenLaw
from limb_nodes.model.curve_checks import number_text
from limb_nodes.model.system import all_equations, given_of


class BrokenLaw(Exception):
    """A law that cannot be evaluated; the text says why."""


@dataclass(frozen=True)
class Step:
    """One equation with the symbols of its arguments; the law's parameters start with a colon."""

    equation: Equation
    symbols: tuple[str, ...]


class Probe:
    """The equations of one law with the values of its parameters.

    given: the variables that will be given at every point.
    constants: variables that stay the same.
    Raises BrokenLaw if an equation uses what is neither given nor defined, or if the
    equations define each other.
    """

    def __init__(self, chosen: ChosenLaw, given: Iterable[str], constants: Mapping[str, float]) -> None:
        own = {f":{name}": value for name, value in chosen.values.items()}
        waiting = [
            Step(item, tuple(f":{name}" if f":{name}" in own else name for name in item.uses))
            for item in all_equations(chosen.law)
        ]
        self.start: dict[str, float] = {**constants, **own}
        self.steps: list[Step] = []
        varying = set(given) - set(constants)
        known = {*self.start, *varying}
        while waiting:
            ready = [step for step in waiting if known.issuperset(step.symbols)]
            if not ready:
                raise BrokenLaw(missing(waiting, known))
            for step in ready:
                if varying.isdisjoint(step.symbols):
                    self.start[step.equation.defines] = value_of(step, self.start)
                else:
                    self.steps.append(step)
                    varying.add(step.equation.defines)
                known.add(step.equation.defines)
            waiting = [step for step in waiting if step not in ready]
        self.varying = varying

    def uses(self, variable: str) -> bool:
        """Whether any equation uses a given variable."""
        return any(variable in step.symbols for step in self.steps)

    def at(self, **point: float) -> dict[str, float]:
        """All variables at a point."""
        values = {**self.start, **point}
        for step in self.steps:
            values[step.equation.defines] = value_of(step, values)
        return values


def value_of(step: Step, values: Mapping[str, float]) -> float:
    """The value of an equation; NaN if its arithmetic fails, as when it is compiled."""
    try:
        value = step.equation.function(*[values[symbol] for symbol in step.symbols])
    except (ArithmeticError, ValueError):
        return math.nan
    except Exception as problem:
        if any(values[symbol] != values[symbol] for symbol in step.symbols):
            return math.nan
        raise BrokenLaw(f"equation {step.equation.number} fails: {type(problem).__name__}: {problem}") from None
    # A negative number to a broken power is complex in Python and NaN in compiled code.
    if isinstance(value, complex):
        return math.nan
    if not isinstance(value, Real):
        raise BrokenLaw(f"equation {step.equation.number} returns {value!r}, not a number")
    return float(value)


def missing(waiting: list[Step], known: set[str]) -> str:
    """What keeps equations from being evaluated."""
    defined = {step.equation.defines for step in waiting}
    for step in waiting:
        for symbol in step.symbols:
            if symbol not in known and symbol not in defined:
                return f"equation {step.equation.number} uses {symbol}, which is neither given nor defined"
    return f"the equations of {', '.join(sorted(defined))} use each other"


def given(chosen: ChosenLaw) -> list[str]:
    """The variables that a law of its process is given from outside, and its states."""
    computed = {item.defines for item in all_equations(chosen.law)}
    variables = [name for name in given_of(chosen.law) if name not in computed]
    return [*variables, *(state.name for state in chosen.law.states)]


def initial_states(chosen: ChosenLaw, probe: Probe) -> dict[str, float]:
    """The law's states at the start."""
    return {
        state.name: chosen.values[state.initial] if state.initial in chosen.values else probe.start[state.initial]
        for state in chosen.law.states
    }


def states_fault(chosen: ChosenLaw, probe: Probe, points: Iterable[tuple[dict[str, float], str]]) -> str:
    """Whether the rates of a law's states are finite at points, each with its words for a message.

    Each state is tried at its start and at both ends of its declared range.
    """
    law = chosen.law
    start = initial_states(chosen, probe)
    tried = [start]
    for state in law.states:
        low, high = law.ranges.get(state.name, (0.5 * start[state.name], 1.5 * start[state.name]))
        tried += [{**start, state.name: low}, {**start, state.name: high}]
    for point, words in points:
        for states in tried:
            values = probe.at(**{**states, **point})
            for state in law.states:
                if not math.isfinite(values[state.rate]):
                    at = ", ".join(f"{name} {value:.4g}" for name, value in states.items())
                    return f"{state.rate} is {number_text(values[state.rate])} at {at}{words}; a finite rate is needed"
    return ""
