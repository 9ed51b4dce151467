"""The picture of a limb's characteristics."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from limb_nodes.analysis.curves import Panel

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Colour-blind safe (Okabe and Ito), light ones last.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#000000", "#56B4E9", "#E69F00", "#8C564B", "#7F7F7F", "#B8A800")
STYLES = ("-", "--", ":")
GREY = "#666666"
PREFIXES = ((1e-12, "p"), (1e-9, "n"), (1e-6, "µ"), (1e-3, "m"), (1.0, ""), (1e3, "k"))
CHARTED = {"m", "m/s", "N"}
MANY = 9


def draw(panels: Sequence[Panel], limb_name: str, path: Path) -> None:
    """Draw all panels into one picture; the kind of file follows from the name."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    columns = min(len(panels), min((4, 3), key=lambda n: -len(panels) % n))
    rows = math.ceil(len(panels) / columns)
    layout = ConstrainedLayoutEngine(w_pad=0.12, h_pad=0.12, hspace=0.04, wspace=0.04)
    figure = Figure(figsize=(5.2 * columns, 3.9 * rows + 0.5), layout=layout)
    FigureCanvasAgg(figure)
    figure.suptitle(f"Characteristics of {limb_name}", x=0.012, ha="left", fontsize=14, weight="bold")
    grid = figure.subplots(rows, columns, squeeze=False)
    colours: dict[str, dict[str, str]] = {}
    for axes, panel in zip(grid.flat, panels, strict=False):
        known = colours.setdefault(panel.owners, {})
        for curve in panel.curves:
            known.setdefault(curve.key, COLOURS[len(known) % len(COLOURS)])
        draw_panel(axes, panel, known)
    for axes in list(grid.flat)[len(panels) :]:
        axes.set_axis_off()
    figure.savefig(path, dpi=150)


def draw_panel(axes: Axes, panel: Panel, colours: Mapping[str, str]) -> None:
    """One characteristic with its units. colours: by the curves' keys."""
    x_factor, x_unit = shown(panel.x_unit, [curve.x for curve in panel.curves])
    y_factor, y_unit = shown(panel.y_unit, [curve.y for curve in panel.curves])
    keys = list(dict.fromkeys(curve.key for curve in panel.curves))
    # Of many curves some lie upon each other: the lower ones are wider, so that all can be seen.
    spread = 0.5 if len(panel.curves) > MANY else 0.0
    width = {key: 1.8 + spread * (len(keys) - 1 - index) for index, key in enumerate(keys)}
    for curve in panel.curves:
        axes.plot(
            curve.x * x_factor,
            curve.y * y_factor,
            STYLES[curve.style % len(STYLES)],
            color=colours[curve.key],
            lw=width[curve.key],
            label=curve.label or None,
        )
    axes.set_xlabel(f"{panel.x_label} [{x_unit}]", fontsize=9)
    axes.set_ylabel(f"{panel.y_label} [{y_unit}]", fontsize=9)
    axes.set_title(panel.title + (f" ({panel.figure})" if panel.figure else ""), loc="left", fontsize=11, pad=20)
    below = ", ".join(panel.laws) + (f"; {panel.note}" if panel.note else "")
    axes.text(0.0, 1.025, below, transform=axes.transAxes, fontsize=8, color=GREY)
    decorate(axes, panel, x_factor)
    count = sum(1 for curve in panel.curves if curve.label)
    legend = axes.legend(fontsize=8 if count <= MANY else 6.5, frameon=False, ncols=2 if count > 5 else 1)
    for line in legend.get_lines():
        line.set_linewidth(1.8)


def decorate(axes: Axes, panel: Panel, x_factor: float) -> None:
    """Grid, frame and the lines at zero."""
    axes.grid(color="#e6e6e6", lw=0.7)
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=8, length=3, color=GREY)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    axes.margins(y=0.06)
    low = min(float(np.min(curve.x)) for curve in panel.curves) * x_factor
    high = max(float(np.max(curve.x)) for curve in panel.curves) * x_factor
    axes.set_xlim(low - 0.02 * (high - low), high + 0.02 * (high - low))
    if low < 0.0 < high:
        axes.axvline(0.0, color="#b0b0b0", lw=0.8, zorder=0)
    least = min(float(np.nanmin(curve.y)) for curve in panel.curves)
    if least < 0.0 < axes.get_ylim()[1]:
        axes.axhline(0.0, color="#b0b0b0", lw=0.8, zorder=0)
    elif panel.zero:
        axes.set_ylim(bottom=0.0)


def shown(unit: str, values: Sequence[np.ndarray]) -> tuple[float, str]:
    """Factor and name of the unit in which SI values are read most easily."""
    if unit == "rad":
        return 180.0 / math.pi, "°"
    if unit not in CHARTED:
        return 1.0, unit
    largest = max(float(np.nanmax(np.abs(value))) for value in values)
    factor, prefix = next(((f, p) for f, p in reversed(PREFIXES) if largest >= 0.999 * f), (1.0, ""))
    if unit == "m" and largest < 1.0 and largest >= 1e-3:
        factor, prefix = 1e-3, "m"
    return 1.0 / factor, prefix + unit
