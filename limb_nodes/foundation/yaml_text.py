"""YAML 1.2, read within bounds: whatever the text is, it is read or refused within seconds and little memory."""

from __future__ import annotations

import io
import re
from itertools import islice
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.composer import Composer
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.events import AliasEvent

from limb_nodes.errors import UserError

# The largest limb that is shipped has 24 kB, 5 levels and 812 values.
MOST_BYTES = 2**20
MOST_LEVELS = 50
MOST_VALUES = 30_000
MOST_DIGITS = 400
_MORE = "has more than {}; YAML within this limit is needed"
_NUMBERS = ("tag:yaml.org,2002:int", "tag:yaml.org,2002:float")
# Between two values there is one of these; some stand in texts and comments too.
_SEPARATOR = re.compile(r"[,\[{]|:\s|-\s")


def read_yaml(path: Path) -> tuple[Any, str]:
    """Content and text of a YAML file. Raises UserError if it cannot be read."""
    try:
        with path.open("rb") as file:
            # A byte more than may be there, so that what is too long is seen; what is endless is not read.
            raw = file.read(MOST_BYTES + 1)
    except FileNotFoundError:
        raise UserError(f"{path}: no such file") from None
    except OSError as problem:
        raise UserError(f"{path}: cannot be read: {problem.strerror or problem}") from None
    _check_size(len(raw), MOST_BYTES, str(path))
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as problem:
        line = raw.count(b"\n", 0, problem.start) + 1
        raise UserError(f"{path}, line {line}: is not UTF-8; a text in UTF-8 is needed") from None
    return parse_yaml(text, str(path)), text


def parse_yaml(text: str, file: str, most_bytes: int = MOST_BYTES) -> Any:
    """Content of YAML text. Raises UserError with the line of the first mistake, or of what is too much."""
    _check_size(len(text.encode("utf-8", "replace")), most_bytes, file)
    # Counting values one by one takes most of the time of reading them; so many separators need not be counted so.
    for found in islice(_SEPARATOR.finditer(text), 2 * MOST_VALUES, None):
        raise _refusal(file, text.count("\n", 0, found.start()), _MORE.format(f"{MOST_VALUES} values"))
    loader = YAML(typ="safe", pure=True)
    loader.Composer = _BoundedComposer
    try:
        return loader.load(text)
    except _TooMuchError as problem:
        raise _refusal(file, problem.line, problem.reason) from None
    except MarkedYAMLError as problem:
        mark = problem.problem_mark
        line = f", line {mark.line + 1}" if mark else ""
        raise UserError(f"{file}{line}: not YAML: {problem.problem}") from None
    except YAMLError as problem:
        raise UserError(f"{file}: not YAML: {problem}") from None
    except MemoryError:
        raise
    except Exception as problem:  # whatever `!!int ""` and other tags do to the library
        raise UserError(f"{file}: not YAML: a value does not fit its tag: {problem}") from None


def placed_yaml(text: str) -> Any:
    """Content of YAML text that `parse_yaml` has read before; it knows where its keys and values stand."""
    return YAML().load(text)


def yaml_text(content: Any) -> str:
    """The YAML text of plain data."""
    stream: io.StringIO = io.StringIO()
    YAML(typ="safe", pure=True).dump(content, stream)
    return str(stream.getvalue())


class _TooMuchError(Exception):
    """A text passes a limit in a line, counted from 0."""

    def __init__(self, line: int, reason: str) -> None:
        super().__init__(line, reason)
        self.line = line
        self.reason = reason


def _refusal(file: str, line: int, reason: str) -> UserError:
    return UserError(f"{file}, line {line + 1}: {reason}")


def _check_size(size: int, most: int, file: str) -> None:
    if size > most:
        raise UserError(f"{file}: {_MORE.format(f'{most} bytes')}")


class _BoundedComposer(Composer):
    """Counts levels and values while they are composed; what an alias repeats counts as often as it is there."""

    def __init__(self, loader: Any = None) -> None:
        super().__init__(loader=loader)
        self.warn_double_anchors = False
        self._levels = 0
        self._values = 0
        # Of each finished node: how many values are in it.
        self._sizes: dict[int, int] = {}

    def compose_node(self, parent: Any, index: Any) -> Any:
        """The next node. Raises _TooMuchError."""
        before, line = self._values, self.parser.peek_event().start_mark.line
        repeated = self.parser.check_event(AliasEvent)
        self._levels += 1
        if self._levels > MOST_LEVELS:
            raise _TooMuchError(line, _MORE.format(f"{MOST_LEVELS} levels"))
        node = super().compose_node(parent, index)
        self._levels -= 1
        if repeated:
            if id(node) not in self._sizes:
                raise _TooMuchError(line, "an alias stands within what it names; YAML without such a circle is needed")
            self._values += self._sizes[id(node)]
        else:
            self._values += 1
            self._sizes[id(node)] = self._values - before
        if self._values > MOST_VALUES:
            raise _TooMuchError(line, _MORE.format(f"{MOST_VALUES} values"))
        return node

    def compose_scalar_node(self, anchor: Any) -> Any:
        """A text, a number or another single value. Raises _TooMuchError."""
        node = super().compose_scalar_node(anchor)
        if len(node.value) > MOST_DIGITS and str(node.tag) in _NUMBERS:
            raise _TooMuchError(node.start_mark.line, _MORE.format(f"{MOST_DIGITS} digits in a number"))
        return node
