"""Many serialised messages of one type -> one array per field.

The messages of a limb have the same shape at every tick: the same names, as many numbers. The layout is therefore
worked out on the first message, and the columns are cut out of all messages at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
from rosbags.interfaces import Nodetype
from rosbags.typesys.store import Typestore

from limb_nodes.bags.types import fields_of

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

    Attributes:
        numbers: field -> offset in bytes, type, shape.
        texts: field -> the text, or the texts.
        constant: ranges of bytes that every message must share: lengths and texts.
        order: the fields in the order of the definition.
    """

    def __init__(self, data: bytes, store: Typestore) -> None:
        self.numbers: dict[str, tuple[int, np.dtype[Any], tuple[int, ...]]] = {}
        self.texts: dict[str, str | list[str]] = {}
        self.constant: list[tuple[int, int]] = [(0, 2)]
        self.order: list[str] = []
        self._data = data
        self._store = store
        self._order: Literal["<", ">"] = "<" if data[1] & 1 else ">"
        self._at = 4

    def message(self, msgtype: str, prefix: str) -> None:
        """Walk through the fields of one message."""
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
        if msgtype == "std_msgs/msg/Header":
            # Its stamp is the bag's time; frame_id may be any text but takes the same room.
            self._align(4)
            self._at += 8
            self._text()
        else:
            self.message(msgtype, f"{field}.")

    def _base(self, kind: str, field: str) -> None:
        self.order.append(field)
        if kind == "string":
            self.texts[field] = self._text()
        else:
            self._numbers(np.dtype(kind), (), field)

    def _sequence(self, node: Nodetype, element: Any, count: int, field: str) -> None:
        if node == Nodetype.BASE:
            self.order.append(field)
            if element[0] == "string":
                self.texts[field] = [self._text() for _ in range(count)]
            else:
                self._numbers(np.dtype(element[0]), (count,), field)
            return
        parts = fields_of(element, self._store)
        kinds = {detail[0] if part == Nodetype.BASE else "" for _, (part, detail) in parts}
        if len(kinds) != 1 or kinds & {"", "string"}:
            raise ValueError(f"field {field} is a sequence of {element}, which has no place in a table")
        self.order.append(field)
        self._numbers(np.dtype(kinds.pop()), (count, len(parts)), field)

    def _numbers(self, dtype: np.dtype[Any], shape: tuple[int, ...], field: str) -> None:
        total = int(np.prod(shape, dtype=np.int64))
        if total:
            self._align(dtype.itemsize)
        self.numbers[field] = (self._at, dtype.newbyteorder(self._order), shape)
        self._at += total * dtype.itemsize

    def _align(self, size: int) -> None:
        self._at += -(self._at - 4) % size

    def _length(self) -> int:
        self._align(4)
        start, self._at = self._at, self._at + 4
        self.constant.append((start, self._at))
        return int(np.frombuffer(self._data, dtype=f"{self._order}u4", count=1, offset=start)[0])

    def _text(self) -> str:
        size = self._length()
        start, self._at = self._at, self._at + size
        self.constant.append((start, self._at))
        return self._data[start : self._at - 1].decode() if size else ""
