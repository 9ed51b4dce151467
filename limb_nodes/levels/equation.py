"""The vocabulary of the levels: equations, states and laws.

An *equation* is a small pure function of scalars. Its name in the report, the variable that it
defines and the quantities that it uses (its arguments) are read from the function itself, so that
the program that runs, the curves that are drawn and the structure matrices that are printed all
come from one place.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

from limb_nodes.foundation.parameter import Parameter

ScalarFunction = Callable[..., float]


@dataclass(frozen=True)
class Equation:
    """One equation of the model in the form ``defines = function(uses)``.

    number: the equation's number in the report, or a short name if the report has none.
    defines: the variable on the left-hand side.
    function: pure function of floats that returns a float.
    named: names of what it uses, if they are others than those of its arguments.
    """

    number: str
    defines: str
    function: ScalarFunction
    named: tuple[str, ...] = ()

    @cached_property
    def arguments(self) -> tuple[str, ...]:
        """Names of the function's arguments."""
        return tuple(inspect.signature(self.function).parameters)

    @property
    def uses(self) -> tuple[str, ...]:
        """Names of the quantities on the right-hand side, in the order of the arguments."""
        return self.named or self.arguments


def equation(number: str, defines: str) -> Callable[[ScalarFunction], ScalarFunction]:
    """Mark a function as the equation `number` that defines the variable `defines`."""

    def mark(function: ScalarFunction) -> ScalarFunction:
        function.__dict__["equation"] = Equation(number, defines, function)
        return function

    return mark


def equation_of(function: ScalarFunction | Equation) -> Equation:
    """The equation that a function is marked as; an `Equation` stands for itself.

    Raises TypeError for a function that is not marked with `equation`.
    """
    marked = function if isinstance(function, Equation) else function.__dict__.get("equation")
    if not isinstance(marked, Equation):
        raise TypeError(f"{getattr(function, '__name__', function)} is not marked; @equation is needed")
    return marked


@dataclass(frozen=True)
class State:
    """A variable that is integrated: d(name)/dt = rate.

    name: the variable; rate: the variable that holds its rate of change.
    number: the number of the differential equation in the report.
    initial: name of the law's parameter that holds the initial value, or of a variable that the law
        defines by parameters alone.
    scale: typical magnitude in SI units, against which the integrators weigh its error.
    """

    name: str
    rate: str
    number: str
    initial: str
    scale: float
    unit: str = "1"


@dataclass(frozen=True)
class Law:
    """One model of one process, chosen by name in a limb's YAML.

    process: key of the contract that the law fulfils (see `limb_nodes.levels.contracts`).
    functions: the law's equations, functions marked with `equation`; together they define what the contract asks
        for, the last one the characteristic that the law is known by.
    states: what the law integrates. ranges: by variable, over which the law is checked.
    """

    process: str
    name: str
    functions: tuple[ScalarFunction | Equation, ...]
    parameters: tuple[Parameter, ...] = ()
    states: tuple[State, ...] = ()
    source: str = ""
    ranges: dict[str, tuple[float, float]] = field(default_factory=dict, hash=False, compare=False)

    def __post_init__(self) -> None:
        """Raises TypeError for a function that is not marked with `equation`."""
        assert self.equations is not None

    @cached_property
    def equations(self) -> tuple[Equation, ...]:
        """The law's equations."""
        return tuple(map(equation_of, self.functions))

    def __call__(self, *values: float) -> float:
        """Evaluate the law's last equation: the characteristic that the law is known by."""
        return self.equations[-1].function(*values)

    @property
    def summary(self) -> str:
        """First line of the characteristic's docstring."""
        return (inspect.getdoc(self.equations[-1].function) or self.name).splitlines()[0]
