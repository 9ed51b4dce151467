"""What a node sends on a topic of a run."""

from __future__ import annotations

import struct
from collections.abc import Callable

import numpy as np

from limb_nodes.exchange.forms import Form
from limb_nodes.exchange.ticks import SECOND

STAMP, STAMP_AT = struct.Struct("<iI"), 4


def stamp_of(data: bytes) -> int:
    """The stamp (ns) of a serialised message that begins with a header."""
    sec, nanosec = STAMP.unpack_from(data, STAMP_AT)
    return int(sec * SECOND + nanosec)


def ignore(data: bytes) -> None:
    """Send a message nowhere."""


class Outgoing:
    """Messages of one topic.

    values: by field name, an array of the message's numbers that is written to. send: takes each message in CDR. The
    messages carry the identity that `identify` was told last.
    """

    def __init__(self, form: Form, nanoseconds: int) -> None:
        """nanoseconds: of one tick."""
        self.form, self.nanoseconds = form, nanoseconds
        self.send: Callable[[bytes], object] = ignore
        self._data = bytearray(form.data)
        self._stamp = np.frombuffer(self._data, dtype="<u4", count=2, offset=STAMP_AT)
        self.values = {
            name: np.frombuffer(self._data, dtype=dtype, count=count, offset=start).reshape(shape)
            for name, (start, dtype, shape, count) in form.numbers.items()
        }
        self._tick = self.values.get("tick")

    def identify(self, identity: bytes) -> None:
        """Let the messages carry the identity of a run, as `bytes_of` gives it."""
        self._data[self.form.run] = identity

    def publish(self, tick: int) -> None:
        """Send the numbers as those of a tick."""
        self._stamp[0], self._stamp[1] = divmod(tick * self.nanoseconds, SECOND)
        if self._tick is not None:
            self._tick[...] = tick
        self.send(bytes(self._data))
