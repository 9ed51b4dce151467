"""The structure of a limb as plain data for `limb structure --json`; docs/structure.md lists the keys."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from limb_nodes.analysis.structure.findings import Findings
from limb_nodes.analysis.structure.matrix import Matrix, structure_matrix
from limb_nodes.analysis.structure.relations import Relation, Variable


def structure_data(findings: Sequence[Findings], limb_name: str, file: str) -> dict[str, Any]:
    """All levels."""
    return {"limb": limb_name, "file": file, "levels": [level_data(one) for one in findings]}


def level_data(one: Findings) -> dict[str, Any]:
    """One level. Equations are named by their place in the list `equations`, from 0."""
    system, offsets = one.system, one.offsets
    (over_equations, over_unknowns), (under_equations, under_unknowns) = one.parts.over, one.parts.under
    return {
        "level": system.name,
        "title": system.title,
        "laws": dict(system.laws),
        "members": list(system.members),
        "equation_count": len(system.relations),
        "unknown_count": len(system.unknowns),
        "degrees_of_freedom": one.degrees_of_freedom,
        "kind": one.kind,
        "index": one.index,
        "free_initial_values": offsets.free_initial_values if offsets else None,
        "differentiate": [{"equation": i, "times": n} for i, n in one.differentiated.items()],
        "blocks": [
            {
                "equations": list(block.relations),
                "unknowns": derivatives(block.unknowns),
            }
            for block in one.blocks
        ],
        "overdetermined": {"equations": list(over_equations), "unknowns": names(over_unknowns)},
        "underdetermined": {"equations": list(under_equations), "unknowns": names(under_unknowns)},
        "defined_by_none": names(one.undefined),
        "defined_twice": names(one.defined_twice),
        "matrix": matrix_data(structure_matrix(system)),
        "equations": [equation_data(relation) for relation in system.relations],
        "unknowns": names(system.unknowns),
        "inputs": names(system.inputs),
    }


def matrix_data(matrix: Matrix) -> dict[str, Any]:
    """A structure matrix."""
    return {
        "rows": list(matrix.rows),
        "columns": [{"symbol": column, "external": column in matrix.external} for column in matrix.columns],
        "entries": [
            {"row": row, "column": column, "mark": mark} for (row, column), mark in sorted(matrix.entries.items())
        ],
    }


def equation_data(relation: Relation) -> dict[str, Any]:
    """One equation."""
    return {
        "number": relation.number,
        "owner": relation.owner,
        "level": relation.level,
        "process": relation.process,
        "defines": derivatives([relation.defines])[0],
        "uses": derivatives(relation.uses),
    }


def derivatives(terms: Iterable[tuple[Variable, int]]) -> list[dict[str, Any]]:
    """Variables with the order of their derivative."""
    return [{"variable": str(variable), "derivative": order} for variable, order in terms]


def names(variables: Iterable[Variable]) -> list[str]:
    """Variables as `owner.name`."""
    return [str(variable) for variable in variables]
