"""The identity of a run: its nodes agree on it before tick 0, and every message of the run carries it.

It stands in `header.frame_id`, the one field that all these messages share; joint angles and torques have no frame.
What carries another identity belongs to another run.
"""

from __future__ import annotations

import re
import struct
import uuid

LENGTH = 32
FORM = f"{LENGTH} hexadecimal digits"
# Where a serialised message that begins with a header holds the length of its frame_id, the text and the zero after it.
FRAME = slice(12, 12 + 4 + LENGTH + 1)
TEXT = slice(FRAME.start + 4, FRAME.stop)


def new_identity() -> str:
    """An identity that no other run has."""
    return uuid.uuid4().hex


def is_identity(text: str) -> bool:
    """Whether a text has the form of an identity."""
    return re.fullmatch(f"[0-9a-f]{{{LENGTH}}}", text) is not None


def frame_of(identity: str) -> bytes:
    """The frame_id of a run's messages, as bytes of the message: length, text, zero."""
    return struct.pack("<I", LENGTH + 1) + identity.encode() + b"\0"


def identity_of(frame: bytes) -> str:
    """The identity in such bytes; empty if they hold none."""
    text = frame[4:-1].decode("ascii", "replace")
    return text if is_identity(text) and frame == frame_of(text) else ""
