"""The structure of a limb's equations: what can be told without any numbers.

from limb_nodes.analysis.structure import analyse
for level in analyse(limb):
    print(level.system.name, level.degrees_of_freedom, level.index)
"""

from __future__ import annotations

from limb_nodes.analysis.structure.findings import Block, Findings, examine
from limb_nodes.analysis.structure.levels import MODEL, TITLES, equation_sets
from limb_nodes.analysis.structure.matrix import Matrix, structure_matrix
from limb_nodes.analysis.structure.relations import EquationSet, Relation, Term, Variable
from limb_nodes.model import Limb

__all__ = [
    "MODEL",
    "TITLES",
    "Block",
    "EquationSet",
    "Findings",
    "Matrix",
    "Relation",
    "Term",
    "Variable",
    "analyse",
    "examine",
    "structure_matrix",
]


def analyse(limb: Limb, level: str | None = None) -> list[Findings]:
    """The structure of every level of a limb and of the whole model, or of the level that is named."""
    return examine(equation_sets(limb, level))
