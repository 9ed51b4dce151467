"""What is drawn in which panel: lines and rasters with titles, units and colours, before any drawing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from limb_nodes.analysis.plot.series import BagSeries, Series
from limb_nodes.analysis.style import BLACK, COLOURS, PALE, STYLES
from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.model import Limb
from limb_nodes.signals.envelope import runs

SIMULATED, NET, RECORDED = BLACK, PALE, PALE
BROAD = 2.8
# More motor units than this in one panel become a raster.
MOST_LINES = 6
# What drives a joint, left of how it moves.
DRIVING = frozenset({"drive", "frequency", "muscle_force", "torque"})
# More channels than this in one column of envelopes start a second column.
MOST_ROWS = 8


@dataclass(frozen=True)
class Line:
    """A line: a label for the legend, empty for none; times in s, values in the panel's unit."""

    label: str
    times: FloatArray
    values: FloatArray
    colour: str
    style: str = "-"
    width: float = 1.3


@dataclass(frozen=True)
class Raster:
    """Motor units as rows, from the first recruited of each muscle upwards: values [samples, units] of 0 to top."""

    times: FloatArray
    values: FloatArray
    muscles: tuple[str, ...]
    colours: tuple[str, ...]
    unit: str
    top: float


@dataclass(frozen=True)
class Mark:
    """Something noticed: its kind; times in s; a value for a point, None for a stretch."""

    kind: str
    start: float
    end: float
    value: float | None = None


@dataclass(frozen=True)
class Panel:
    """A panel: lines or a raster over time.

    kind: tells what it shows. limits: of the y axis, None for the data's. bounds: the ends of a joint's range. marks:
    what was noticed there.
    """

    kind: str
    title: str
    unit: str
    lines: tuple[Line, ...] = ()
    raster: Raster | None = None
    limits: tuple[float, float] | None = None
    bounds: tuple[float, float] | None = None
    legend: bool = False
    marks: tuple[Mark, ...] = ()


@dataclass(frozen=True)
class Column:
    """Panels under each other, None for an empty place. muscles: name, colour, style of the legend above them."""

    title: str
    muscles: tuple[tuple[str, str, str], ...]
    panels: tuple[Panel | None, ...]


def look_of(index: int) -> tuple[str, str]:
    """Colour and style of the muscle of a limb at an index."""
    return COLOURS[index % len(COLOURS)], STYLES[index // len(COLOURS) % len(STYLES)]


def muscle_names(run: BagSeries) -> tuple[str, ...]:
    """The muscles of a run, in the limb's order."""
    if run.limb is not None:
        return tuple(run.limb.muscle_names)
    if run.drive is not None:
        return run.drive.names
    return tuple(dict.fromkeys(run.owners)) or next((series.names for series in run.muscles.values()), ())


def columns_of(run: BagSeries) -> list[Column]:
    """The columns of a picture: one per joint, two if there is one joint; of envelopes alone, one per channel."""
    if run.angle is None and run.torque is None and not run.muscles and run.frequency is None:
        return _envelope_columns(run)
    joints = _joints(run)
    if len(joints) > 1 and run.limb is not None:
        return _aligned([_column(run, joint, _muscles_of(run.limb, joint), joint) for joint in joints])
    whole = _column(run, "", muscle_names(run), *joints)
    panels = [panel for panel in whole.panels if panel is not None]
    left = tuple(panel for panel in panels if panel.kind in DRIVING)
    right = tuple(panel for panel in panels if panel.kind not in DRIVING)
    if not left or not right:
        return [Column("", whole.muscles, left or right)]
    return [Column("", whole.muscles, left), Column("", (), right)]


def _aligned(columns: list[Column]) -> list[Column]:
    """The columns with panels of one kind in one row, empty rows left out."""
    rows = [row for row in zip(*(column.panels for column in columns), strict=True) if any(row)]
    return [Column(column.title, column.muscles, tuple(row[i] for row in rows)) for i, column in enumerate(columns)]


def _joints(run: BagSeries) -> tuple[str, ...]:
    if run.limb is not None:
        return tuple(run.limb.joint_names)
    return next((series.names for series in (run.angle, run.torque) if series is not None), ())


def _muscles_of(limb: Limb, joint: str) -> tuple[str, ...]:
    return tuple(muscle.name for muscle in limb.muscles if joint in (limb.joint_names[one] for one in muscle.joints))


def _column(run: BagSeries, title: str, muscles: Sequence[str], *joints: str) -> Column:
    """The panels of some joints and the muscles over them, always as many."""
    panels = [
        _drive(run, muscles),
        _frequency(run, muscles),
        _of_muscles(run, muscles, "muscle_force", "Muscle force", "N"),
        _torque(run, muscles, joints),
        _angle(run, joints),
        _velocity(run, joints),
        *_lengths(run, muscles),
    ]
    known = muscle_names(run)
    legend = tuple((_with_role(run, name), *look_of(known.index(name))) for name in muscles)
    return Column(title, legend, tuple(panels))


def _with_role(run: BagSeries, name: str) -> str:
    if run.limb is None:
        return name
    role = run.limb.muscles[run.limb.muscle_names.index(name)].role
    short = {1.0: "flexor", -1.0: "extensor"}.get(role, name)
    return name if name == short else f"{name} ({short})"


def _muscle_lines(run: BagSeries, series: Series, muscles: Sequence[str], factor: float = 1.0) -> tuple[Line, ...]:
    known = muscle_names(run)
    lines = []
    for name in muscles:
        if name in series.names:
            colour, style = look_of(known.index(name))
            lines.append(Line(name, series.times, factor * series.column(name), colour, style))
    return tuple(lines)


def _drive(run: BagSeries, muscles: Sequence[str]) -> Panel | None:
    if run.drive is None:
        return None
    lines = _muscle_lines(run, run.drive, muscles)
    title = "EMG envelope" if run.is_envelope else "Activation"
    return Panel("drive", title, "of maximum", lines, limits=_drive_limits(run.drive)) if lines else None


def _drive_limits(drive: Series) -> tuple[float, float]:
    """The same for all panels, so that they can be compared."""
    top = float(np.nanmax(drive.values, initial=0.1))
    return -0.03 * top, 1.04 * top


def _frequency(run: BagSeries, muscles: Sequence[str]) -> Panel | None:
    """Lines for a few units, the first recruited thinnest; a raster for many."""
    if run.frequency is None:
        return None
    chosen = [i for muscle in muscles for i, owner in enumerate(run.owners) if owner == muscle]
    if not chosen:
        return None
    known, times, values = muscle_names(run), run.frequency.times, run.frequency.values
    title = "Stimulation frequency"
    if len(chosen) > MOST_LINES:
        owners = tuple(run.owners[i] for i in chosen)
        colours = tuple(look_of(known.index(owner))[0] for owner in owners)
        raster = Raster(times, values[:, chosen], owners, colours, "Hz", float(np.nanmax(values, initial=1.0)))
        return Panel("frequency", f"{title}, first recruited unit lowest", "", raster=raster)
    lines = []
    for muscle in muscles:
        units = [i for i in chosen if run.owners[i] == muscle]
        colour, style = look_of(known.index(muscle))
        for place, unit in enumerate(units):
            label = f"{muscle} {run.frequency.names[unit]}" if len(units) > 1 else muscle
            lines.append(Line(label, times, values[:, unit], colour, style, 1.3 + 0.5 * place))
    return Panel("frequency", title, "Hz", tuple(lines))


def _of_muscles(
    run: BagSeries, muscles: Sequence[str], field: str, title: str, unit: str, factor: float = 1.0
) -> Panel | None:
    if field not in run.muscles:
        return None
    lines = _muscle_lines(run, run.muscles[field], muscles, factor)
    return Panel(field, title, unit, lines) if lines else None


def _joint_lines(series: Series, joints: Sequence[str], label: str, factor: float = 1.0) -> list[Line]:
    """A black line per joint, of different style and labelled with its name if there are several."""
    there = [joint for joint in joints if joint in series.names]
    return [
        Line(
            label if len(there) == 1 else joint,
            series.times,
            factor * series.column(joint),
            SIMULATED,
            STYLES[i % len(STYLES)],
        )
        for i, joint in enumerate(there)
    ]


def _of_joint(text: str, joints: Sequence[str]) -> str:
    """`text` with the joint's name, if that leaves room for a legend beside it."""
    return f"{text} {joints[0]}" if len(joints) == 1 and len(joints[0]) <= 10 else text.split()[0]


def _torque(run: BagSeries, muscles: Sequence[str], joints: Sequence[str]) -> Panel | None:
    by_muscle = _muscle_lines(run, _torques_on(run, joints), muscles) if "torque" in run.muscles else ()
    net = _joint_lines(run.torque, joints, "net torque") if run.torque is not None else []
    if not by_muscle and not net:
        return None
    # Where one muscle works alone, its line lies on the broader one of the net torque.
    broad = tuple(Line(line.label, line.times, line.values, NET, line.style, BROAD) for line in net)
    thin = tuple(Line("", line.times, line.values, line.colour, line.style) for line in by_muscle)
    return Panel("torque", _of_joint("Torque at the", joints), "N m", (*broad, *thin), legend=True)


def _torques_on(run: BagSeries, joints: Sequence[str]) -> Series:
    """The torques of muscles on some joints, by muscle."""
    torque = run.muscles["torque"]
    if not run.torque_joints:
        return torque
    there = [place for place, joint in enumerate(run.torque_joints) if joint in joints]
    return Series(tuple(torque.names[place] for place in there), torque.times, torque.values[:, there])


def _angle(run: BagSeries, joints: Sequence[str]) -> Panel | None:
    if run.angle is None:
        return None
    recorded = [] if run.reference is None else [joint for joint in joints if joint in run.reference.names]
    lines = _joint_lines(run.angle, joints, "simulated" if recorded else "", 180.0 / np.pi)
    if run.reference is not None:
        for joint in recorded:
            values = np.degrees(run.reference.column(joint))
            label = "recorded" if len(joints) == 1 else f"{joint} recorded"
            # Broad and first, so that the simulated line stays visible on it.
            lines.insert(0, Line(label, run.reference.times, values, RECORDED, "-", BROAD))
    bounds = None
    if run.limb is not None and len(joints) == 1:
        segment = run.limb.segments[run.limb.joint_names.index(joints[0])]
        if segment.joint_range is not None:
            low, high = np.degrees(segment.joint_range)
            bounds = float(low), float(high)
    return Panel("angle", _of_joint("Angle of the", joints), "deg", tuple(lines), bounds=bounds, legend=True)


def _velocity(run: BagSeries, joints: Sequence[str]) -> Panel | None:
    if run.velocity is None:
        return None
    lines = _joint_lines(run.velocity, joints, "", 180.0 / np.pi)
    return Panel("velocity", _of_joint("Velocity of the", joints), "deg/s", tuple(lines), legend=len(lines) > 1)


def _lengths(run: BagSeries, muscles: Sequence[str]) -> list[Panel | None]:
    """Lengths that differ: without tendon the muscle is as long as the path, without pennation the fibres are too."""
    fields = run.muscles
    if not fields:
        return [None] * 5
    tendon = bool(np.any(fields["tendon_length"].values != 0))
    pennate = bool(np.any(fields["pennation_angle"].values != 0))
    turned = [name for name in muscles if np.any(fields["pennation_angle"].column(name) != 0)]
    whole = _of_muscles(run, muscles, "muscle_tendon_length", "Length of muscle with tendon", "mm", 1e3)
    fibres = "Fibre length" if pennate else "Length of muscle and fibres"
    return [
        whole if tendon else None,
        _of_muscles(run, muscles, "muscle_length", "Length of muscle", "mm", 1e3) if pennate else None,
        _of_muscles(run, muscles, "fibre_length", fibres, "mm", 1e3),
        _tendon(run, muscles),
        _of_muscles(run, turned, "pennation_angle", "Pennation angle", "deg", 180.0 / np.pi),
    ]


def _tendon(run: BagSeries, muscles: Sequence[str]) -> Panel | None:
    """Tendons stretch by little, so that they are drawn from their slack lengths on."""
    series = run.muscles["tendon_length"]
    slack = {}
    if run.limb is not None:
        for muscle in run.limb.muscles:
            law = muscle.laws.get("tendon")
            if law is not None and "slack_length" in law.values:
                slack[muscle.name] = law.values["slack_length"]
    with_tendon = [name for name in muscles if np.any(series.column(name) != 0)]
    if not with_tendon:
        return None
    if not all(name in slack for name in with_tendon):
        return _of_muscles(run, with_tendon, "tendon_length", "Tendon length", "mm", 1e3)
    lines = tuple(
        Line(line.label, line.times, line.values - 1e3 * slack[line.label], line.colour, line.style)
        for line in _muscle_lines(run, series, with_tendon, 1e3)
    )
    return Panel("tendon_length", "Tendon length beyond slack length", "mm", lines)


def _envelope_columns(run: BagSeries) -> list[Column]:
    """A panel per channel, for envelopes over each other hide each other; the recorded angles below.

    The raw EMG, if the bag holds it, is to the left of each envelope.
    """
    panels: list[Panel] = []
    raw: list[Panel | None] = []
    if run.drive is not None:
        for index, name in enumerate(run.drive.names):
            colour, style = look_of(index)
            line = Line(name, run.drive.times, run.drive.column(name), colour, style)
            title = f"EMG envelope {name}" if run.is_envelope else f"Activation {name}"
            marks = _stretches(run, name)
            panels.append(Panel("drive", title, "of maximum", (line,), limits=_drive_limits(run.drive), marks=marks))
            raw.append(_raw(run, name))
    if run.reference is not None:
        for name in run.reference.names:
            values = np.degrees(run.reference.column(name))
            line = Line(name, run.reference.times, values, SIMULATED)
            panels.append(Panel("angle", f"Recorded angle {name}", "deg", (line,)))
    rows = len(panels) if len(panels) <= MOST_ROWS else -(-len(panels) // 2)
    columns = []
    for i in range(0, len(panels), rows):
        shown = tuple(panels[i : i + rows])
        beside = (*raw[i : i + rows], *[None] * rows)[: len(shown)]
        columns += [Column("", (), beside)] if any(beside) else []
        columns.append(Column("", (), shown))
    return columns


def _raw(run: BagSeries, name: str) -> Panel | None:
    """The raw EMG of a channel, with what was noticed in it."""
    if run.raw is None or name not in run.raw.series.names:
        return None
    index = run.raw.series.names.index(name)
    line = Line(name, run.raw.series.times, run.raw.series.values[:, index], RECORDED, width=0.7)
    points = tuple(
        Mark(event.kind, event.start, event.end, event.value)
        for event in run.raw.events
        if event.name == name and event.kind in ("spike", "clipping")
    )
    unit = run.raw.units[index] or "no unit"
    return Panel("raw", f"Raw EMG {name}", unit, (line,), marks=(*_stretches(run, name), *points))


def _stretches(run: BagSeries, name: str) -> tuple[Mark, ...]:
    """Gaps of a channel, and stretches in which it holds no signal."""
    if run.raw is None or name not in run.raw.series.names:
        return ()
    times = run.raw.series.times
    missing = runs(np.isnan(run.raw.series.column(name)))
    # From the last value before a gap to the first one after it.
    gaps = [(times[max(start - 1, 0)], times[min(end, len(times) - 1)]) for start, end in missing.tolist()]
    events = [event for event in run.raw.events if event.name == name and event.kind in ("still", "no signal")]
    return (
        *(Mark("gap", float(start), float(end)) for start, end in gaps),
        *(Mark(event.kind, event.start, event.end) for event in events),
    )
