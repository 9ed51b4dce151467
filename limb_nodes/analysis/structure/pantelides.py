"""The structural index: how often each equation must be differentiated, after Pantelides.

C. C. Pantelides, The consistent initialization of differential-algebraic systems, SIAM J. Sci. Stat. Comput. 9 (1988)
213. The index that follows from the numbers of differentiations is that of J. D. Pryce, BIT 41 (2001) 364: the
greatest number, and one more if an unknown is then still algebraic. So ordinary differential equations have index
0, algebraic equations and semi-explicit systems that can be solved for their algebraic unknowns have index 1.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

Node = TypeVar("Node", bound=Hashable)


@dataclass(frozen=True)
class Offsets(Generic[Node]):
    """Outcome of the algorithm.

    times: how often each equation is differentiated. highest: the derivative of each unknown that is then solved for.
    solved: the equation that is matched with each unknown.
    constraints: at every failure to match, the equations that together held fewer highest derivatives than there are
    equations, and these derivatives; both with the number of differentiations so far.
    """

    times: tuple[int, ...]
    highest: Mapping[Node, int]
    solved: Mapping[Node, int]
    constraints: tuple[tuple[tuple[tuple[int, int], ...], tuple[tuple[Node, int], ...]], ...]

    @property
    def index(self) -> int:
        """The structural index."""
        if not self.times:
            return 0
        return max(self.times) + (0 if all(self.highest.values()) else 1)

    @property
    def free_initial_values(self) -> int:
        """How many initial values may be chosen: all derivatives below the highest, less the constraints on them."""
        return sum(self.highest.values()) - sum(self.times)


def pantelides(equations: Sequence[Mapping[Node, int]]) -> Offsets[Node]:
    """Differentiate until every equation is matched with the highest derivative of an unknown of its own.

    equations: the unknowns of each equation with the highest derivative that occurs in it; an unknown that stands
    first is matched first. The equations must have a one-to-one matching with the unknowns when derivatives are not
    told apart (see `dulmage_mendelsohn`), or the algorithm would not end; ValueError otherwise.
    """
    highest: dict[Node, int] = {}
    for equation in equations:
        for node, order in equation.items():
            highest[node] = max(order, highest.get(node, 0))
    if len(highest) != len(equations):
        raise ValueError(f"{len(equations)} equations for {len(highest)} unknowns")
    times = [0] * len(equations)
    solved: dict[Node, int] = {}
    constraints = []
    limit = sum(highest.values()) + len(equations)
    for start in range(len(equations)):
        for _ in range(limit + 2):
            matched, rows, nodes = augment(start, equations, times, highest, solved)
            if matched:
                break
            at_times = tuple((row, times[row]) for row in sorted(rows))
            constraints.append((at_times, tuple((node, highest[node]) for node in nodes)))
            for node in nodes:
                highest[node] += 1
            for row in rows:
                times[row] += 1
        else:
            raise ValueError("structurally singular")
    return Offsets(tuple(times), highest, solved, tuple(constraints))


def augment(
    start: int,
    equations: Sequence[Mapping[Node, int]],
    times: Sequence[int],
    highest: Mapping[Node, int],
    solved: dict[Node, int],
) -> tuple[bool, list[int], list[Node]]:
    """Match the equation `start`, rearranging others on the way; else the equations and unknowns that were reached."""
    came_from: dict[Node, int] = {}
    rows, waiting = [start], [start]
    reached: dict[int, Node] = {}
    while waiting:
        row = waiting.pop()
        tight = [n for n, order in equations[row].items() if order + times[row] == highest[n] and n not in came_from]
        for node in tight:
            came_from[node] = row
        free = next((node for node in tight if node not in solved), None)
        if free is not None:
            node = free
            while True:
                row = came_from[node]
                solved[node] = row
                if row == start:
                    return True, [], []
                node = reached[row]
        for node in reversed(tight):
            other = solved[node]
            reached[other] = node
            rows.append(other)
            waiting.append(other)
    return False, rows, list(came_from)
