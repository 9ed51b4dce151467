"""Errors that a person can act on."""

from __future__ import annotations


class UserError(Exception):
    """A mistake in what the user gave; its text is the one line that the user sees.

    The line names file, place and value, and says what is needed: `FILE: KEY is VALUE; WHAT is needed`. Commands and
    nodes print it to standard error and end with `status`: 2, nothing was begun.
    """

    status = 2


class RunError(UserError):
    """What had begun and could not be finished, such as a run whose disk is full: status 1.

    What was there before, and what was made until then, is kept.
    """

    status = 1


class FieldError(UserError):
    """A mistake in what a field was given, such as `duration is -1; a number > 0 in s is needed`.

    Args:
        field: an argument of a function, a field of a class, or a parameter of a node. A command shows the name of
            its own option instead.
        problem: the rest of the line: `is VALUE; WHAT is needed`.
        source: the file or the bag that the line begins with; empty for none.
    """

    def __init__(self, field: str, problem: str, source: str = "") -> None:
        super().__init__(field, problem, source)
        self.field = field
        self._problem = problem
        self._source = source

    def line(self, name: str) -> str:
        """The line that the user sees, with another name of the field."""
        return f"{self._source}: {name} {self._problem}" if self._source else f"{name} {self._problem}"

    def __str__(self) -> str:
        return self.line(self.field)
