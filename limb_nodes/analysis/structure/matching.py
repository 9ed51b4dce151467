"""Which equations determine which unknowns: maximum matching and the Dulmage-Mendelsohn parts."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import maximum_bipartite_matching

Node = TypeVar("Node", bound=Hashable)


@dataclass(frozen=True)
class Parts(Generic[Node]):
    """Coarse Dulmage-Mendelsohn decomposition.

    over: equations and unknowns of the part with too many equations; under: of the part with too few. All four are
    empty if every equation can be matched with an unknown of its own and no unknown is left.
    """

    over: tuple[tuple[int, ...], tuple[Node, ...]]
    under: tuple[tuple[int, ...], tuple[Node, ...]]

    @property
    def singular(self) -> bool:
        """Whether there is no one-to-one matching."""
        return any((*self.over, *self.under))


def dulmage_mendelsohn(equations: Sequence[Sequence[Node]], unknowns: Sequence[Node]) -> Parts[Node]:
    """The over- and under-determined parts of equations given by the unknowns that occur in each.

    A. L. Dulmage and N. S. Mendelsohn, Canad. J. Math. 10 (1958) 517.
    """
    column = {unknown: j for j, unknown in enumerate(unknowns)}
    rows = [[column[node] for node in equation] for equation in equations]
    columns: list[list[int]] = [[] for _ in unknowns]
    for i, row in enumerate(rows):
        for j in row:
            columns[j].append(i)
    partner_row, partner_column = matching(rows, len(unknowns))

    def reached(start: list[int], near: list[list[int]], back: list[int]) -> tuple[list[int], list[int]]:
        """Nodes on alternating paths from unmatched nodes of one side, and those of the other side."""
        seen, others, waiting = set(start), set(), list(start)
        while waiting:
            for other in near[waiting.pop()]:
                if other not in others:
                    others.add(other)
                    if back[other] >= 0 and back[other] not in seen:
                        seen.add(back[other])
                        waiting.append(back[other])
        return sorted(seen), sorted(others)

    over = reached([i for i, j in enumerate(partner_row) if j < 0], rows, partner_column)
    under = reached([j for j, i in enumerate(partner_column) if i < 0], columns, partner_row)
    return Parts(
        (tuple(over[0]), tuple(unknowns[j] for j in over[1])),
        (tuple(under[1]), tuple(unknowns[j] for j in under[0])),
    )


def matching(rows: Sequence[Sequence[int]], columns: int) -> tuple[list[int], list[int]]:
    """A maximum matching: the column of each row and the row of each column, -1 if there is none."""
    if not rows or not columns:
        return [-1] * len(rows), [-1] * columns
    indices = np.array([j for row in rows for j in row], dtype=np.int32)
    starts = np.cumsum([0, *(len(row) for row in rows)], dtype=np.int32)
    graph = csr_array((np.ones(len(indices), dtype=np.int8), indices, starts), shape=(len(rows), columns))
    partner_row = [int(j) for j in maximum_bipartite_matching(graph, perm_type="column")]
    partner_column = [-1] * columns
    for i, j in enumerate(partner_row):
        if j >= 0:
            partner_column[j] = i
    return partner_row, partner_column
