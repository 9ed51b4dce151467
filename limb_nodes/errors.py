"""Errors that a person can act on, and how they show what the user gave."""

from __future__ import annotations

import re

# Of a text of the user, an error shows so many characters at most; of a path, so many of each name and of all.
MOST = 80
MOST_PATH = 240
MOST_LINE = 1200
_PLAIN = re.compile(r"[ -~]*")
_BREAK = re.compile(r"\s*[\t\n\v\f\r\x1c-\x1f\x85\u2028\u2029]\s*")
_LONG_WORD = re.compile(rf"\S{{{MOST + 1},}}")
_LONG_QUOTE = re.compile(rf"(?<!\w)(['\"])(?:(?!\1).){{{MOST - 1},}}\1(?!\w)")


def shown(text: object, most: int = MOST) -> str:
    """A text of the user as a message shows it: in one line, without control characters, its middle left out."""
    return _shortened(escaped(_BREAK.sub(" ", str(text))), most)


def escaped(text: str, kept: str = "") -> str:
    """A text with what a terminal does not show, or obeys, as escapes such as `\\x1b`. kept: as they are."""
    if _PLAIN.fullmatch(text):
        return text
    return "".join(sign if sign.isprintable() or sign in kept else ascii(sign)[1:-1] for sign in text)


def _shortened(text: str, most: int) -> str:
    if len(text) <= most:
        return text
    head = (most - 3) * 3 // 5
    return f"{text[:head]}...{text[head + 3 - most :]}"


def shortened(text: str) -> str:
    """A text of the user with its middle left out; the names of a path are shortened one by one."""
    if "/" not in text:
        return _shortened(text, MOST)
    return _shortened("/".join(_shortened(name, MOST) for name in text.split("/")), MOST_PATH)


def clean(line: str) -> str:
    """A line without control characters, long words and quoted texts shortened in the middle."""
    line = escaped(_BREAK.sub(" ", line))
    line = _LONG_QUOTE.sub(lambda found: shortened(found.group()), line)
    line = _LONG_WORD.sub(lambda found: shortened(found.group()), line)
    return _shortened(line, MOST_LINE)


class UserError(Exception):
    """A mistake in what the user gave; its text is the one line that the user sees.

    The line names file, place and value, and says what is needed: `FILE: KEY is VALUE; WHAT is needed`. Commands and
    nodes print it to standard error and end with `status`: 2, nothing was begun.
    """

    status = 2

    def raw(self, name: str = "") -> str:
        """The line, whatever is in it. name: what to call a field, if there is one and it has another name."""
        return super().__str__()

    def __str__(self) -> str:
        return clean(self.raw())


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

    def raw(self, name: str = "") -> str:
        """The line, whatever is in it. name: what to call the field, if it has another name."""
        line = f"{name or self.field} {self._problem}"
        return f"{self._source}: {line}" if self._source else line
