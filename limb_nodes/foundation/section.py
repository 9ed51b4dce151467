"""Reading one mapping of a YAML file, with errors that name file, place, value and what is allowed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from limb_nodes.errors import MOST, UserError, shown
from limb_nodes.foundation.parameter import Parameter, is_finite


def one_line(text: object) -> str:
    """A text with its line breaks and runs of blanks made single blanks."""
    return " ".join(str(text).split())


class Section:
    """A mapping at a place of a file, from which keys are taken one by one.

    `places` names, for keys that were merged in from elsewhere, where they stand.
    """

    def __init__(self, file: str, place: str, content: Any, places: Mapping[str, str] | None = None) -> None:
        self.file = file
        self.place = place
        self.places = dict(places or {})
        if not isinstance(content, Mapping):
            self.fail("", f"is {describe(content)}; a mapping of keys is needed")
        for key in content:
            if not isinstance(key, str) or not _fits(key, MOST):
                self.fail(
                    "", f"has the key {describe(key)}; keys are texts of {MOST} signs at most that can be printed"
                )
        self.content: dict[str, Any] = dict(content)
        self._taken: set[str] = set()

    def at(self, key: str) -> str:
        """The place of a key, such as `muscles[2].tendon.stiffness`."""
        if key in self.places:
            return self.places[key]
        if not key:
            return self.place or "the file"
        return f"{self.place}.{key}" if self.place else key

    def fail(self, key: str, what: str) -> Any:
        """Raise the UserError for a key."""
        raise UserError(f"{self.file}: {self.at(key)} {what}")

    def has(self, key: str) -> bool:
        """Whether the key is there and is not empty."""
        return self.content.get(key) is not None

    def take(self, key: str) -> Any:
        """The raw value of a key, None if it is missing."""
        self._taken.add(key)
        return self.content.get(key)

    def text(self, key: str, default: str | None = None, most: int = MOST) -> str:
        """A text that is not empty, of `most` signs at most, all of which can be printed."""
        value = self.take(key)
        if value is None and default is not None:
            return default
        if not isinstance(value, str) or not value.strip():
            if value is None:
                self.fail(key, "is missing; a text is needed")
            self.fail(key, f"is {describe(value)}; a text is needed")
        if not _fits(value, most):
            self.fail(key, f"is {describe(value)}; a text of {most} signs at most that can be printed is needed")
        return str(value)

    def choice(self, key: str, allowed: Iterable[str], default: str | None = None) -> str:
        """One of the allowed texts."""
        options = list(allowed)
        value = self.take(key)
        if value is None and default is not None:
            return default
        if value not in options:
            found = "is missing" if value is None else f"is {describe(value)}"
            self.fail(key, f"{found}; allowed: {', '.join(options) or 'nothing'}")
        return str(value)

    def number(self, parameter: Parameter, key: str | None = None) -> float | None:
        """The value of a parameter, its numeric default, or None if it refers to another."""
        key = key or parameter.name
        value = self.take(key)
        if value is None:
            if parameter.default is None:
                self.fail(key, f"is missing; {parameter.allowed()} is needed")
            return None if isinstance(parameter.default, str) else parameter.default
        if isinstance(value, bool) or not isinstance(value, int | float):
            self.fail(key, f"is {describe(value)}; {parameter.allowed()} is needed")
        if not parameter.accepts(value):
            self.fail(key, f"is {describe(value)}; {parameter.allowed()} is needed")
        return float(value)

    def vector(self, key: str, length: int, default: tuple[float, ...] | None) -> tuple[float, ...]:
        """A list of finite numbers of a given length."""
        value = self.take(key)
        if value is None and default is not None:
            return default
        good = (
            isinstance(value, list)
            and len(value) == length
            and all(isinstance(item, int | float) and not isinstance(item, bool) and is_finite(item) for item in value)
        )
        if not good:
            found = "is missing" if value is None else f"is {describe(value)}"
            self.fail(key, f"{found}; a list of {length} finite numbers is needed")
        return tuple(float(item) for item in value)

    def section(self, key: str) -> Section:
        """The mapping under a key."""
        return Section(self.file, self.at(key), self.take(key))

    def sections(self, key: str, required: bool) -> list[Section]:
        """The mappings of a list under a key."""
        value = self.take(key)
        if value is None and not required:
            return []
        if not isinstance(value, list) or (required and not value):
            found = "is missing" if value is None else f"is {describe(value)}"
            self.fail(key, f"{found}; a list of mappings is needed")
        return [Section(self.file, f"{self.at(key)}[{index}]", item) for index, item in enumerate(value)]

    def finish(self) -> None:
        """Refuse the keys that nobody took."""
        for key in self.content:
            if key not in self._taken:
                self.fail(key, f"is not a key here; allowed: {', '.join(sorted(self._taken))}")


def present(value: float | None) -> float:
    """A number that is in the file or has a numeric default."""
    assert value is not None
    return value


def describe(value: Any) -> str:
    """A value in an error message, shortened."""
    if value is None:
        return "empty"
    return shown(repr(value) if isinstance(value, str) else value, 60)


def _fits(text: str, most: int) -> bool:
    return len(text) <= most and text.isprintable()
