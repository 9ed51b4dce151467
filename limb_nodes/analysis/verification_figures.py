"""The report's figures 3.2 to 3.11 redrawn."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from limb_nodes.analysis.style import BLACK, COLOURS, DARK, new_figure, save, styled
from limb_nodes.analysis.trajectory import Trajectory
from limb_nodes.analysis.verification import Case
from limb_nodes.foundation.arrays import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D

# The broad line lies below, the dashed one on it, so that both show where they agree.
LINES: dict[str, dict[str, Any]] = {
    "whole": {"linestyle": "-", "linewidth": 3.2, "alpha": 0.35},
    "graph": {"linestyle": (0, (3, 2)), "linewidth": 1.2},
}
MEANINGS = {"whole": "whole-model solve", "graph": "graph of nodes, 1 kHz"}


@dataclass(frozen=True)
class Diagram:
    """One diagram: its title, unit, factor to this unit, and what of a trajectory it shows [T, curves]."""

    title: str
    unit: str
    factor: float
    of: Callable[[Trajectory], FloatArray]
    joint: bool = False


ANGLE = Diagram("joint angle", "rad", 1.0, lambda c: c.angle, True)
VELOCITY = Diagram("joint velocity", "rad/s", 1.0, lambda c: c.velocity, True)
JOINT_DIAGRAMS = (ANGLE, VELOCITY)
MUSCLE_DIAGRAMS = (
    ANGLE,
    VELOCITY,
    Diagram("activation", "1", 1.0, lambda c: c.activation),
    Diagram("stimulation frequency", "Hz", 1.0, lambda c: c.unit["stimulation_frequency"]),
    Diagram("muscle-tendon length", "m", 1.0, lambda c: c.muscle["muscle_tendon_length"]),
    Diagram("muscle length", "m", 1.0, lambda c: c.muscle["muscle_length"]),
    Diagram("fibre length", "m", 1.0, lambda c: c.muscle["fibre_length"]),
    Diagram("sarcomere length", "µm", 1e6, lambda c: c.sarcomere["length"]),
    Diagram("muscle-tendon shortening velocity", "m/s", 1.0, lambda c: c.muscle["muscle_tendon_velocity"]),
    Diagram("muscle shortening velocity", "m/s", 1.0, lambda c: c.muscle["muscle_velocity"]),
    Diagram("fibre shortening velocity", "m/s", 1.0, lambda c: c.muscle["fibre_velocity"]),
    Diagram("sarcomere shortening velocity", "µm/s", 1e6, lambda c: c.sarcomere["velocity"]),
    Diagram("muscle torque", "N m", 1.0, lambda c: c.muscle["torque"]),
    Diagram("muscle force", "N", 1.0, lambda c: c.muscle["muscle_force"]),
    Diagram("fibre force", "N", 1.0, lambda c: c.muscle["fibre_force"]),
    Diagram("sarcomere force", "pN", 1e12, lambda c: c.sarcomere["force"]),
)
TENDON_DIAGRAMS = (
    Diagram("torque of the joint", "N m", 1.0, lambda c: c.torque, True),
    Diagram("tendon length", "m", 1.0, lambda c: c.muscle["tendon_length"]),
    Diagram("tendon lengthening velocity", "m/s", 1.0, lambda c: c.muscle["tendon_velocity"]),
)


@styled
def draw_case(case: Case, muscles: list[str], trajectories: Mapping[str, Trajectory], path: Path) -> None:
    """Draw one case into a file, all ways of running it in the same diagrams. Raises UserError.

    trajectories: by way, "whole" and "graph".
    """
    diagrams: tuple[Diagram, ...] = JOINT_DIAGRAMS
    if case.states:
        tendons = any(trajectory.muscle["tendon_length"].any() for trajectory in trajectories.values())
        diagrams = MUSCLE_DIAGRAMS + (TENDON_DIAGRAMS if tendons else ())
    columns = 4 if case.states else 2
    rows = -(-len(diagrams) // columns)
    figure = new_figure(4.0 * columns, 2.5 * rows + 0.9, f"Figure {case.figure}\n{case.set_up}")
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for diagram, place in zip(diagrams, axes, strict=False):
        draw_diagram(place, diagram, trajectories)
    for place in axes[len(diagrams) :]:
        place.set_axis_off()
    handles = legend_handles(muscles if case.states else [], list(trajectories))
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))
    save(figure, path)


def draw_diagram(axes: Axes, diagram: Diagram, trajectories: Mapping[str, Trajectory]) -> None:
    """Draw one diagram."""
    for way, trajectory in trajectories.items():
        values = diagram.of(trajectory) * diagram.factor
        for index in range(values.shape[1]):
            colour = DARK if diagram.joint else COLOURS[index % len(COLOURS)]
            axes.plot(trajectory.time, values[:, index], color=colour, **LINES[way])
    axes.set_title(diagram.title)
    axes.set_xlabel("time (s)")
    axes.set_ylabel(diagram.unit)
    axes.margins(x=0.0)


def legend_handles(muscles: list[str], ways: list[str]) -> list[Line2D]:
    """What colours and lines mean."""
    from matplotlib.lines import Line2D

    handles = [Line2D([], [], color=COLOURS[i % len(COLOURS)], label=name) for i, name in enumerate(muscles)]
    handles += [Line2D([], [], color=DARK, label="joint")]
    return handles + [Line2D([], [], color=BLACK, label=MEANINGS[way], **LINES[way]) for way in ways]
