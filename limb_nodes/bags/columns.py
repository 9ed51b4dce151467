"""Many serialised messages of one type -> one array per field.

The messages of a limb have the same shape at every tick: the same names, as many numbers. The layout is therefore
worked out on the first message, and the columns are cut out of all messages at once.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
from rosbags.interfaces import Nodetype
from rosbags.typesys.store import Typestore

from limb_nodes.bags.types import fields_of

HEADER = "std_msgs/msg/Header"
TIME = "builtin_interfaces/msg/Time"
Columns = dict[str, npt.NDArray[Any]]


def columns(messages: Sequence[bytes], msgtype: str, store: Typestore) -> Columns:
    """The fields of messages as arrays; `BagReader.table` says in which shape.

    Args:
        messages: at least one, in CDR.
        msgtype: their type.
        store: knows the type.

    Raises:
        ValueError: the messages differ in shape or names.
    """
    first = messages[0]
    layout = MessageLayout(first, store)
    layout.message(msgtype, "")
    size = len(first)
    if any(len(message) != size for message in messages):
        raise ValueError("its messages differ in length, so that they make no table")
    table = np.frombuffer(b"".join(messages), dtype=np.uint8).reshape(len(messages), size)
    for start, end in layout.constant:
        if not (table[:, start:end] == table[0, start:end]).all():
            raise ValueError("its messages differ in their names or numbers of values, so that they make no table")
    arrays: Columns = {name: np.array(texts) for name, texts in layout.texts.items()}
    for name, (start, dtype, shape) in layout.numbers.items():
        width = int(np.prod(shape, dtype=np.int64)) * dtype.itemsize
        cut = np.ascontiguousarray(table[:, start : start + width])
        native = cut.view(dtype).astype(dtype.newbyteorder("="), copy=False)
        arrays[name] = native.reshape(len(messages), *shape)
    return {name: arrays[name] for name in layout.order}


class MessageLayout:
    """Walks through one message in CDR and notes at which byte each field stands.

    Args:
        data: the message.
        store: knows its type.
        elements: walk through every element of a sequence of messages, `outer[3].inner`, and note stamps as pairs of
            seconds and nanoseconds; else such a sequence holds numbers of one type only, and headers are passed over.

    Attributes:
        numbers: field -> offset in bytes, type, shape.
        texts: field -> the text, or the texts.
        constant: ranges of bytes that every message must share: lengths and texts.
        lengths: of these, the ranges that hold lengths.
        spans: text or texts -> the ranges that hold them.
        stamps: the fields in `numbers` that are stamps.
        order: the fields in the order of the definition.
    """

    def __init__(self, data: bytes, store: Typestore, *, elements: bool = False) -> None:
        self.numbers: dict[str, tuple[int, np.dtype[Any], tuple[int, ...]]] = {}
        self.texts: dict[str, str | list[str]] = {}
        self.constant: list[tuple[int, int]] = [(0, 2)]
        self.lengths: list[tuple[int, int]] = [(0, 2)]
        self.spans: dict[str, list[tuple[int, int]]] = {}
        self.stamps: set[str] = set()
        self.order: list[str] = []
        self._data = data
        self._store = store
        self._elements = elements
        if data[:2] not in (b"\0\0", b"\0\1"):
            raise ValueError("a message is not in plain CDR, which is needed")
        self._order: Literal["<", ">"] = "<" if data[1] else ">"
        self._at = 0
        self._take(4)

    def message(self, msgtype: str, prefix: str) -> None:
        """Walk through the fields of one message. Raises ValueError if it is shorter than its fields."""
        for name, (node, detail) in fields_of(msgtype, self._store):
            field = prefix + name
            if node == Nodetype.NAME:
                self._nested(detail, field)
            elif node == Nodetype.BASE:
                self._base(detail[0], field)
            else:
                (element_node, element), size = detail
                count = size if node == Nodetype.ARRAY else self._length()
                self._sequence(element_node, element, count, field)

    @property
    def end(self) -> int:
        """How many bytes of the data the fields walked through take."""
        return self._at

    def _nested(self, msgtype: str, field: str) -> None:
        if msgtype == HEADER:
            # Its stamp is the bag's time; frame_id may be any text but takes the same room.
            self._stamp(f"{field}.stamp")
            self._text("")
        elif msgtype == TIME and self._elements:
            self._stamp(field)
        else:
            self.message(msgtype, f"{field}.")

    def _stamp(self, field: str) -> None:
        self._align(4)
        start = self._take(8)
        if self._elements:
            self.numbers[field] = (start, np.dtype(f"{self._order}i4"), (2,))
            self.stamps.add(field)

    def _base(self, kind: str, field: str) -> None:
        self.order.append(field)
        if kind == "string":
            self.texts[field] = self._text(field)
        else:
            self._numbers(kind, (), field)

    def _sequence(self, node: Nodetype, element: Any, count: int, field: str) -> None:
        if node == Nodetype.BASE:
            self.order.append(field)
            if element[0] == "string":
                self.texts[field] = [self._text(field) for _ in range(count)]
            else:
                self._numbers(element[0], (count,), field)
            return
        if self._elements:
            # Every element takes a byte or more, so that a count that is too large ends at the message's end.
            for index in range(count):
                self._nested(element, f"{field}[{index}]")
            return
        parts = fields_of(element, self._store)
        kinds = {detail[0] if part == Nodetype.BASE else "" for _, (part, detail) in parts}
        if len(kinds) != 1 or kinds & {"", "string"}:
            raise ValueError(f"field {field} is a sequence of {element}, which has no place in a table")
        self.order.append(field)
        self._numbers(kinds.pop(), (count, len(parts)), field)

    def _numbers(self, kind: str, shape: tuple[int, ...], field: str) -> None:
        try:
            dtype = np.dtype(kind)
        except TypeError:
            raise ValueError(f"field {field} is of the type {kind}, which has no place in a table") from None
        total = math.prod(shape)
        if total:
            self._align(dtype.itemsize)
        self.numbers[field] = (self._take(total * dtype.itemsize), dtype.newbyteorder(self._order), shape)

    def _align(self, size: int) -> None:
        self._at += -(self._at - 4) % size

    def _take(self, size: int) -> int:
        """Pass over some bytes; where they start."""
        start, self._at = self._at, self._at + size
        if self._at > len(self._data):
            raise ValueError(f"a message is {len(self._data)} bytes long; {self._at} or more are needed, as it says")
        return start

    def _length(self) -> int:
        self._align(4)
        start = self._take(4)
        self.lengths.append((start, self._at))
        self.constant.append((start, self._at))
        return int.from_bytes(self._data[start : self._at], "little" if self._order == "<" else "big")

    def _text(self, field: str) -> str:
        size = self._length()
        start = self._take(size)
        self.constant.append((start, self._at))
        self.spans.setdefault(field, []).append((start, self._at))
        return self._data[start : self._at - 1].decode() if size else ""
