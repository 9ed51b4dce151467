"""The picture of a limb's characteristics."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from limb_nodes.analysis.curves.characteristic import Characteristic
from limb_nodes.analysis.style import COLOURS, GREY, PALE, SMALL, STYLES, new_figure, save, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PREFIXES = ((1e-12, "p"), (1e-9, "n"), (1e-6, "µ"), (1e-3, "m"), (1.0, ""), (1e3, "k"))
PREFIXED = {"m", "m/s", "N"}
# More curves than this have small labels.
MANY = 9
# Signs of a label at most.
LONGEST = 40


@styled
def draw_characteristics(diagrams: Sequence[Characteristic], limb_name: str, path: Path) -> None:
    """Draw all characteristics into one file. Raises UserError."""
    columns = min(len(diagrams), min((4, 3), key=lambda n: -len(diagrams) % n))
    rows = math.ceil(len(diagrams) / columns)
    figure = new_figure(5.2 * columns, 4.1 * rows + 0.5, f"Characteristics of {limb_name}")
    grid = figure.subplots(rows, columns, squeeze=False)
    colours: dict[str, dict[str, str]] = {}
    for axes, diagram in zip(grid.flat, diagrams, strict=False):
        known = colours.setdefault(diagram.owners, {})
        for curve in diagram.curves:
            known.setdefault(curve.key, COLOURS[len(known) % len(COLOURS)])
        draw_characteristic(axes, diagram, known)
    for axes in list(grid.flat)[len(diagrams) :]:
        axes.set_axis_off()
    save(figure, path)


def draw_characteristic(axes: Axes, diagram: Characteristic, colours: Mapping[str, str]) -> None:
    """One characteristic with its units. colours: by the curves' keys."""
    x_factor, x_unit = readable_unit(diagram.x.unit, [curve.x for curve in diagram.curves])
    y_factor, y_unit = readable_unit(diagram.y.unit, [curve.y for curve in diagram.curves])
    keys = list(dict.fromkeys(curve.key for curve in diagram.curves))
    # Of many curves some lie upon each other: the lower ones are wider, so that all can be seen.
    spread = 0.5 if len(diagram.curves) > MANY else 0.0
    width = {key: 1.8 + spread * (len(keys) - 1 - index) for index, key in enumerate(keys)}
    for curve in diagram.curves:
        axes.plot(
            curve.x * x_factor,
            curve.y * y_factor,
            STYLES[curve.style % len(STYLES)],
            color=colours[curve.key],
            lw=width[curve.key],
            label=shortened(curve.label) or None,
        )
    axes.set_xlabel(f"{diagram.x.label} [{x_unit}]")
    axes.set_ylabel(f"{diagram.y.label} [{y_unit}]")
    axes.set_title(diagram.title + (f" ({diagram.figure})" if diagram.figure else ""), pad=20)
    below = ", ".join(diagram.laws) + (f"; {diagram.note}" if diagram.note else "")
    axes.text(0.0, 1.025, below, transform=axes.transAxes, fontsize=SMALL, color=GREY)
    set_limits(axes, diagram, x_factor)
    count = sum(1 for curve in diagram.curves if curve.label)
    if count <= MANY:
        legend = axes.legend(fontsize=SMALL, ncols=2 if count > 5 else 1)
    else:
        # Among so many curves there is no place for it.
        legend = axes.legend(fontsize=SMALL - 1.5, ncols=3, loc="upper center", bbox_to_anchor=(0.5, -0.17))
    for line in legend.get_lines():
        line.set_linewidth(1.8)


def shortened(label: str) -> str:
    """The label of a curve that stands for many: the first two, and how many more."""
    names = label.split(", ")
    return label if len(label) <= LONGEST or len(names) < 3 else f"{names[0]}, {names[1]}, {len(names) - 2} more"


def set_limits(axes: Axes, diagram: Characteristic, x_factor: float) -> None:
    """Margins, and the lines at zero."""
    axes.margins(y=0.06)
    low = min(float(np.min(curve.x)) for curve in diagram.curves) * x_factor
    high = max(float(np.max(curve.x)) for curve in diagram.curves) * x_factor
    axes.set_xlim(low - 0.02 * (high - low), high + 0.02 * (high - low))
    if low < 0.0 < high:
        axes.axvline(0.0, color=PALE, lw=0.8, zorder=0)
    least = min(float(np.nanmin(curve.y)) for curve in diagram.curves)
    if least < 0.0 < axes.get_ylim()[1]:
        axes.axhline(0.0, color=PALE, lw=0.8, zorder=0)
    elif diagram.zero:
        axes.set_ylim(bottom=0.0)


def readable_unit(unit: str, values: Sequence[np.ndarray]) -> tuple[float, str]:
    """Factor and name of the unit in which SI values are read most easily."""
    if unit == "rad":
        return 180.0 / math.pi, "°"
    if unit not in PREFIXED:
        return 1.0, unit
    largest = max(float(np.nanmax(np.abs(value))) for value in values)
    factor, prefix = next(((f, p) for f, p in reversed(PREFIXES) if largest >= 0.999 * f), (1.0, ""))
    if unit == "m" and largest < 1.0 and largest >= 1e-3:
        factor, prefix = 1e-3, "m"
    return 1.0 / factor, prefix + unit
