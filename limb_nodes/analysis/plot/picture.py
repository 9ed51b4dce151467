"""The picture of a run: the limb at a few instants above the panels over time."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING

import numpy as np

from limb_nodes.analysis.plot.limbs import Posture, draw_gravity, draw_limb, frame, instants, posture
from limb_nodes.analysis.plot.panels import Column, Mark, Panel, Raster, columns_of
from limb_nodes.analysis.plot.series import BagSeries
from limb_nodes.analysis.plot.thin import pooled, thinned
from limb_nodes.analysis.style import COLOURS, DARK, GREY, PALE, new_figure, styled
from limb_nodes.model import Limb

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.gridspec import SubplotSpec
    from matplotlib.legend import Legend

INSTANTS = 7
# Inches, but for the part of a posture's width that gravity takes.
HEAD_HEIGHT, LEGEND_HEIGHT, ROW_HEIGHT = 0.45, 0.3, 1.45
COLUMN_WIDTH, LEAST_WIDTH, LEAST_STRIP, MOST_STRIP = 5.4, 9.0, 0.7, 3.5
GRAVITY_WIDTH, LEGEND_GAP = 0.55, 0.3
LEGEND_COLUMNS = 4
LARGEST_DPI = 1200
REMARK_HEIGHT, LETTERS_PER_INCH = 0.16, 16.0
MOST_REMARKS = 30
# The colours of what was noticed in raw EMG.
MARKS = {
    "gap": COLOURS[5],
    "spike": COLOURS[1],
    "clipping": COLOURS[6],
    "still": COLOURS[3],
    "no signal": COLOURS[3],
}


@styled
def picture(run: BagSeries) -> Figure:
    """Draw a run. Every axes of a panel is labelled `column:kind:title`, of a limb `limb:time`."""
    columns = columns_of(run)
    postures = _postures(run)
    width = max(COLUMN_WIDTH * len(columns), LEAST_WIDTH)
    heights = {
        "strip": _strip_height(postures, width),
        "legends": max(_legend_rows(column) for column in columns) * LEGEND_HEIGHT,
        "body": max(len(column.panels) for column in columns) * ROW_HEIGHT,
        "remarks": len(_lines(run.remarks, width)) * REMARK_HEIGHT,
    }
    figure = new_figure(width, HEAD_HEIGHT + sum(heights.values()))
    heights = {name: height for name, height in heights.items() if height}
    places = figure.add_gridspec(len(heights), 1, height_ratios=list(heights.values()))
    parts = {name: places[row] for row, name in enumerate(heights)}
    _draw_headings(figure, run)
    if run.limb is not None and postures:
        _draw_limbs(figure, parts["strip"], run.limb, postures)
    if "legends" in parts:
        # Holds the room for the legends, which follow the panels below it.
        figure.add_subplot(parts["legends"], label="room").axis("off")
    if run.remarks:
        _draw_remarks(figure, parts["remarks"], run.remarks)
    marks = [shown.time for shown in postures]
    for index, (column, places_of_panels) in enumerate(zip(columns, _grid(parts["body"], columns), strict=True)):
        _draw_column(figure, places_of_panels, index, column, run, marks)
    return figure


def _grid(place: SubplotSpec, columns: Sequence[Column]) -> list[list[SubplotSpec]]:
    """The places of each column's panels, in common rows if all columns have as many."""
    counts = [len(column.panels) for column in columns]
    if len(set(counts)) == 1:
        whole = place.subgridspec(counts[0], len(columns))
        return [[whole[row, index] for row in range(counts[0])] for index in range(len(columns))]
    body = place.subgridspec(1, len(columns))
    own = [body[index].subgridspec(count, 1) for index, count in enumerate(counts)]
    return [[grid[row] for row in range(count)] for grid, count in zip(own, counts, strict=True)]


def _draw_headings(figure: Figure, run: BagSeries) -> None:
    name = run.limb.name if run.limb is not None else Path(run.source).name or run.path.resolve().name
    facts = [f"bag {run.path.resolve().name}", f"{run.start:g} to {run.end:g} s"]
    if run.rate is not None:
        facts.append(f"{run.rate:g} Hz")
    if run.version:
        facts.append(f"limb_nodes {run.version}")
    figure.suptitle(name.replace("_", " "), x=0.012, ha="left")
    # Beside the title, so that it takes no room of its own.
    height = 1.0 - 0.12 / figure.get_figheight()
    figure.text(0.988, height, "  ·  ".join(facts), ha="right", va="top", fontsize="small", color=GREY)


def _postures(run: BagSeries) -> list[Posture]:
    """The limb at some instants, none if the bag does not hold both limb and angles."""
    limb = run.limb
    if limb is None or run.angle is None or not set(limb.joint_names) <= set(run.angle.names):
        return []
    return [posture(run, limb, sample) for sample in instants(run.angle, INSTANTS)]


def _strip_height(postures: list[Posture], width: float) -> float:
    """Height that the limb takes when the postures fill the width."""
    if not postures:
        return 0.0
    left, right, bottom, top = frame(postures)
    height = 0.82 * width / (len(postures) + GRAVITY_WIDTH) * (top - bottom) / (right - left)
    return min(max(height, LEAST_STRIP), MOST_STRIP) + 0.3


def _draw_limbs(figure: Figure, place: SubplotSpec, limb: Limb, postures: list[Posture]) -> None:
    """The limb at some instants."""
    left, right, bottom, top = frame(postures)
    widths = [GRAVITY_WIDTH, *[1.0] * len(postures)]
    grid = place.subgridspec(1, len(widths), wspace=0.0, width_ratios=widths)
    axes = figure.add_subplot(grid[0], label="gravity")
    axes.axis("off")
    draw_gravity(axes, limb.gravity)
    for index, shown in enumerate(postures):
        axes = figure.add_subplot(grid[index + 1], label=f"limb:{shown.time:.9g}")
        axes.set(aspect="equal", xlim=(left, right), ylim=(bottom, top))
        axes.axis("off")
        draw_limb(axes, limb, shown, [other for other in postures if other is not shown])
        axes.set_title(f"{shown.time:.2f} s", loc="center", fontsize="small")


def _legend_rows(column: Column) -> int:
    return bool(column.title) + -(-len(column.muscles) // LEGEND_COLUMNS)


def _column_legend(axes: Axes, column: Column) -> Legend:
    """The joint of a column and its muscles, above its first panel and that one's title."""
    from matplotlib.legend import Legend
    from matplotlib.lines import Line2D
    from matplotlib.transforms import ScaledTranslation

    figure = axes.get_figure()
    assert figure is not None
    above = ScaledTranslation(0.0, LEGEND_GAP, figure.dpi_scale_trans)
    handles = []
    for _, colour, style in column.muscles:
        handles.append(Line2D([], [], color=colour, linewidth=3))
        handles[-1].set(linestyle=style)
    legend = Legend(
        axes, handles, [name for name, _, _ in column.muscles], title=column.title or None,
        title_fontproperties={"weight": "bold", "size": 13}, alignment="left", loc="lower left",
        bbox_to_anchor=(0.0, 1.0), bbox_transform=axes.transAxes + above, ncols=LEGEND_COLUMNS, borderaxespad=0.0,
        borderpad=0.0, handlelength=1.4, columnspacing=1.2,
    )  # fmt: skip
    legend.set_in_layout(False)
    return legend


def _lines(remarks: Sequence[str], width: float) -> list[str]:
    """Notes in lines as long as a picture is wide (inches)."""
    letters = int(width * LETTERS_PER_INCH)
    lines = [line for remark in remarks for line in wrap(f"note: {remark}", letters, subsequent_indent="    ")]
    return lines if len(lines) <= MOST_REMARKS else [*lines[: MOST_REMARKS - 1], "..."]


def _draw_remarks(figure: Figure, place: SubplotSpec, remarks: Sequence[str]) -> None:
    """What was noticed when the bag was made, below the panels."""
    axes = figure.add_subplot(place, label="remarks")
    axes.axis("off")
    text = "\n".join(_lines(remarks, figure.get_figwidth()))
    axes.text(0.0, 1.0, text, va="top", fontsize="small", color=DARK, parse_math=False).set_in_layout(False)


def _draw_column(
    figure: Figure, grid: list[SubplotSpec], index: int, column: Column, run: BagSeries, marks: list[float]
) -> None:
    first: Axes | None = None
    filled = [row for row, panel in enumerate(column.panels) if panel is not None]
    for row, panel in enumerate(column.panels):
        if panel is None:
            continue
        axes = figure.add_subplot(grid[row], sharex=first, label=f"{index}:{panel.kind}:{panel.title}")
        first = first or axes
        _draw_panel(axes, panel, run)
        if panel.kind == "angle":
            for mark in marks:
                axes.axvline(mark, color=PALE, linewidth=0.9, linestyle=":", zorder=1)
        axes.set_xlim(run.start, run.end if run.end > run.start else run.start + 1e-3)
        axes.tick_params(labelbottom=row == filled[-1])
        if row == filled[-1]:
            axes.set_xlabel("time (s)")
    if first is not None and (column.muscles or column.title):
        # An artist beside the panel's own legend.
        first.add_artist(_column_legend(first, column))


def _draw_panel(axes: Axes, panel: Panel, run: BagSeries) -> None:
    axes.set_title(panel.title).set_in_layout(False)
    axes.set_ylabel(panel.unit)
    if panel.raster is not None:
        _draw_raster(axes, panel.raster, run)
        return
    for line in panel.lines:
        times, values = thinned(line.times, line.values)
        axes.plot(times, values, color=line.colour, linestyle=line.style, linewidth=line.width, label=line.label)
    if panel.limits is not None:
        axes.set_ylim(*panel.limits)
    axes.margins(x=0)
    for mark in panel.marks:
        _draw_mark(axes, mark)
    if panel.bounds is not None:
        _draw_bounds(axes, panel.bounds)
    handles = [
        (handle, label)
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
        if label and not label.startswith("_")
    ]
    if panel.legend and handles:
        legend = axes.legend(
            *zip(*handles, strict=True), loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=4,
            borderaxespad=0.1, handlelength=1.6, columnspacing=1.0, fontsize="small",
        )  # fmt: skip
        legend.set_in_layout(False)


def _draw_mark(axes: Axes, mark: Mark) -> None:
    """A gap or a stretch without signal as a band, a spike as a ring, clipping as a line; each with its name."""
    colour = MARKS[mark.kind]
    if mark.value is None:
        axes.axvspan(mark.start, mark.end, color=colour, alpha=0.25, linewidth=0.8, zorder=0.5, gid=mark.kind)
    elif mark.kind == "spike":
        axes.plot(mark.start, mark.value, "o", markerfacecolor="none", markeredgecolor=colour, gid=mark.kind)
    else:
        axes.hlines(mark.value, mark.start, mark.end, color=colour, linewidth=1.2, zorder=3, gid=mark.kind)
    if mark.kind not in [text.get_gid() for text in axes.texts]:
        # Once for each kind, above the panel, from the right.
        place = 1.0 - 0.16 * len(axes.texts)
        name = axes.text(place, 1.03, mark.kind, transform=axes.transAxes, ha="right", fontsize="small", color=colour)
        name.set_gid(mark.kind)
        name.set_in_layout(False)


def _draw_bounds(axes: Axes, bounds: tuple[float, float]) -> None:
    """Dashed lines at the ends of a joint's range that the angles come near."""
    low, high = axes.get_ylim()
    near = 0.1 * (high - low)
    seen = [bound for bound in bounds if low - near <= bound <= high + near]
    for index, bound in enumerate(seen):
        axes.axhline(bound, color=GREY, linewidth=0.9, linestyle=(0, (4, 3)), zorder=1,
                     label="end of range" if index == 0 else "_")  # fmt: skip


def _draw_raster(axes: Axes, raster: Raster, run: BagSeries) -> None:
    """Frequencies as colours; white while a unit is silent."""
    import matplotlib

    axes.grid(False)
    count = raster.values.shape[1]
    if len(raster.times):
        cells = pooled(raster.times, raster.values).T
        step = float(np.median(np.diff(raster.times))) if len(raster.times) > 1 else run.end - run.start
        colours = matplotlib.colormaps["viridis_r"].with_extremes(bad="white")
        image = axes.imshow(
            np.ma.masked_where(~(cells > 0), cells), aspect="auto", origin="lower", cmap=colours, vmin=0.0,
            vmax=raster.top, interpolation="nearest" if count <= 60 else "antialiased",
            extent=(raster.times[0] - step / 2, raster.times[-1] + step / 2, 0, count),
        )  # fmt: skip
        bar = axes.inset_axes((1.012, 0.0, 0.018, 1.0))
        bar.set_label("colours")
        axes.figure.colorbar(image, cax=bar).set_label(raster.unit)
    names = list(dict.fromkeys(raster.muscles))
    sizes = [raster.muscles.count(name) for name in names]
    ends = np.cumsum(sizes)
    for end in ends[:-1]:
        axes.axhline(end, color=GREY, linewidth=0.8)
    axes.set_yticks(ends - np.array(sizes) / 2, names)
    for label, name in zip(axes.get_yticklabels(), names, strict=True):
        label.set_color(raster.colours[raster.muscles.index(name)])
        label.set_fontweight("bold")
    axes.tick_params(axis="y", length=0)
    axes.set_ylim(0, count)
    axes.set_ylabel("")
