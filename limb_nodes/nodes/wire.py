"""Messages as bytes that are filled in and read in place.

The messages of a topic differ from tick to tick in their numbers alone. Building a message object
and turning it into bytes, or back, costs several times what the transport does; here the bytes are
made once, and afterwards only the numbers in them are written or read.
"""

from __future__ import annotations

import struct
from typing import Any

import numpy as np
from rclpy.serialization import serialize_message

from limb_nodes.bags.columns import MessageLayout
from limb_nodes.bags.types import limb_typestore
from limb_nodes.nodes.identity import FRAME, LENGTH, TEXT
from limb_nodes.nodes.ticks import SECOND

STAMP, STAMP_AT = struct.Struct("<iI"), 4


def stamp_of(data: bytes) -> int:
    """The stamp (ns) of a serialised message that begins with a header."""
    sec, nanosec = STAMP.unpack_from(data, STAMP_AT)
    return int(sec * SECOND + nanosec)


def type_name(kind: type) -> str:
    """The name of a message class, such as limb_msgs/msg/JointTorque."""
    package, folder, *_ = kind.__module__.split(".")
    return f"{package}/{folder}/{kind.__name__}"


def example_in_bytes(example: Any) -> tuple[bytes, MessageLayout]:
    """A message as bytes with room for the identity of a run, and the places of its fields."""
    example.header.frame_id = "0" * LENGTH
    data = serialize_message(example)
    layout = MessageLayout(data, limb_typestore())
    layout.message(type_name(type(example)), "")
    # What rclpy appends is no part of the message, and readers of bags refuse it.
    return data[: layout.end], layout


class Outgoing:
    """Messages of one publisher.

    values: by field name, an array of the message's numbers that is written to. The messages carry the identity that
    `identify` was told last.
    """

    def __init__(self, publisher: Any, example: Any, nanoseconds: int) -> None:
        """example: a message with its names, and sequences of the right length."""
        self.publisher = publisher
        self.nanoseconds = nanoseconds
        data, layout = example_in_bytes(example)
        self._data = bytearray(data)
        self._stamp = np.frombuffer(self._data, dtype="<u4", count=2, offset=STAMP_AT)
        self.values = {
            name: np.frombuffer(
                self._data, dtype=dtype, count=int(np.prod(shape, dtype=np.int64)), offset=start
            ).reshape(shape)
            for name, (start, dtype, shape) in layout.numbers.items()
        }
        self._tick = self.values.get("tick")

    def identify(self, frame: bytes) -> None:
        """Let the messages carry the identity of a run; frame: as `frame_of` gives it."""
        self._data[FRAME] = frame

    def publish(self, tick: int) -> None:
        """Send the numbers as those of a tick."""
        self._stamp[0], self._stamp[1] = divmod(tick * self.nanoseconds, SECOND)
        if self._tick is not None:
            self._tick[...] = tick
        self.publisher.publish(bytes(self._data))


class Incoming:
    """Messages of one raw subscription.

    names: the texts of the field that names the numbers, in the message's order.
    """

    def __init__(self, kind: type, names: str, nanoseconds: int) -> None:
        self.nanoseconds = nanoseconds
        self.names: list[str] = []
        self._kind = type_name(kind)
        self._field = names
        self._size = -1
        self._constant: list[tuple[int, int, bytes]] = []
        self._numbers: dict[str, tuple[int, np.dtype[Any], int]] = {}

    def expect(self, example: Any) -> None:
        """Get ready for messages like an example, so that the first takes no longer than the others."""
        self._use(*example_in_bytes(example))

    def read(self, data: bytes) -> int:
        """Take in a message; its tick by its stamp. Raises ValueError if it is no such message."""
        if len(data) != self._size or any(data[a:b] != text for a, b, text in self._constant):
            self._learn(data)
        self._data = data
        return round(stamp_of(data) / self.nanoseconds)

    def __getitem__(self, name: str) -> np.ndarray:
        """A field of the message last read, as an array that must not be kept."""
        start, dtype, count = self._numbers[name]
        return np.frombuffer(self._data, dtype=dtype, count=count, offset=start)

    def _learn(self, data: bytes) -> None:
        """Learn the place of every field in messages of this size with these names."""
        layout = MessageLayout(data, limb_typestore())
        try:
            layout.message(self._kind, "")
        except (IndexError, UnicodeDecodeError) as problem:
            raise ValueError(f"not a {self._kind}: {problem}") from None
        self._use(data, layout)

    def _use(self, data: bytes, layout: MessageLayout) -> None:
        """Take messages to be like this one."""
        self._size = len(data)
        # Who receives a message has looked at its identity.
        constant = [(a, b) for a, b in layout.constant if (a, b) != (TEXT.start, TEXT.stop)]
        self._constant = [(a, b, data[a:b]) for a, b in joined(constant)]
        self._numbers = {
            name: (start, dtype, int(np.prod(shape, dtype=np.int64)))
            for name, (start, dtype, shape) in layout.numbers.items()
        }
        self.names = list(layout.texts[self._field])


def joined(ranges: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Ranges with those that touch made one."""
    result: list[tuple[int, int]] = []
    for start, end in ranges:
        if result and result[-1][1] == start:
            result[-1] = result[-1][0], end
        elif end > start:
            result.append((start, end))
    return result
