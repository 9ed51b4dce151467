"""Write a whole topic at once: many messages that differ only in their numbers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
from rosbags.interfaces import Nodetype

from limb_nodes.bags.columns import MessageLayout
from limb_nodes.bags.types import fields_of, limb_typestore, make_message
from limb_nodes.bags.write import BagWriter
from limb_nodes.foundation.arrays import IntArray

SECOND = 1_000_000_000


def write_table(
    writer: BagWriter,
    topic: str,
    msgtype: str,
    stamps: IntArray,
    same: Mapping[str, Any],
    numbers: Mapping[str, npt.NDArray[Any]],
) -> None:
    """Write one message per stamp.

    Args:
        writer: the open bag.
        topic: relative to the namespace, or absolute.
        msgtype: a type with a header, for example `limb_msgs/msg/JointTorque`.
        stamps: [messages], ns; at least one.
        same: the fields that are the same in every message, such as names.
        numbers: the other fields, [messages] or [messages, n]; points as [messages, n, 3].

    Raises:
        UserError: the bag can't be written, for example because the disk is full.
    """
    store = limb_typestore()
    first = {name: _field_value(msgtype, name, values[0]) for name, values in numbers.items()}
    data = bytes(store.serialize_cdr(make_message(msgtype, 0, **same, **first), msgtype))
    layout = MessageLayout(data, store)
    layout.message(msgtype, "")
    rows = np.tile(np.frombuffer(data, dtype=np.uint8), (len(stamps), 1))
    _put(rows, 4, (stamps // SECOND).astype("<i4"))
    _put(rows, 8, (stamps % SECOND).astype("<u4"))
    for name, values in numbers.items():
        start, dtype, _ = layout.numbers[name]
        _put(rows, start, np.asarray(values).astype(dtype))
    whole, size = rows.tobytes(), len(data)
    messages = (whole[start : start + size] for start in range(0, len(whole), size))
    writer.write_many(topic, zip(stamps.tolist(), messages, strict=True), msgtype)


def _field_value(msgtype: str, name: str, value: Any) -> Any:
    """Numbers in the form that a field of a message takes: [n, k] as n messages of k numbers, such as points."""
    store = limb_typestore()
    node, detail = dict(fields_of(msgtype, store))[name]
    if node in (Nodetype.ARRAY, Nodetype.SEQUENCE) and detail[0][0] == Nodetype.NAME:
        element = detail[0][1]
        fields = [field for field, _ in fields_of(element, store)]
        return [make_message(element, **dict(zip(fields, row, strict=True))) for row in value.tolist()]
    return value.item() if np.ndim(value) == 0 else np.ascontiguousarray(value)


def _put(rows: npt.NDArray[np.uint8], start: int, values: npt.NDArray[Any]) -> None:
    """Overwrite the bytes of a field in all rows."""
    flat = np.ascontiguousarray(values).reshape(len(rows), -1).view(np.uint8)
    rows[:, start : start + flat.shape[1]] = flat
