"""Which field of which topic of a bag holds the channels, and what names them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from limb_nodes.errors import FieldError, UserError
from limb_nodes.foundation.topics import TOPIC_TYPES

if TYPE_CHECKING:
    from limb_nodes.bags.read import BagReader

Rows = Literal["samples", "channels"]
Stamps = Literal["header", "received"]
_FLOATS = ("float32", "float64")
_NUMBERS = (*_FLOATS, *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)))
_NAMES = {
    "name",
    "names",
    "label",
    "labels",
    "channel",
    "channels",
    "channel_name",
    "channel_names",
    "muscle",
    "muscles",
}
_MOST_LISTED = 12


@dataclass(frozen=True)
class BagOptions:
    """What a person may say of a bag of channels; None, or empty, leaves a decision to the program.

    topic: absolute, or the end of it. field: path of the field of values in a message, `outer.inner`.
    names: one per channel, if the messages have none.
    stamps: times of the samples: the stamps in the messages, or the times of reception.
    rows: in a message that holds several samples, whether one sample stands after the other, or one channel.
    """

    topic: str | None = None
    field: str | None = None
    names: Sequence[str] = ()
    stamps: Stamps | None = None
    rows: Rows | None = None


@dataclass(frozen=True)
class BagField:
    """A field of numbers on a topic.

    topic: its absolute name. path: of the field. kind: of its values, such as `float64[]`.
    names: path of the texts that name the channels, or None. layout: path of a MultiArrayLayout that says how the
    values stand, or None. stamp: path of the message's stamp, or None. tick: path of a counter, or None.
    """

    topic: str
    path: str
    kind: str
    names: str | None
    layout: str | None
    stamp: str | None
    tick: str | None

    @property
    def paths(self) -> list[str]:
        """The fields to read."""
        parts = ("dim.label", "dim.size", "dim.stride", "data_offset") if self.layout else ()
        others = [path for path in (self.names, self.stamp, self.tick) if path]
        return [self.path, *others, *(f"{self.layout}.{part}" for part in parts)]


def choose(reader: BagReader, topics: Sequence[str], options: BagOptions) -> tuple[BagField, tuple[str, ...]]:
    """The field to read, and a note if it is none that was asked for.

    topics: the first of these that has a message is read if no topic is given.

    Raises UserError if the bag has no such field; FieldError if several could be meant.
    """
    wanted = (options.topic,) if options.topic else topics
    topic = next((topic for topic in wanted if reader.has(topic)), None)
    if topic is not None:
        return _on_topic(reader, topic, options), ()
    every = [field for name in reader.topics for field in _candidates(reader, name)]
    if options.field is not None:
        every = [field for field in every if field.path == options.field]
    said = f"no message on {' or '.join(wanted)}"
    if not every:
        raise UserError(f"{reader.path}: {said}; the bag has {_listed(list(reader.topics)) or 'no topic'}")
    # A limb's own topics, such as envelopes where raw EMG is wanted, are another thing unless they are asked for.
    own = every[0].topic.rpartition("/")[2] in TOPIC_TYPES
    if len(every) > 1 or options.topic or own:
        raise FieldError(
            "topic",
            f"is {options.topic}, on which there is no message; {_one_of(every)} is needed"
            if options.topic
            else f"is missing, for there is {said}; {_one_of(every)} is needed",
            str(reader.path),
        )
    return every[0], (f"read from the topic {every[0].topic}, field {every[0].path}",)


def _on_topic(reader: BagReader, topic: str, options: BagOptions) -> BagField:
    """The field that is meant on a topic."""
    kinds = reader.kinds(topic)
    name = reader.name(topic)
    if options.field is not None:
        kind = kinds.get(options.field)
        if kind is None or kind.partition("[")[0] not in _NUMBERS or kind.endswith("[][][]"):
            numbers = _numbers(kinds)
            is_kind = f"is {options.field}" + (f", which holds {kind}" if kind else "")
            raise FieldError(
                "field", f"{is_kind}; a field of numbers of {name} is needed: {_listed(numbers)}", str(reader.path)
            )
        return _field(name, options.field, kinds)
    fields = _candidates(reader, name) or [_field(name, path, kinds) for path in _float_arrays(kinds)]
    if not fields:
        numbers = _numbers(kinds)
        raise FieldError(
            "field",
            f"is missing: {name} ({reader.topics[name]}) has no array of floats; "
            + (f"one of {_listed(numbers)} is needed" if numbers else "another topic is needed"),
            str(reader.path),
        )
    if len(fields) > 1:
        raise FieldError("field", f"is missing; {_one_of(fields)} is needed", str(reader.path))
    return fields[0]


def _candidates(reader: BagReader, topic: str) -> list[BagField]:
    """The arrays of floats on a topic that have values and whose channels have names, or a layout."""
    try:
        kinds = reader.kinds(topic)
        fields = [_field(topic, path, kinds) for path in _float_arrays(kinds)]
        fields = [field for field in fields if field.names or field.layout]
        if not fields or not reader.has(topic):
            return []
        _, first = reader.blocks(topic, {path for field in fields for path in field.paths}, most=1)
    except UserError:
        return []
    return [field for field in fields if field.path in first[0].numbers and first[0].numbers[field.path].size]


def _numbers(kinds: dict[str, str]) -> list[str]:
    return [path for path, kind in kinds.items() if kind.partition("[")[0] in _NUMBERS]


def _float_arrays(kinds: dict[str, str]) -> list[str]:
    return [
        path for path, kind in kinds.items() if kind in {f"{one}{end}" for one in _FLOATS for end in ("[]", "[][]")}
    ]


def _field(topic: str, path: str, kinds: dict[str, str]) -> BagField:
    parent = path.rpartition(".")[0]
    beside = f"{parent}." if parent else ""
    layout = f"{beside}layout" if kinds.get(f"{beside}layout.dim.size") == "uint32[]" else None
    texts = [name for name, kind in kinds.items() if kind == "string[]" and not name.endswith("layout.dim.label")]
    near = [name for name in texts if name.rpartition(".")[0] == parent] or texts
    if len(near) > 1:
        near = [name for name in near if name.rpartition(".")[2] in _NAMES]
    stamps = sorted(
        (name for name, kind in kinds.items() if kind == "time"), key=lambda name: not name.endswith(".stamp")
    )
    tick = "tick" if kinds.get("tick", "").startswith(("int", "uint")) and "[" not in kinds["tick"] else None
    names = near[0] if len(near) == 1 else None
    return BagField(topic, path, kinds[path], names, layout, stamps[0] if stamps else None, tick)


def _one_of(fields: Sequence[BagField]) -> str:
    """Topics and fields, to choose from."""
    by_topic: dict[str, list[str]] = {}
    for field in fields:
        by_topic.setdefault(field.topic, []).append(field.path)
    entries = [
        f"{topic} (field{'s' if len(paths) > 1 else ''} {', '.join(paths[:_MOST_LISTED])})"
        for topic, paths in by_topic.items()
    ]
    return f"one of {_listed(entries)}"


def _listed(entries: Sequence[str]) -> str:
    rest = len(entries) - _MOST_LISTED
    return ", ".join(entries[:_MOST_LISTED]) + (f" and {rest} more" if rest > 0 else "")
