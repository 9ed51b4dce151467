"""Messages that somebody else could send on the topics of a run: copies of real ones with something changed."""

from __future__ import annotations

import struct
from collections.abc import Callable

import numpy as np

from limb_nodes.exchange.forms import DOUBLE, Form
from limb_nodes.exchange.identity import bytes_of
from limb_nodes.exchange.outgoing import STAMP, STAMP_AT, stamp_of
from limb_nodes.exchange.ticks import SECOND

OTHER = "0123456789abcdef" * 2
# How far ahead a message from the future is (ticks).
AHEAD = 100

Forger = Callable[[Form, bytes, int], list[bytes]]


def stamped(form: Form, data: bytes, stamp: int) -> bytes:
    """A message with another stamp (ns)."""
    changed = bytearray(data)
    STAMP.pack_into(changed, STAMP_AT, *divmod(stamp, SECOND))
    return bytes(changed)


def at_tick(form: Form, data: bytes, tick: int, period: int) -> bytes:
    """A message with the stamp of another tick, and its number; period: ns."""
    return numbered(form, stamped(form, data, tick * period), "tick", tick)


def numbered(form: Form, data: bytes, name: str, value: int) -> bytes:
    """A message with another whole number in a field, if it has that field."""
    changed = bytearray(data)
    if name in form.numbers:
        start, dtype, _, count = form.numbers[name]
        np.frombuffer(changed, dtype, count, start)[...] = value
    return bytes(changed)


def valued(form: Form, data: bytes, change: Callable[[np.ndarray], np.ndarray | float]) -> bytes:
    """A message with other floating-point numbers."""
    changed = bytearray(data)
    for start, dtype, _, count in form.numbers.values():
        if dtype == DOUBLE:
            values = np.frombuffer(changed, dtype, count, start)
            values[...] = change(values)
    return bytes(changed)


def of_run(form: Form, data: bytes, run: bytes) -> bytes:
    """A message with other bytes in the place of the identity."""
    return data[: form.run.start] + run + data[form.run.stop :]


def moved(values: np.ndarray) -> np.ndarray:
    """Numbers that are wrong and allowed."""
    return np.where(values > 0.5, values - 0.25, values + 0.25)


def future(form: Form, data: bytes, period: int, *steps: int) -> list[bytes]:
    """Messages of later ticks, with other numbers."""
    tick = stamp_of(data) // period
    return [at_tick(form, valued(form, data, moved), tick + step, period) for step in steps]


def renamed(form: Form, data: bytes, period: int) -> list[bytes]:
    """Another letter in the first name."""
    place = form.run.stop + next(k for k, byte in enumerate(data[form.run.stop :]) if chr(byte).isalpha())
    return [data[:place] + bytes([data[place] ^ 1]) + data[place + 1 :]]


FORGERS: dict[str, Forger] = {
    "no identity": lambda form, data, period: [of_run(form, data, struct.pack("<I", 33) + b"x" * 32 + b"\0")],
    "empty identity": lambda form, data, period: [of_run(form, data, struct.pack("<IB", 1, 0))],
    "another identity": lambda form, data, period: [of_run(form, valued(form, data, moved), bytes_of(OTHER))],
    "a copy": lambda form, data, period: [data],
    "other numbers": lambda form, data, period: future(form, data, period, 0),
    "next tick": lambda form, data, period: future(form, data, period, 1),
    "the tick after the next": lambda form, data, period: future(form, data, period, 2),
    "future": lambda form, data, period: future(form, data, period, AHEAD),
    "two of the future": lambda form, data, period: future(form, data, period, AHEAD, AHEAD + 1),
    "first tick": lambda form, data, period: [at_tick(form, valued(form, data, moved), 0, period)],
    "not a number": lambda form, data, period: [valued(form, future(form, data, period, 1)[0], lambda values: np.nan)],
    "infinite": lambda form, data, period: [valued(form, future(form, data, period, 1)[0], lambda values: np.inf)],
    "huge": lambda form, data, period: [valued(form, future(form, data, period, 1)[0], lambda values: 1e308)],
    "negative": lambda form, data, period: [valued(form, future(form, data, period, 1)[0], lambda values: -0.5)],
    "cut": lambda form, data, period: [future(form, data, period, 1)[0][:-8]],
    "longer": lambda form, data, period: [future(form, data, period, 1)[0] + bytes(8)],
    "other names": renamed,
    "between ticks": lambda form, data, period: [stamped(form, data, stamp_of(data) + period // 3)],
    "before the first tick": lambda form, data, period: [stamped(form, data, -period)],
    "last tick": lambda form, data, period: [
        numbered(form, message, "last_tick", stamp_of(message) // period) for message in future(form, data, period, 1)
    ],
    "tick unlike its stamp": lambda form, data, period: [
        numbered(form, future(form, data, period, 1)[0], "tick", stamp_of(data) // period + 3)
    ],
    "a header alone": lambda form, data, period: [data[: form.run.stop]],
}
"""Kind -> the messages of it, made of a form, a real message of the topic and the nanoseconds of a tick."""
