"""How a node does: counts over a window of time, and how long its steps take."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Mapping

import numpy as np

# How long something that has gone wrong is told of (s).
WINDOW = 10.0
# Of how many steps the times are known.
STEPS = 4096


class Counts:
    """Counts that only grow, and by how much they have grown lately."""

    def __init__(self) -> None:
        self._seen: deque[tuple[float, dict[str, int]]] = deque()

    def lately(self, counts: Mapping[str, int]) -> dict[str, int]:
        """By how much each has grown in the last `WINDOW` s; looks are to come more often than that."""
        now = time.monotonic()
        self._seen.append((now, dict(counts)))
        while len(self._seen) > 2 and now - self._seen[1][0] >= WINDOW:
            self._seen.popleft()
        before = self._seen[0][1] if len(self._seen) > 1 else dict.fromkeys(counts, 0)
        return {name: count - before.get(name, 0) for name, count in counts.items()}


class Steps:
    """The times of the last steps of a node."""

    def __init__(self) -> None:
        self._times = np.zeros(STEPS)
        self.count = 0

    def add(self, seconds: float) -> None:
        """Keep a time (s)."""
        self._times[self.count % STEPS] = seconds
        self.count += 1

    def told(self, what: str) -> dict[str, str]:
        """Median, 99th percentile and greatest of the times, in ms; nothing before the first."""
        if not self.count:
            return {}
        times = 1e3 * self._times[: self.count]
        return {
            f"{what}_median_ms": f"{np.median(times):.3f}",
            f"{what}_p99_ms": f"{np.percentile(times, 99):.3f}",
            f"{what}_worst_ms": f"{times.max():.3f}",
        }
