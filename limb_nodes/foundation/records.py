"""Records: named numbers and arrays of numbers side by side in memory, read by name in Python and in compiled code."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np


class Record:
    """Named fields, each an attribute: an array, of a single number an array [1]; all of them are zero at first.

    address: of the numbers, for compiled code; the record must live for as long as that reads them.
    """

    def __init__(self, kind: np.dtype[Any]) -> None:
        self.kind = kind
        self._memory = np.zeros(1, kind)
        self.address = int(self._memory.ctypes.data)
        for name in kind.names or ():
            field = self._memory[name]
            view = field[0] if field.ndim > 1 else field
            self.__dict__[name] = view.view(np.recarray) if view.dtype.names else view

    def copy(self) -> Record:
        """A record of the same numbers."""
        twin = Record(self.kind)
        twin._memory[:] = self._memory
        return twin

    def tobytes(self) -> bytes:
        """All its numbers."""
        return self._memory.tobytes()

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any: ...


def whole_numbers(*names: str) -> np.dtype[Any]:
    """The type of a record of integers (int64)."""
    return np.dtype([(name, np.int64) for name in names])
