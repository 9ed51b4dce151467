"""A bag as one table over time, a piece at a time, so that memory does not grow with the bag."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from limb_nodes.analysis.export.choose import chosen_topics
from limb_nodes.analysis.export.parts import Fields, chosen_parts, in_degrees, parts_of
from limb_nodes.analysis.export.power import Work
from limb_nodes.bags.columns import Columns
from limb_nodes.bags.read import BagReader
from limb_nodes.errors import FieldError, UserError
from limb_nodes.foundation.arrays import FloatArray

ROWS = 4096
"""Most rows of a piece."""
# A topic that shares fewer of its times than this with the first topic has times of its own.
_SHARED = 0.75


@dataclass(frozen=True)
class Choice:
    """What is wanted of a bag.

    topics: their names; none for all but those with many columns. columns: patterns of names as of a shell; none for
    all. start, end: first and last time, s; None for the bag's. degrees: angles in degrees, not radians.
    namespace: of the limb, if the bag holds several.
    """

    topics: tuple[str, ...] = ()
    columns: tuple[str, ...] = ()
    start: float | None = None
    end: float | None = None
    degrees: bool = False
    namespace: str = ""


@dataclass
class _Span:
    """How many times share their set of topics, and the first and the last of them, ns."""

    count: int
    first: int
    last: int


class BagTable:
    """The columns of a bag and its rows; a row is a time at which every topic of the columns has a message.

    columns: those chosen. rows: how many. start, end: times of the first and the last row, s. notes: what was left out,
    a sentence each.

    Raises UserError if the bag does not have what is wanted.
    """

    def __init__(self, reader: BagReader, choice: Choice) -> None:
        _check_times(choice)
        self._reader, self._choice, source = reader, choice, str(reader.path)
        topics, self.notes = chosen_topics(reader, choice.topics, choice.namespace)
        spans = self._spans(topics)
        topics, apart = _in_step(topics, spans)
        if choice.topics and apart:
            raise FieldError(
                "topics",
                f"names {apart[0]}, whose times are not those of {topics[0]}; a file for each is needed",
                source,
            )
        self.notes += [f"left out: {topic}, for its times are not those of {topics[0]}" for topic in apart]
        types = {topic: reader.topics[topic] for topic in topics}
        first = {topic: reader.decoded(topic, [next(reader.read_raw(topic))[1]]) for topic in topics}
        self._forms = {topic: _form(fields) for topic, fields in first.items()}
        self._parts = chosen_parts(source, parts_of(source, types, first), choice.columns)
        self._needs = [topic for topic in topics if any(topic in part.needs for part, _ in self._parts)]
        columns = [part.columns[place] for part, places in self._parts for place in places]
        self.columns, self._factors = in_degrees(columns) if choice.degrees else (columns, np.ones(len(columns)))
        self._count(spans)

    def pieces(self) -> Iterator[tuple[FloatArray, FloatArray]]:
        """Times (s) [rows] and values [rows, columns], at most `ROWS` rows at once.

        Raises UserError if the bag is damaged, or if the messages of a topic change their names or their shape.
        """
        works = [Work() if part.energetic else None for part, _ in self._parts]
        for times, fields in self._fields():
            columns = []
            for (part, places), work in zip(self._parts, works, strict=True):
                values = part.values(fields)
                if work is not None:
                    values = np.hstack([values, work.add(times, values)])
                columns.append(values[:, places])
            yield times, np.hstack(columns) * self._factors

    def _fields(self) -> Iterator[tuple[FloatArray, Fields]]:
        """Times (s) and fields of the rows, piece by piece."""
        stamps: list[int] = []
        messages: dict[str, list[bytes]] = {topic: [] for topic in self._needs}
        for stamp, row in self._within(self._needs):
            if len(row) < len(self._needs):
                continue
            stamps.append(stamp)
            for topic, data in row.items():
                messages[topic].append(data)
            if len(stamps) == ROWS:
                yield self._decoded(stamps, messages)
                stamps, messages = [], {topic: [] for topic in self._needs}
        if stamps:
            yield self._decoded(stamps, messages)

    def _decoded(self, stamps: list[int], messages: dict[str, list[bytes]]) -> tuple[FloatArray, Fields]:
        fields = {topic: self._reader.decoded(topic, data) for topic, data in messages.items()}
        for topic, columns in fields.items():
            if _form(columns) != self._forms[topic]:
                raise UserError(
                    f"{self._reader.path}: topic {topic} has other names at {stamps[0] / 1e9:.12g} s than "
                    "at its start; the same in every message are needed"
                )
        return np.array(stamps, dtype=np.int64) / 1e9, fields

    def _within(self, topics: list[str]) -> Iterator[tuple[int, dict[str, bytes]]]:
        """The messages of topics between the first and the last time that is wanted."""
        start, end = (
            limit if value is None else round(value * 1e9)
            for value, limit in ((self._choice.start, -math.inf), (self._choice.end, math.inf))
        )
        for stamp, row in self._reader.together(topics):
            if stamp > end:
                return
            if stamp >= start:
                yield stamp, row

    def _spans(self, topics: list[str]) -> dict[frozenset[str], _Span]:
        """Set of topics -> the times at which just these have a message."""
        spans: dict[frozenset[str], _Span] = {}
        for stamp, row in self._within(topics):
            here = frozenset(row)
            if here in spans:
                spans[here].count += 1
                spans[here].last = stamp
            else:
                spans[here] = _Span(1, stamp, stamp)
        if not spans:
            raise UserError(f"{self._reader.path}: no message {_between(self._choice)}; a time that it has is needed")
        return spans

    def _count(self, spans: dict[frozenset[str], _Span]) -> None:
        """Count the rows, and the times that are not among them."""
        needs = frozenset(self._needs)
        whole = [span for topics, span in spans.items() if topics >= needs]
        if not whole:
            raise UserError(f"{self._reader.path}: {', '.join(self._needs)} share no time; common times are needed")
        self.rows = sum(span.count for span in whole)
        self.start, self.end = min(span.first for span in whole) / 1e9, max(span.last for span in whole) / 1e9
        if missing := sum(span.count for topics, span in spans.items() if topics & needs) - self.rows:
            self.notes.append(f"left out: {missing} time{'s' * (missing != 1)} at which a topic has no message")


def _form(fields: Columns) -> dict[str, object]:
    """What must be the same in all messages of a topic: its texts, and how many numbers each field has."""
    return {name: values.tolist() if values.dtype.kind == "U" else values.shape[1:] for name, values in fields.items()}


def _in_step(topics: list[str], spans: dict[frozenset[str], _Span]) -> tuple[list[str], list[str]]:
    """The topics that have their messages at the times of the first one that has any, and the others."""

    def count(*wanted: str) -> int:
        return sum(span.count for there, span in spans.items() if there.issuperset(wanted))

    first = next(topic for topic in topics if count(topic))
    inside = [topic for topic in topics if count(topic, first) > _SHARED * max(count(topic), count(first))]
    return inside, [topic for topic in topics if topic not in inside]


def _check_times(choice: Choice) -> None:
    for field, value in (("start", choice.start), ("end", choice.end)):
        if value is not None and not math.isfinite(value):
            raise FieldError(field, f"is {value:g}; a number in s is needed")
    if choice.start is not None and choice.end is not None and choice.end < choice.start:
        raise FieldError("end", f"is {choice.end:g}; a number >= {choice.start:g}, the first time, is needed")


def _between(choice: Choice) -> str:
    ends = (("from", choice.start), ("to", choice.end))
    return " ".join(f"{word} {value:g} s" for word, value in ends if value is not None)
