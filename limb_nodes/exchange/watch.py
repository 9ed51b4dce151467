"""Nobody waits unseen: who waits for what, and since when, is said; and at some time waiting is given up."""

from __future__ import annotations

from limb_nodes.foundation.parameter import Parameter

STALL = Parameter("stall_limit", "s", "how long a run may wait for a tick", minimum=1.0, maximum=1e9)
STALL_LIMIT = 30.0
# What is waited for is said after so long (s), and again each time that it has taken twice as long.
SOON = 1.0
# The longest time between two looks that counts (s): whoever stands still himself has not waited.
LONGEST_LOOK = 0.5
LOOK_PERIOD = 0.25


class Watch:
    """Looks at what goes on. waited: how long nothing has (s)."""

    def __init__(self, limit: float, start: float, soon: float = SOON, *, patient: bool = True) -> None:
        """limit: of waiting. start, soon: how long the first tick and others may take unsaid (s).

        patient: whether the first tick may take longer than the limit.
        """
        self._limit, self._start, self._soon, self._patient = limit, start, soon, patient
        self.waited = 0.0
        self._say_at = start
        self._done: int | None = None
        self._looked: float | None = None

    def look(self, now: float, done: int, awaited: str) -> str:
        """What is to be said now, mostly nothing.

        now: s. done: a number that grows as long as it goes on, greater than 0 once it has begun. awaited: what is
        waited for and from whom; empty if nothing is.
        """
        passed = 0.0 if self._looked is None else min(now - self._looked, LONGEST_LOOK)
        self._looked = now
        if done != self._done or not awaited:
            self._done, self.waited, self._say_at = done, 0.0, self._soon if done > 0 else self._start
            return ""
        self.waited += passed
        if self.waited < self._say_at:
            return ""
        self._say_at *= 2.0
        return f"waits for {awaited} since {self.waited:.1f} s"

    @property
    def given_up(self) -> bool:
        """Whether it has waited too long."""
        return self._done is not None and (self._done > 0 or not self._patient) and self.waited >= self._limit
