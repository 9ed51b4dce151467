"""Numbers that the user gives, as they are declared: name, unit, meaning, range, default and source."""

from __future__ import annotations

import sys
from dataclasses import dataclass

from limb_nodes.errors import FieldError


def is_finite(value: float) -> bool:
    """Whether a number, an integer of any length included, is one of the finite floats."""
    return abs(value) <= sys.float_info.max


@dataclass(frozen=True)
class Parameter:
    """A number that the user gives: name, unit, meaning, allowed range, default and its source.

    default: a float, the name of another parameter of the same owner, or None if it must be
        given.
    above, below: strict bounds; minimum, maximum: bounds that are themselves allowed.
    """

    name: str
    unit: str
    meaning: str
    default: float | str | None = None
    source: str = "estimate"
    minimum: float | None = None
    maximum: float | None = None
    above: float | None = None
    below: float | None = None
    integer: bool = False

    def allowed(self) -> str:
        """The allowed values in words, for error messages and the reference of keys."""
        kind = "an integer" if self.integer else "a number"
        bounds = [
            f"{sign} {bound:g}"
            for sign, bound in (
                (">", self.above),
                (">=", self.minimum),
                ("<", self.below),
                ("<=", self.maximum),
            )
            if bound is not None
        ]
        text = " and ".join([f"{kind} {bounds[0]}", *bounds[1:]]) if bounds else kind
        return f"{text} in {self.unit}" if self.unit != "1" else text

    def accepts(self, value: float) -> bool:
        """Whether `value` is finite and within the bounds."""
        return (
            is_finite(value)
            and (self.minimum is None or value >= self.minimum)
            and (self.maximum is None or value <= self.maximum)
            and (self.above is None or value > self.above)
            and (self.below is None or value < self.below)
            and (not self.integer or value == int(value))
        )

    def check(self, value: float) -> float:
        """The value, which is within the bounds. Raises FieldError that says what is allowed."""
        if not self.accepts(value):
            shown = str(value) if isinstance(value, int) else f"{value:g}"
            raise FieldError(self.name, f"is {shown}; {self.allowed()} is needed")
        return value
