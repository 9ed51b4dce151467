"""Records: named numbers and arrays of numbers side by side in memory, read by name in Python and in compiled code."""

from __future__ import annotations

from typing import Any

import numpy as np

# A numpy record: its fields are attributes, for which numpy has no types.
Record = Any


def whole_numbers(*names: str) -> np.dtype[Any]:
    """The type of a record of integers (int64)."""
    return np.dtype([(name, np.int64) for name in names])


def new_record(kind: np.dtype[Any]) -> Record:
    """A record of a type, all numbers zero."""
    return np.zeros(1, dtype=kind).view(np.recarray)[0]


def copy_record(record: Record) -> Record:
    """A record of the same numbers."""
    twin = new_record(record.dtype)
    for name in record.dtype.names:
        twin[name] = record[name]
    return twin
