"""A picture of the structure matrices."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from limb_nodes.analysis.structure.findings import Findings
from limb_nodes.analysis.structure.levels import ASSEMBLED, MODEL
from limb_nodes.analysis.structure.matrix import DEFINES, OFFERED, Matrix, structure_matrix
from limb_nodes.analysis.structure.symbols import mathtext, symbol
from limb_nodes.analysis.style import COLOURS, GREY, LIGHT, PALE, SMALL, TINY, new_figure, save, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Inches.
CELL, GAP, TITLE, LETTER, WIDTH, SORTED_SIZE, BELOW, HEAD = 0.24, 0.45, 0.55, 0.075, 22.5, 6.2, 0.5, 0.9
# More equations than this are drawn without their names.
LABELLED = 60
DEFINED, STATE, LOOP = COLOURS[0], COLOURS[5], COLOURS[1]
EXPLAINED = "⊗ defines, × uses, (×) another law may use; grey columns (in parentheses) are given from outside"


class LevelPicture:
    """One level: its matrix, or its equations in the order of solution, and the room (inches) that it takes."""

    def __init__(self, one: Findings) -> None:
        self.one = one
        self.matrix: Matrix | None = None
        if one.system.name in (ASSEMBLED, MODEL) and one.blocks:
            labels = [relation.label for relation in one.system.relations] if len(one.blocks) <= LABELLED else [""]
            self.left, self.top = 0.045 * max(map(len, labels)) + 0.35, 0.35
            self.body = (SORTED_SIZE, SORTED_SIZE)
        else:
            self.matrix = structure_matrix(one.system)
            self.left = LETTER * max(len(row) + 2 for row in self.matrix.rows) + 0.15
            self.top = LETTER * max(len(self.matrix.heading(c)) for c in self.matrix.columns) * 0.75 + 0.1
            self.body = (CELL * len(self.matrix.columns), CELL * len(self.matrix.rows))
        self.width = max(self.left + self.body[0], LETTER * max(len(line) for line in self.title().split("\n")))
        self.bottom = 0.0 if self.matrix else BELOW
        self.height = TITLE + self.top + self.body[1] + self.bottom

    def title(self) -> str:
        """Two lines on the level."""
        one = self.one
        laws = ", ".join(dict.fromkeys(one.system.laws.values())) if self.matrix else ", ".join(one.system.members[:1])
        index = f"index {one.index}" if one.index is not None else "singular"
        count, unknowns = len(one.system.relations), len(one.system.unknowns)
        kind = " (ODE)" if one.index == 0 else ""
        second = f"{count} equations, {unknowns} unknowns, dof {one.degrees_of_freedom}, {index}{kind}"
        first = one.system.title if self.matrix else f"{one.system.title}, in the order of solution"
        return f"{first}{f': {laws}' if laws else ''}\n{second}"


@styled
def draw_structure(findings: Sequence[Findings], limb_name: str, path: Path) -> None:
    """Draw every level into one file. Raises UserError."""
    levels = sorted((LevelPicture(one) for one in findings), key=lambda level: level.matrix is None)
    limit = max([WIDTH, *(level.width + 2 * GAP for level in levels)])
    places, width, below = shelves(levels, limit)
    height = below + HEAD
    figure = new_figure(width, height, fixed=True)

    def write(x: float, y: float, text: str, **looks: Any) -> None:
        figure.text(x / width, 1.0 - y / height, text, va="top", **looks)

    write(GAP, 0.3, f"Structure of {limb_name}", fontsize="x-large", weight="bold")
    write(GAP, 0.6, EXPLAINED, fontsize="small", color=GREY)
    for level, (x, y) in zip(levels, places, strict=True):
        bottom = below - y - level.height + level.bottom
        size = level.body[0] / width, level.body[1] / height
        axes = figure.add_axes(((x + level.left) / width, bottom / height, *size))
        axes.grid(False)
        axes.spines[:].set_visible(True)
        if level.matrix is None:
            draw_sorted(axes, level.one)
        else:
            draw_matrix(axes, level.matrix)
        write(x, HEAD + y + 0.05, level.title(), fontsize="small")
    save(figure, path)


def shelves(levels: Sequence[LevelPicture], limit: float) -> tuple[list[tuple[float, float]], float, float]:
    """Places (inches from the left and the top) of levels in rows, low ones below each other, and the whole size."""
    places = []
    x, y, row, widest = GAP, GAP / 2, 0.0, 0.0
    stacks: list[list[float]] = []
    for level in levels:
        below = next((s for s in stacks if level.width <= s[1] and s[2] + GAP + level.height <= row), None)
        if below is not None:
            places.append((below[0], y + below[2] + GAP))
            below[2] += GAP + level.height
            continue
        if x > GAP and x + level.width + GAP > limit:
            x, y, row = GAP, y + row + GAP, 0.0
            stacks = []
        places.append((x, y))
        stacks.append([x, level.width, level.height])
        x += level.width + GAP
        row = max(row, level.height)
        widest = max(widest, x)
    return places, widest, y + row + GAP


def draw_matrix(axes: Axes, matrix: Matrix) -> None:
    """Equations in rows, variables in columns, as the report prints them."""
    rows, columns = len(matrix.rows), len(matrix.columns)
    column_of = {column: j for j, column in enumerate(matrix.columns)}
    row_of = {row: i for i, row in enumerate(matrix.rows)}
    axes.set_xlim(-0.5, columns - 0.5)
    axes.set_ylim(rows - 0.5, -0.5)
    for column in matrix.external:
        axes.axvspan(column_of[column] - 0.5, column_of[column] + 0.5, color=LIGHT, zorder=0, lw=0)
    for (row, column), mark in matrix.entries.items():
        at = (column_of[column], row_of[row])
        if mark == DEFINES:
            axes.plot(*at, "o", ms=9, mfc="none", mec=DEFINED, mew=1.2)
        axes.plot(*at, "x", ms=5, mec=DEFINED if mark == DEFINES else GREY, mew=1.2)
        if mark == OFFERED:
            axes.text(*at, "(   )", ha="center", va="center", fontsize=9, color=GREY)
    axes.set_xticks(range(columns), [mathtext(matrix.heading(c)) for c in matrix.columns], rotation=90, fontsize=SMALL)
    axes.set_yticks(range(rows), [f"({row})" if row[0].isdigit() else row for row in matrix.rows], fontsize=SMALL)
    axes.tick_params(top=True, labeltop=True, bottom=False, labelbottom=False, length=0)
    axes.set_xticks([j - 0.5 for j in range(1, columns)], minor=True)
    axes.set_yticks([i - 0.5 for i in range(1, rows)], minor=True)
    axes.grid(which="minor", color=LIGHT, lw=0.5)
    axes.tick_params(which="minor", length=0, top=False)
    for spine in axes.spines.values():
        spine.set_color(PALE)


def draw_sorted(axes: Axes, one: Findings) -> None:
    """Equations and unknowns in the order of solution; what must be solved together is framed."""
    assert one.offsets is not None
    order = [i for block in one.blocks for i in block.relations]
    unknowns = [variable for block in one.blocks for variable, _ in block.unknowns]
    place = {variable: j for j, variable in enumerate(unknowns)}
    times, highest = one.offsets.times, one.offsets.highest
    count = len(order)
    now: list[tuple[int, int]] = []
    states: list[tuple[int, int]] = []
    for i, relation in enumerate(order):
        for variable, derivative in one.incidences[relation].items():
            current = derivative + times[relation] == highest[variable]
            (now if current else states).append((place[variable], i))
    size = max(0.6, min(5.0, 330.0 / count))
    for points, colour in ((states, STATE), (now, GREY)):
        axes.plot([x for x, _ in points], [y for _, y in points], "s", ms=size, color=colour, mew=0)
    axes.plot(range(count), range(count), "s", ms=size, color=DEFINED, mew=0)
    frame_loops(axes, one, count)
    axes.set_xlim(-1, count)
    axes.set_ylim(count, -1)
    axes.tick_params(length=0)
    axes.set_xticks([])
    axes.set_yticks([])
    if count <= LABELLED:
        axes.set_yticks(range(count), [one.system.relations[i].label for i in order], fontsize=TINY)
        axes.set_xticks(range(count), [mathtext(symbol(v.name)) for v in unknowns], fontsize=TINY, rotation=90)
        axes.tick_params(top=True, labeltop=True, bottom=False, labelbottom=False)
    else:
        axes.set_ylabel("equations", fontsize=SMALL)
    text = "unknowns; blue: what each equation gives, grey: what it uses, yellow: known states"
    axes.set_xlabel(text, fontsize=SMALL)


def frame_loops(axes: Axes, one: Findings, count: int) -> None:
    """Frame and name the blocks of more than one equation."""
    from matplotlib.patches import Rectangle

    start, last = 0, -1.0
    for block in one.blocks:
        extent = len(block.relations)
        if extent > 1:
            axes.add_patch(Rectangle((start - 0.5, start - 0.5), extent, extent, fill=False, ec=LOOP, lw=1.3))
            owner = one.system.relations[block.relations[0]].owner.split(".")[0]
            left = start > 0.6 * count
            # Below the name before, so that both can be read.
            last = max(start + extent / 2, last + 0.03 * count)
            x = (start if left else start + extent) - 0.5 + (-0.012 if left else 0.012) * count
            side = "right" if left else "left"
            text = f"{extent} together ({owner})"
            axes.text(x, last, text, ha=side, va="center", fontsize=SMALL, color=LOOP)
        start += extent
