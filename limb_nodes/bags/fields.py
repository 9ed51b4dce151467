"""Chosen fields of many serialised messages, which may differ in shape, as arrays."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from rosbags.interfaces import Nodetype
from rosbags.typesys.store import Typestore

from limb_nodes.bags.columns import TIME, MessageLayout
from limb_nodes.bags.types import fields_of
from limb_nodes.foundation.arrays import IntArray

MOST_SHAPES = 1000
_DEEPEST = 8
_ELEMENT = re.compile(r"\[\d+\]")


@dataclass(frozen=True)
class Block:
    """Messages of one shape and with the same texts.

    Attributes:
        rows: which messages of the topic these are, [messages], rising.
        numbers: path of a field -> [messages] for a number, [messages, n] for a sequence of numbers or of messages
            that hold a number, [messages, n, k] for a sequence of messages that hold k numbers each; a stamp is
            [messages] in ns.
        texts: path of a field -> its text or texts, the same in all these messages. A sequence without elements is in
            neither.
    """

    rows: IntArray
    numbers: dict[str, npt.NDArray[Any]]
    texts: dict[str, tuple[str, ...]]


def kinds(msgtype: str, store: Typestore) -> dict[str, str]:
    """The fields of a type by their path, `outer.inner`: `float64`, `string[]`, `float32[][]` and so on.

    A stamp is a `time`. A sequence of messages adds a [] to each of their fields; one within another is left out.
    """
    return dict(_kinds(msgtype, store, "", "", 0))


def _kinds(msgtype: str, store: Typestore, prefix: str, brackets: str, depth: int) -> Iterator[tuple[str, str]]:
    if depth > _DEEPEST or msgtype not in store.fielddefs:
        return
    for name, (node, detail) in fields_of(msgtype, store):
        field, end = prefix + name, brackets
        if node in (Nodetype.ARRAY, Nodetype.SEQUENCE):
            node, detail = detail[0]
            end += "[]"
        if node == Nodetype.BASE:
            yield field, detail[0] + end
        elif detail == TIME:
            yield field, "time" + end
        elif end != "[][]":
            yield from _kinds(detail, store, f"{field}.", end, depth + 1)


def blocks(
    messages: Sequence[bytes], msgtype: str, store: Typestore, paths: Collection[str], first: int = 0
) -> list[Block]:
    """Some fields of messages.

    Args:
        messages: at least one, in CDR.
        msgtype: their type.
        store: knows the type.
        paths: the fields, as `kinds` names them.
        first: the number of the first message.

    Raises:
        ValueError: a message is shorter than it says, or there are too many shapes.
    """
    by_size: dict[int, list[int]] = {}
    for row, message in enumerate(messages):
        by_size.setdefault(len(message), []).append(row)
    result: list[Block] = []
    for size, same in by_size.items():
        table = np.frombuffer(b"".join(messages[row] for row in same), dtype=np.uint8).reshape(len(same), size)
        rows = np.array(same, dtype=np.int64) + first
        while len(rows):
            if len(result) == MOST_SHAPES:
                raise ValueError(f"its messages have more than {MOST_SHAPES} different shapes or names")
            layout = MessageLayout(table[0].tobytes(), store, elements=True)
            layout.message(msgtype, "")
            alike = np.ones(len(rows), dtype=np.bool_)
            names = [span for field, spans in layout.spans.items() if _path(field) in paths for span in spans]
            for start, end in layout.lengths + names:
                alike &= (table[:, start:end] == table[0, start:end]).all(axis=1)
            result.append(Block(rows[alike], _numbers(layout, table[alike], paths), _texts(layout, paths)))
            rows, table = rows[~alike], table[~alike]
    return result


def _path(field: str) -> str:
    """The path of a field in any element of a sequence."""
    return _ELEMENT.sub("", field)


def _numbers(
    layout: MessageLayout, table: npt.NDArray[np.uint8], paths: Collection[str]
) -> dict[str, npt.NDArray[Any]]:
    """Cut fields out of messages of one shape; table: [messages, bytes]."""
    parts: dict[str, list[npt.NDArray[Any]]] = {}
    for field, (start, dtype, shape) in layout.numbers.items():
        path = _path(field)
        if path not in paths:
            continue
        width = math.prod(shape) * dtype.itemsize
        cut = np.ascontiguousarray(table[:, start : start + width]).view(dtype).astype(dtype.newbyteorder("="))
        values = cut.reshape(len(table), *shape)
        if field in layout.stamps:
            values = values[:, 0].astype(np.int64) * 1_000_000_000 + values[:, 1]
        parts.setdefault(path, []).append(values if path == field else values[:, np.newaxis])
    for path, values_of in parts.items():
        if len({values.shape for values in values_of}) > 1:
            raise ValueError(f"the elements of {path} hold different numbers of values; as many in each are needed")
    return {path: np.concatenate(one, axis=1) if len(one) > 1 else one[0] for path, one in parts.items()}


def _texts(layout: MessageLayout, paths: Collection[str]) -> dict[str, tuple[str, ...]]:
    parts: dict[str, tuple[str, ...]] = {}
    for field, text in layout.texts.items():
        if (path := _path(field)) in paths:
            parts[path] = parts.get(path, ()) + ((text,) if isinstance(text, str) else tuple(text))
    return parts
