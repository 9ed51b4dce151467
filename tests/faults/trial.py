"""What became of one fault."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Trial:
    """One fault and what became of it.

    what: the fault, with what is needed to try it again (a seed, a file, a command). lost: of what had been recorded
    before the fault (s). changed: whether a value differs from that of an undisturbed run and nothing says so.
    said: how long it took until a person could read of it (s); None if there was nothing to say. traceback: whether
    one was printed. hung: whether it stood still for over 5 s without a word. ran_code: whether code of a file ran
    without consent.
    """

    what: str
    lost: float = 0.0
    changed: bool = False
    said: float | None = None
    traceback: bool = False
    hung: bool = False
    ran_code: bool = False

    @property
    def good(self) -> bool:
        """Whether the fault did no harm."""
        return not (self.changed or self.traceback or self.hung or self.ran_code) and self.lost <= 0.5
