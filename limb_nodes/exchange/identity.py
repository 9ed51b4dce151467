"""The identity of a run: its nodes agree on it before tick 0, and every message of the run carries it.

It stands in the field `run`. What carries another identity belongs to another run.
"""

from __future__ import annotations

import re
import struct
import uuid

LENGTH = 32
FORM = f"{LENGTH} hexadecimal digits"
# How many bytes of a serialised message it takes: length, text, zero.
BYTES = 4 + LENGTH + 1


def new_identity() -> str:
    """An identity that no other run has."""
    return uuid.uuid4().hex


def is_identity(text: str) -> bool:
    """Whether a text has the form of an identity."""
    return re.fullmatch(f"[0-9a-f]{{{LENGTH}}}", text) is not None


def bytes_of(identity: str) -> bytes:
    """An identity as bytes of a message: length, text, zero."""
    return struct.pack("<I", LENGTH + 1) + identity.encode() + b"\0"


def identity_of(data: bytes) -> str:
    """The identity in such bytes; empty if they hold none."""
    text = data[4:-1].decode("ascii", "replace")
    return text if is_identity(text) and data == bytes_of(text) else ""
