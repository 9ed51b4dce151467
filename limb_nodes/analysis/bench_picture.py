"""The picture of a muscle on the bench."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from limb_nodes.analysis.style import COLOURS, new_figure, save, styled
from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.solve.bench import BenchRecord

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# More motor units than this are drawn as one band from the lowest to the highest.
MOST_LINES = 7


@styled
def draw_bench(record: BenchRecord, title: str, path: Path) -> None:
    """Draw force, lengths, pennation and frequencies over time into a file. Raises UserError."""
    muscle = record.muscle
    lengths = [("muscle-tendon", record.muscle_tendon_length), ("fibres", record.fibre_length)]
    if muscle["tendon_length"].any():
        lengths.append(("tendon", record.tendon_length))
    if muscle["aponeurosis_length"].any():
        lengths.append(("aponeurosis", muscle["aponeurosis_length"]))
    drive = [("excitation", record.excitation)]
    if not np.array_equal(record.excitation, muscle["activation"]):
        drive.append(("activation", muscle["activation"]))
    pennate = bool(record.pennation_angle.any())
    count = 5 if pennate else 4
    figure = new_figure(8.0, 1.9 * count + 0.6, title)
    panels = list(figure.subplots(count, 1, sharex=True))
    draw_lines(panels[0], record.time, drive, "activation (1)")
    panels[0].set_ylim(-0.05, 1.05)
    draw_frequencies(panels[1], record)
    draw_lines(panels[2], record.time, [("force", record.force)], "force (N)")
    panels[2].set_ylim(bottom=min(0.0, float(record.force.min())))
    draw_lines(panels[3], record.time, [(name, 1e3 * values) for name, values in lengths], "length (mm)")
    if pennate:
        draw_lines(panels[4], record.time, [("pennation", np.degrees(record.pennation_angle))], "pennation (deg)")
    panels[-1].set_xlabel("time (s)")
    panels[-1].set_xlim(record.time[0], record.time[-1])
    figure.align_ylabels(panels)
    save(figure, path)


def draw_lines(axes: Axes, time: FloatArray, series: list[tuple[str, FloatArray]], label: str) -> None:
    """Some series in one panel, named if there are several."""
    for (name, values), colour in zip(series, COLOURS, strict=False):
        axes.plot(time, values, color=colour, label=name)
    finish(axes, label, len(series) > 1)
    middle = float(np.mean([values.mean() for _, values in series]))
    spread = max(float(values.max()) for _, values in series) - min(float(values.min()) for _, values in series)
    if spread < 1e-9 * max(abs(middle), 1.0):
        # A constant: rounding must not fill the panel.
        half = 0.1 * max(abs(middle), 1e-3)
        axes.set_ylim(middle - half, middle + half)


def draw_frequencies(axes: Axes, record: BenchRecord) -> None:
    """Stimulation frequencies of the motor units."""
    if len(record.unit_names) <= MOST_LINES:
        # Units of the same frequency share a line, which would hide all but the last of them.
        shared: dict[bytes, list[int]] = {}
        for index in range(len(record.unit_names)):
            shared.setdefault(record.frequency[:, index].tobytes(), []).append(index)
        for indices, colour in zip(shared.values(), COLOURS, strict=False):
            name = ", ".join(record.unit_names[index] for index in indices)
            axes.plot(record.time, record.frequency[:, indices[0]], color=colour, label=name)
        finish(axes, "frequency (Hz)", len(record.unit_names) > 1)
    else:
        low, high = record.frequency.min(axis=1), record.frequency.max(axis=1)
        axes.fill_between(record.time, low, high, color=COLOURS[0], alpha=0.3, lw=0, label="lowest to highest")
        mean = record.frequency.mean(axis=1)
        axes.plot(record.time, mean, color=COLOURS[0], label=f"mean of {len(record.unit_names)} units")
        finish(axes, "frequency (Hz)", True)
    axes.set_ylim(bottom=0.0)


def finish(axes: Axes, label: str, legend: bool) -> None:
    """Label and legend of a panel."""
    axes.set_ylabel(label)
    axes.ticklabel_format(axis="y", useOffset=False)
    if legend:
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
