"""The structure matrix as the report prints it: equations in rows, variables in columns.

Motor units, muscles, joints and the components of vectors that have the same equations share rows and columns.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from limb_nodes.analysis.structure.relations import EquationSet
from limb_nodes.analysis.structure.symbols import symbol

DEFINES, USES, OFFERED = "defines", "uses", "offered"
MARKS = {DEFINES: "⊗", USES: "×", OFFERED: "(×)"}


@dataclass(frozen=True)
class Matrix:
    """rows: labels of the equations. columns: symbols of the variables; those in `external` are given from outside.

    entries: by row and column `defines`, `uses`, or `offered` for a variable that other laws of the process may use.
    """

    rows: tuple[str, ...]
    columns: tuple[str, ...]
    external: frozenset[str]
    entries: dict[tuple[str, str], str]

    def heading(self, column: str) -> str:
        """The symbol, in parentheses if it is given from outside."""
        return f"({column})" if column in self.external else column


def structure_matrix(system: EquationSet) -> Matrix:
    """The structure matrix of a set of equations."""
    entries: dict[tuple[str, str], str] = {}
    columns: dict[str, None] = {}
    relations = sorted(system.relations, key=lambda relation: report_order(relation.label))
    for relation in relations:
        columns.setdefault(symbol(relation.defines.variable.name))
    for relation in relations:
        row = relation.label
        for variable in relation.offered:
            entries.setdefault((row, symbol(variable.name)), OFFERED)
        for term in relation.uses:
            key = (row, symbol(term.variable.name))
            if entries.get(key) != DEFINES:
                entries[key] = USES
        entries[row, symbol(relation.defines.variable.name)] = DEFINES
    for variable in (*system.unknowns, *system.inputs):
        columns.setdefault(symbol(variable.name))
    own = {symbol(variable.name) for variable in system.unknowns}
    used = {column for _, column in entries}
    shown = tuple(c for c in columns if c in used or c in own)
    ordered = (*(c for c in shown if c in own), *(c for c in shown if c not in own))
    rows = tuple(dict.fromkeys(relation.label for relation in relations))
    return Matrix(rows, ordered, frozenset(c for c in ordered if c not in own), entries)


def report_order(label: str) -> tuple[int, int]:
    """Chapter and number of an equation in the report; those without a number come last."""
    number = re.match(r"(\d+)\.(\d+)", label)
    return (int(number[1]), int(number[2])) if number else (1000, 0)
