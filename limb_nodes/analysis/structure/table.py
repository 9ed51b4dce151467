"""The structure of a limb as text."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence

from limb_nodes.analysis.structure.findings import Block, Findings
from limb_nodes.analysis.structure.levels import ASSEMBLED, MODEL
from limb_nodes.analysis.structure.matrix import MARKS, Matrix, structure_matrix
from limb_nodes.analysis.structure.relations import Relation, Variable
from limb_nodes.analysis.structure.symbols import symbol
from limb_nodes.foundation.text_table import aligned

TIMES = {1: "once", 2: "twice"}
# Laws that tell the levels of one name apart; of the others, all are named.
TELLING = {ASSEMBLED: ("sarcomere", "tendon", "aponeurosis"), "muscle": ("path", "aponeurosis")}
KINDS = {
    "algebraic equations": "algebraic",
    "differential and algebraic equations": "DAE",
    "ordinary differential equations": "ODE",
}
# Of the summary: a level, five counts, kind and laws.
COLUMNS = "lrrrrrll"
MEMBERS = 12
LONGEST_LIST = 12
PRIME = "'"
# Blanks at which no line is broken.
TIED = "\N{NO-BREAK SPACE}"
ARROW = f"{TIED}→{TIED}"
LEGEND = (
    "⊗ the equation defines the variable, × it uses it, (×) another law of this process may use it; "
    "(variable) is given from outside. dof: degrees of freedom, unknowns less equations. index: structural "
    "differential index. block: the most equations that must be solved together."
)


def report(findings: Sequence[Findings], limb_name: str, width: int, every_matrix: bool = False) -> str:
    """Everything as text of at most `width` columns.

    every_matrix: print those of the assembled muscle and the whole model too, which hold those of the other levels.
    """
    parts = [f"structure of {limb_name}", "", *summary_lines(findings, width)]
    parts += ["", *wrapped(LEGEND, width, "")]
    for one in findings:
        parts += ["", *level_lines(one, width, every_matrix)]
    return "\n".join(parts)


def summary_lines(findings: Iterable[Findings], width: int) -> list[str]:
    """One line for each level; laws for which a line has no room stand below."""
    rows = [("level", "equations", "unknowns", "dof", "index", "block", "kind", "laws")]
    for one in findings:
        system = one.system
        sizes = [len(block.relations) for block in one.blocks]
        kind = "singular" if one.singular else KINDS[one.kind]
        laws = [system.laws[process] for process in TELLING.get(system.name, tuple(system.laws))]
        rows.append(
            (
                system.name,
                str(len(system.relations)),
                str(len(system.unknowns)),
                str(one.degrees_of_freedom),
                "-" if one.index is None else str(one.index),
                str(max(sizes)) if sizes else "-",
                kind,
                ", ".join(laws),
            )
        )
    start = len(aligned([(*row[:-1], "|") for row in rows], COLUMNS)[0]) - 1
    lines: list[str] = []
    for line in aligned(rows, COLUMNS):
        first, *more = wrapped(line[start:], max(24, width - start), "")
        lines += [line[:start] + first, *(" " * start + text for text in more)]
    return [line.rstrip() for line in lines]


def level_lines(one: Findings, width: int, every_matrix: bool) -> list[str]:
    """What the structure of one level tells."""
    system = one.system
    laws = "; ".join(f"{process.replace('_', ' ')}: {law}" for process, law in system.laws.items())
    lines = [system.title, "=" * len(system.title)]
    if laws:
        lines += wrapped(f"laws: {laws}", width)
    if system.members:
        more = len(system.members) - MEMBERS
        members = ", ".join(system.members[:MEMBERS]) + (f" and {more} more" if more > 0 else "")
        lines += wrapped(f"of: {members}", width)
    count = len(system.relations)
    lines.append(
        f"{plural(count, 'equation')}, {plural(len(system.unknowns), 'unknown')}, "
        f"{one.degrees_of_freedom} degrees of freedom; "
        + (f"{one.kind}, index {one.index}" if one.index is not None else one.kind)
    )
    lines += blame_lines(one, width)
    if one.offsets:
        if one.offsets.free_initial_values:
            lines.append(f"initial values that may be chosen: {one.offsets.free_initial_values}")
        lines += block_lines(one, width)
    if system.name in (ASSEMBLED, MODEL) and not every_matrix:
        lines.append(f"matrix of {count} x {len(system.unknowns)}: --level {system.name}, --json, and the picture (-o)")
        return lines
    return [*lines, "", *matrix_lines(structure_matrix(system), width)]


def blame_lines(one: Findings, width: int) -> list[str]:
    """The equations and variables to blame for a system that cannot be solved as it stands."""
    relations = one.system.relations
    texts = [
        f"{spelled(variable)} is defined more than once: by {equation_names(several)}"
        for variable, several in one.defined_twice.items()
    ]
    texts += [f"{spelled(variable)} is defined by no equation" for variable in one.undefined]
    lines: list[str] = []
    for text, count in Counter(texts).items():
        lines += wrapped(f"{text} [{count}]" if count > 1 else text, width)
    for word, (equations, unknowns) in (("over", one.parts.over), ("under", one.parts.under)):
        if equations or unknowns:
            lines += wrapped(
                f"{word}-determined: {plural(len(equations), 'equation')} with {plural(len(unknowns), 'unknown')}: "
                f"{shortened(equation_names([relations[i] for i in equations]) or 'none')} with "
                f"{shortened(variable_names(unknowns) or 'none')}",
                width,
            )
    return lines + differentiation_lines(one, width)


def differentiation_lines(one: Findings, width: int) -> list[str]:
    """The equations that must be differentiated, and the constraints that ask for it."""
    if not one.offsets or not one.differentiated:
        return []
    relations = one.system.relations
    counts: dict[int, list[Relation]] = {}
    for place, times in one.differentiated.items():
        counts.setdefault(times, []).append(relations[place])
    text = "; ".join(
        f"{equation_names(several)} {TIMES.get(times, f'{times} times')}"
        for times, several in sorted(counts.items(), reverse=True)
    )
    lines = wrapped(f"to be differentiated: {text}", width)
    shown: dict[str, None] = {}
    for rows, nodes in one.offsets.constraints:
        labels = counted([relations[i].label + PRIME * times for i, times in rows])
        held = counted([symbol(variable.name) + PRIME * order for variable, order in nodes])
        verb = "holds" if len(rows) == 1 else "together hold"
        shown.setdefault(f"{labels} {verb} only {held}" if held else f"{labels} {verb} nothing but states")
    for text in shown:
        lines += wrapped(f"constraint: {text}", width)
    return lines


def block_lines(one: Findings, width: int) -> list[str]:
    """The blocks of more than one equation."""
    if not one.loops:
        return ["every equation can be solved on its own, one after the other"]
    lines = []
    alike = Counter(block_text(one, block) for block in one.loops)
    for text, count in alike.items():
        lines += wrapped(f"{f'{count} blocks, each' if count > 1 else 'block'} to be solved together: {text}", width)
    return lines


def block_text(one: Findings, block: Block) -> str:
    """The equations of a block, each with the unknown that it gives; primes mark derivatives."""
    times = one.differentiated
    pairs = [
        f"{one.system.relations[i].label}{PRIME * times.get(i, 0)}{ARROW}{symbol(variable.name)}{PRIME * order}"
        for i, (variable, order) in zip(block.relations, block.unknowns, strict=True)
    ]
    return counted(pairs)


def equation_names(relations: Iterable[Relation]) -> str:
    """Labels of equations, each once, with the number of equations that share it."""
    return counted([relation.label for relation in relations])


def variable_names(variables: Iterable[Variable]) -> str:
    """Symbols of variables, each once, with the number of variables that share it."""
    return counted([symbol(variable.name) for variable in variables])


def spelled(variable: Variable) -> str:
    """Symbol and name of a variable."""
    text = symbol(variable.name)
    return text if text == variable.name else f"{text} ({variable.name})"


def shortened(text: str) -> str:
    """A list of names, cut if it is long."""
    names = text.split(", ")
    more = len(names) - LONGEST_LIST
    return text if more <= 0 else f"{', '.join(names[:LONGEST_LIST])} and {more} more"


def counted(texts: Sequence[str]) -> str:
    """Texts, each once, with how often it occurs if that is more than once."""
    return ", ".join(f"{text}{TIED}[{count}]" if count > 1 else text for text, count in Counter(texts).items())


def matrix_lines(matrix: Matrix, width: int) -> list[str]:
    """The matrix; if it is wider than `width`, several tables, without the rows that are empty there."""
    head = max(len(row_heading(row)) for row in matrix.rows)
    marks = {key: MARKS[mark] for key, mark in matrix.entries.items()}
    tables: list[list[str]] = [[]]
    used = head
    for column in matrix.columns:
        cells = [mark for (_, other), mark in marks.items() if other == column]
        cell = 2 + max(map(len, [matrix.heading(column), *cells]))
        if used + cell > width and tables[-1]:
            tables.append([])
            used = head
        tables[-1].append(column)
        used += cell
    lines: list[str] = []
    for number, table in enumerate(tables):
        rows = [["", *(matrix.heading(column) for column in table)]]
        for row in matrix.rows:
            if len(tables) > 1 and not any((row, c) in matrix.entries for c in table):
                continue
            rows.append([row_heading(row), *(marks.get((row, c), "·") for c in table)])
        lines += [""] if number else []
        lines += aligned(rows, "l" + "c" * len(table))
    return lines


def plural(count: int, word: str) -> str:
    """A number of things."""
    return f"{count} {word}{'s' if count != 1 else ''}"


def row_heading(row: str) -> str:
    """The label of an equation, in parentheses if it is a number."""
    return f"({row})" if row[0].isdigit() else row


def wrapped(text: str, width: int, indent: str = "  ") -> list[str]:
    """Lines of a text, the later ones indented."""
    lines: list[str] = []
    line = ""
    for word in text.split(" "):
        if line and len(line) + 1 + len(word) > width:
            lines.append(line)
            line = indent + word
        else:
            line = f"{line} {word}" if line else word
    return [text.replace(TIED, " ") for text in (*lines, line)]
