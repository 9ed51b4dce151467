"""The report's figures 3.2 to 3.11 redrawn."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from limb_nodes.analysis.course import Course
from limb_nodes.analysis.verification import Case
from limb_nodes.foundation.arrays import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes

JOINT_COLOUR = "#333333"
COLOURS = ("#c0392b", "#2471a3", "#1e8449", "#7d3c98", "#b9770e")
# The broad line lies below, the dashed one on it, so that both show where they agree.
STYLES: dict[str, dict[str, object]] = {
    "whole": {"linestyle": "-", "linewidth": 3.2, "alpha": 0.35},
    "graph": {"linestyle": (0, (3, 2)), "linewidth": 1.2},
}
MEANINGS = {"whole": "whole-model solve", "graph": "graph of nodes, 1 kHz"}


@dataclass(frozen=True)
class Panel:
    """One diagram: its title, unit, factor to this unit, and what of a course it shows [T, curves]."""

    title: str
    unit: str
    factor: float
    of: Callable[[Course], FloatArray]
    joint: bool = False


ANGLE = Panel("joint angle", "rad", 1.0, lambda c: c.angle, True)
VELOCITY = Panel("joint velocity", "rad/s", 1.0, lambda c: c.velocity, True)
JOINT_PANELS = (ANGLE, VELOCITY)
MUSCLE_PANELS = (
    ANGLE,
    VELOCITY,
    Panel("activation", "1", 1.0, lambda c: c.activation),
    Panel("stimulation frequency", "Hz", 1.0, lambda c: c.unit["stimulation_frequency"]),
    Panel("muscle-tendon length", "m", 1.0, lambda c: c.muscle["muscle_tendon_length"]),
    Panel("muscle length", "m", 1.0, lambda c: c.muscle["muscle_length"]),
    Panel("fibre length", "m", 1.0, lambda c: c.muscle["fibre_length"]),
    Panel("sarcomere length", "µm", 1e6, lambda c: c.sarcomere["length"]),
    Panel("muscle-tendon shortening velocity", "m/s", 1.0, lambda c: c.muscle["muscle_tendon_velocity"]),
    Panel("muscle shortening velocity", "m/s", 1.0, lambda c: c.muscle["muscle_velocity"]),
    Panel("fibre shortening velocity", "m/s", 1.0, lambda c: c.muscle["fibre_velocity"]),
    Panel("sarcomere shortening velocity", "µm/s", 1e6, lambda c: c.sarcomere["velocity"]),
    Panel("muscle torque", "N m", 1.0, lambda c: c.muscle["torque"]),
    Panel("muscle force", "N", 1.0, lambda c: c.muscle["muscle_force"]),
    Panel("fibre force", "N", 1.0, lambda c: c.muscle["fibre_force"]),
    Panel("sarcomere force", "pN", 1e12, lambda c: c.sarcomere["force"]),
)
TENDON_PANELS = (
    Panel("torque of the joint", "N m", 1.0, lambda c: c.torque, True),
    Panel("tendon length", "m", 1.0, lambda c: c.muscle["tendon_length"]),
    Panel("tendon lengthening velocity", "m/s", 1.0, lambda c: c.muscle["tendon_velocity"]),
)


def draw(case: Case, muscles: list[str], courses: Mapping[str, Course], path: Path) -> None:
    """Draw one case, all ways of running it in the same diagrams. courses: by way, "whole" and "graph"."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    panels: tuple[Panel, ...] = JOINT_PANELS
    if case.states:
        tendons = any(course.muscle["tendon_length"].any() for course in courses.values())
        panels = MUSCLE_PANELS + (TENDON_PANELS if tendons else ())
    columns = 4 if case.states else 2
    rows = -(-len(panels) // columns)
    figure = Figure(figsize=(4.0 * columns, 2.5 * rows + 0.9), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(f"Figure {case.figure}: {case.set_up}")
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for panel, place in zip(panels, axes, strict=False):
        draw_panel(place, panel, courses)
    for place in axes[len(panels) :]:
        place.set_axis_off()
    add_legend(figure, muscles if case.states else [], list(courses))
    figure.savefig(path, dpi=110)


def draw_panel(axes: Axes, panel: Panel, courses: Mapping[str, Course]) -> None:
    """Draw one diagram."""
    for way, course in courses.items():
        values = panel.of(course) * panel.factor
        for index in range(values.shape[1]):
            colour = JOINT_COLOUR if panel.joint else COLOURS[index % len(COLOURS)]
            axes.plot(course.time, values[:, index], color=colour, **STYLES[way])  # type: ignore[arg-type]
    axes.set_title(panel.title, fontsize=10)
    axes.set_xlabel("time (s)", fontsize=9)
    axes.set_ylabel(panel.unit, fontsize=9)
    axes.tick_params(labelsize=8)
    axes.grid(alpha=0.3)
    axes.margins(x=0.0)


def add_legend(figure: object, muscles: list[str], ways: list[str]) -> None:
    """Say what colours and lines mean, below the diagrams."""
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    assert isinstance(figure, Figure)
    handles = [Line2D([], [], color=COLOURS[i % len(COLOURS)], label=name) for i, name in enumerate(muscles)]
    handles += [Line2D([], [], color=JOINT_COLOUR, label="joint")]
    handles += [Line2D([], [], color="black", label=MEANINGS[way], **STYLES[way]) for way in ways]  # type: ignore[arg-type]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), fontsize=9, frameon=False)
