"""Nobody waits unseen: who waits for what, and since when, is said; and at some time waiting is given up."""

from __future__ import annotations

# What is waited for is said after so long (s), and again each time that it has taken twice as long.
SOON = 1.0
# The longest time between two looks that counts (s): whoever stands still himself has not waited.
LONGEST_LOOK = 0.5
LOOK_PERIOD = 0.25


class Watch:
    """Looks at what goes on. waited: how long nothing has (s)."""

    def __init__(self, limit: float, start: float) -> None:
        """limit: of waiting (s), after the first tick. start: how long the first tick may take unsaid (s)."""
        self._limit, self._start = limit, start
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
            self._done, self.waited, self._say_at = done, 0.0, SOON if done > 0 else self._start
            return ""
        self.waited += passed
        if self.waited < self._say_at:
            return ""
        self._say_at *= 2.0
        return f"waits for {awaited} since {self.waited:.1f} s"

    @property
    def given_up(self) -> bool:
        """Whether it has waited too long."""
        return self._done is not None and self._done > 0 and self.waited >= self._limit
