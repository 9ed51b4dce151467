"""Where messages of a topic are missing, told from their stamps alone."""

from __future__ import annotations

from collections import Counter

# Topics with more stretches of even stamps than this have no even stamps.
_MOST = 10_000
# Stamps further apart than so many steps have a gap between them.
_GAP = 1.5
# Stamps are rounded to such a part of a step.
_ROUNDING = 1000


class Stamps:
    """The stamps (ns) of a topic as stretches of even ones, which take as little memory as there are gaps.

    Attributes:
        first, last: the earliest and the latest.
    """

    def __init__(self, stamp: int) -> None:
        self.first = self.last = stamp
        # First stamp, step, how many.
        self._runs: list[list[int]] = [[stamp, 0, 1]]

    def add(self, stamp: int) -> None:
        """Add the stamp of the next message."""
        self.first, self.last = min(self.first, stamp), max(self.last, stamp)
        run = self._runs[-1]
        if stamp == run[0] + run[1] * run[2] and run[2] > 1:
            run[2] += 1
        elif run[2] == 1 and stamp > run[0]:
            run[1], run[2] = stamp - run[0], 2
        elif len(self._runs) <= _MOST:
            self._runs.append([stamp, 0, 1])

    @property
    def step(self) -> int:
        """The step (ns) that most stamps have to the next; 0 if they have none."""
        if len(self._runs) > _MOST:
            return 0
        steps: Counter[int] = Counter()
        for _, step, count in self._runs:
            steps[step] += count - 1
        step, count = steps.most_common(1)[0]
        return step if 2 * count >= steps.total() and count > 1 else 0

    def gaps(self, start: int | None = None, end: int | None = None) -> list[tuple[int, int, int]]:
        """Where stamps are missing: the first and the last that is (ns), and how many.

        start, end: stamps (ns) from and up to which there should be messages; None for those that are there.
        """
        step = self.step
        if not step:
            return []
        edges = []
        for first, apart, count in sorted(self._runs):
            if apart > _GAP * step:
                edges += [(first + k * apart, first + k * apart) for k in range(count)]
            else:
                edges.append((first, first + apart * (count - 1)))
        found = []
        before = 0 if start is None else (edges[0][0] - start + step // _ROUNDING) // step
        if before > 0:
            found.append((edges[0][0] - before * step, edges[0][0] - step, before))
        reached = edges[0][1]
        for first, last in edges[1:]:
            if first - reached > _GAP * step:
                count = round((first - reached) / step) - 1
                found.append((reached + step, first - step, count))
            reached = max(reached, last)
        behind = 0 if end is None else (end - reached + step // _ROUNDING) // step
        if behind > 0:
            found.append((reached + step, reached + behind * step, behind))
        return found
