"""Write a whole topic at once: many messages that differ only in their numbers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from limb_nodes.bags.columns import Layout
from limb_nodes.bags.types import TOPIC_TYPES, limb_typestore, make_message
from limb_nodes.bags.write import BagWriter
from limb_nodes.foundation.arrays import IntArray

SECOND = 1_000_000_000


def write_table(
    writer: BagWriter,
    topic: str,
    stamps: IntArray,
    texts: Mapping[str, Any],
    numbers: Mapping[str, npt.NDArray[Any]],
) -> None:
    """Write one message per stamp.

    Args:
        stamps: [ticks], ns.
        texts: the fields that are the same in every message, such as names.
        numbers: the other fields, [ticks] or [ticks, ...]; points as [ticks, n, 3].
    """
    msgtype = TOPIC_TYPES[topic]
    store = limb_typestore()
    first = {name: example(msgtype, name, values[0]) for name, values in numbers.items()}
    message = make_message(msgtype, 0, **texts, **first)
    data = bytes(store.serialize_cdr(message, msgtype))
    layout = Layout(data, store)
    layout.message(msgtype, "")
    rows = np.tile(np.frombuffer(data, dtype=np.uint8), (len(stamps), 1))
    put(rows, 4, (stamps // SECOND).astype("<i4"))
    put(rows, 8, (stamps % SECOND).astype("<u4"))
    for name, values in numbers.items():
        start, dtype, _ = layout.numbers[name]
        put(rows, start, np.asarray(values).astype(dtype))
    whole, size = rows.tobytes(), len(data)
    messages = (whole[start : start + size] for start in range(0, len(whole), size))
    writer.write_many(topic, zip(stamps.tolist(), messages, strict=True), msgtype)


def example(msgtype: str, name: str, value: Any) -> Any:
    """The first value of a field in the form that a message takes."""
    if name == "position" and msgtype.endswith("MovementPattern"):
        return [make_message("geometry_msgs/msg/Point", x=x, y=y, z=z) for x, y, z in value]
    return value.item() if np.ndim(value) == 0 else np.ascontiguousarray(value)


def put(rows: npt.NDArray[np.uint8], start: int, values: npt.NDArray[Any]) -> None:
    """Overwrite the bytes of a field in all rows."""
    flat = np.ascontiguousarray(values).reshape(len(rows), -1).view(np.uint8)
    rows[:, start : start + flat.shape[1]] = flat
