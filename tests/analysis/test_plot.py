"""A picture shows what its bag holds, and nothing that covers it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.text import Text
from numpy.testing import assert_allclose, assert_array_equal

from limb_nodes.analysis.plot.limbs import instants, posture
from limb_nodes.analysis.plot.panels import columns_of, look_of
from limb_nodes.analysis.plot.picture import picture
from limb_nodes.analysis.plot.series import Series, read_series
from limb_nodes.analysis.plot.thin import pooled, thinned
from limb_nodes.bags.types import make_message
from limb_nodes.bags.write import BagWriter
from limb_nodes.errors import UserError
from limb_nodes.foundation.topics import TOPIC_TYPES
from limb_nodes.model import load_limb, parse_limb
from limb_nodes.model.points import points
from limb_nodes.signals.emg import envelopes
from limb_nodes.signals.envelope_bag import write_envelopes as write_emg
from limb_nodes.signals.options import EnvelopeOptions
from limb_nodes.signals.recording import Recording

PARAMS = Path(__file__).resolve().parents[2] / "params"
RATE = 100
STATES = ("muscle_state", "motor_unit_state")
REST = ("activation", "joint_torque", "joint_states")


def content_of(name: str) -> dict[str, Any]:
    """A limb of `params/` as data."""
    content: dict[str, Any] = json.loads(json.dumps(load_limb(PARAMS / f"{name}.yaml").content))
    return content


def with_muscles(count: int, units: int = 1) -> dict[str, Any]:
    """The reference joint with tendons and any number of muscles, of any number of units."""
    content = content_of("reference_joint_tendon")
    flexor = content["muscles"][0]
    content["muscles"] = [
        flexor | {"name": f"m{i}", "units": [{"kind": flexor["units"][0]["kind"], "name": "u", "count": units}]}
        for i in range(count)
    ]
    return content


def values_of(size: int, ticks: int, scale: float = 1.0) -> Any:
    """Waves that differ from column to column, [ticks, size], all greater than 0."""
    time = np.arange(ticks)[:, np.newaxis] / RATE
    return scale * (0.5 + 0.4 * np.sin(2 * np.pi * time + np.arange(size)))


def write_run(
    path: Path,
    content: dict[str, Any] | None,
    ticks: int = 101,
    topics: tuple[str, ...] = (*REST, *STATES),
    namespace: str = "",
    pennation: float = 0.0,
) -> Path:
    """A bag of a run whose numbers are `values_of`; `content` is the limb."""
    text = json.dumps(content) if content else ""
    limb = parse_limb(text, "limb.yaml") if content else parse_limb(json.dumps(content_of("reference_joint")), "x")
    names, joints = limb.muscle_names, limb.joint_names
    owners = [muscle.name for muscle in limb.muscles for _ in muscle.units]
    units = [unit.name for muscle in limb.muscles for unit in muscle.units]
    n, u, j = len(names), len(units), len(joints)
    by_muscle, by_unit, by_joint = values_of(n, ticks), values_of(u, ticks), values_of(j, ticks)
    info: dict[str, Any] = {"rate": float(RATE), "versions": {"limb_nodes": "0"}}
    if text:
        info |= {"limb": text, "limb_file": "limb.yaml"}
    with BagWriter(path, info, namespace=namespace) as bag:
        for k in range(ticks):
            stamp = k * 1_000_000_000 // RATE
            muscles, frequency, angles = by_muscle[k], 20 * by_unit[k], by_joint[k]
            every: dict[str, dict[str, Any]] = {
                "activation": {"tick": k, "name": names, "activation": muscles},
                "joint_torque": {"tick": k, "joint": joints, "torque": 3 * angles},
                "joint_states": {"name": joints, "position": angles, "velocity": 2 * angles},
                "muscle_state": {
                    "tick": k, "name": names, "muscle_force": 100 * muscles, "torque": 2 * muscles,
                    "muscle_tendon_length": 0.3 + 0.01 * muscles, "muscle_length": 0.2 + 0.01 * muscles,
                    "fibre_length": 0.1 + 0.01 * muscles, "tendon_length": 0.03 + 0.001 * muscles,
                    "pennation_angle": np.full(n, pennation),
                },
                "motor_unit_state": {
                    "tick": k, "muscle": owners, "unit": units,
                    "stimulation_frequency": np.where(frequency > 5, frequency, 0),
                },
            }  # fmt: skip
            for topic in topics:
                bag.write(topic, stamp, make_message(TOPIC_TYPES[topic], stamp, **every[topic]))
    return path


def write_envelopes(path: Path, names: list[str], angles: list[str], ticks: int = 101, first: int = 0) -> Path:
    """A bag of envelopes with recorded angles, as `limb emg` writes."""
    envelopes, recorded = values_of(len(names), ticks), values_of(len(angles), ticks)
    with BagWriter(path, {"source": "/somewhere/walk.txt", "rate": float(RATE)}) as bag:
        for k in range(ticks):
            stamp = (first + k) * 1_000_000_000 // RATE
            message = make_message(TOPIC_TYPES["emg_envelope"], stamp, name=names, envelope=envelopes[k])
            bag.write("emg_envelope", stamp, message)
            if angles:
                message = make_message("sensor_msgs/msg/JointState", stamp, name=angles, position=recorded[k])
                bag.write("reference_angle", stamp, message)
    return path


def panels(figure: Figure, kind: str) -> list[Axes]:
    """The axes that show a kind of thing."""
    return [axes for axes in figure.axes if str(axes.get_label()).split(":")[1:2] == [kind]]


def panel(figure: Figure, kind: str) -> Axes:
    found = panels(figure, kind)
    assert len(found) == 1
    return found[0]


def title_of(axes: Axes) -> Text:
    """The text of the title at the left."""
    texts = [text for text in axes.get_children() if isinstance(text, Text)]
    return next(text for text in texts if text.get_text() == axes.get_title("left"))


def drawn(axes: Axes, colour: str) -> Any:
    """The values of the one line of a colour."""
    lines = [line for line in axes.lines if line.get_color() == colour and len(line.get_xdata()) > 2]
    assert len(lines) == 1
    return lines[0].get_ydata()


@pytest.fixture(scope="module")
def run_bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_run(tmp_path_factory.mktemp("bags") / "run", content_of("reference_joint_tendon"))


def test_every_line_holds_the_values_of_the_bag_in_the_unit_that_the_axis_names(run_bag: Path) -> None:
    figure = picture(read_series(run_bag))
    limb = load_limb(PARAMS / "reference_joint_tendon.yaml")
    muscles = values_of(2, 101)
    slack = [muscle.laws["tendon"].values["slack_length"] for muscle in limb.muscles]
    for i in range(2):
        colour, _ = look_of(i)
        value = muscles[:, i]
        for kind, unit, wanted in (
            ("drive", "of maximum", value),
            ("muscle_force", "N", 100 * value),
            ("torque", "N m", 2 * value),
            ("muscle_tendon_length", "mm", 300 + 10 * value),
            ("fibre_length", "mm", 100 + 10 * value),
            ("tendon_length", "mm", 30 + value - 1e3 * slack[i]),
        ):
            axes = panel(figure, kind)
            assert axes.get_ylabel() == unit
            assert_allclose(drawn(axes, colour), wanted, atol=1e-9)
    angle = values_of(1, 101)[:, 0]
    assert_allclose(drawn(panel(figure, "angle"), "#000000"), np.degrees(angle))
    assert_allclose(drawn(panel(figure, "velocity"), "#000000"), np.degrees(2 * angle))
    assert panel(figure, "velocity").get_ylabel() == "deg/s"
    net = next(line for line in panel(figure, "torque").lines if line.get_label() == "net torque")
    assert_allclose(net.get_ydata(), 3 * angle)
    frequency = panel(figure, "frequency")
    assert frequency.get_ylabel() == "Hz"
    assert_allclose(drawn(frequency, look_of(0)[0]).max(), 20 * muscles[:, 0].max())


def test_the_bag_alone_is_enough_to_draw_the_limb(run_bag: Path) -> None:
    run = read_series(run_bag)
    assert run.limb is not None
    assert run.angle is not None
    figure = picture(run)
    limbs = [axes for axes in figure.axes if str(axes.get_label()).startswith("limb:")]
    assert len(limbs) == 7
    for axes in limbs:
        time = float(str(axes.get_label()).split(":")[1])
        tick = round(time * RATE)
        assert f"{time:.2f} s" == axes.get_title()
        bones = next(line for line in axes.lines if line.get_gid() == "bones")
        wanted = points(run.limb, list(run.angle.values[tick]))
        assert_allclose(np.column_stack(bones.get_data()), [wanted[0], wanted[-1]])
        assert {line.get_gid() for line in axes.lines} >= {"base", "flexor", "extensor"}
        assert axes.get_aspect() == 1.0
    marks = [line.get_xdata()[0] for line in panel(figure, "angle").lines if line.get_linestyle() == ":"]
    assert_allclose(marks, [float(str(axes.get_label()).split(":")[1]) for axes in limbs])


def test_a_posture_has_its_muscles_at_their_activation(run_bag: Path) -> None:
    run = read_series(run_bag)
    assert run.limb is not None
    found = posture(run, run.limb, 40)
    assert found.time == pytest.approx(0.4)
    assert [activation for _, _, activation in found.muscles] == pytest.approx(list(values_of(2, 101)[40]))


def test_instants_are_the_ends_and_postures_that_differ() -> None:
    times = np.arange(1001) / 100
    angle = np.where((times > 4) & (times < 4.3), 2.0, 0.0)[:, np.newaxis]
    found = instants(Series(("knee",), times, angle), 5)
    assert found == sorted(set(found))
    assert found[0] == 0
    assert found[-1] == 1000
    assert any(angle[i, 0] == 2.0 for i in found)
    assert instants(Series(("knee",), times[:3], angle[:3]), 5) == [0, 1, 2]
    still = instants(Series(("knee",), times, 0 * angle), 5)
    assert_allclose(times[still], [0, 2.5, 5, 7.5, 10], atol=0.05)


@pytest.mark.parametrize("bag", ["run", "eight", "knee"])
def test_no_legend_covers_data(tmp_path: Path, bag: str) -> None:
    content = {"run": content_of("reference_joint"), "eight": with_muscles(8), "knee": content_of("seated_knee")}[bag]
    path = write_run(tmp_path / "run", content)
    joint = content["segments"][0]["joint"]
    reference = write_envelopes(tmp_path / "env", ["m"], [joint])
    figure = picture(read_series(path, reference=reference))
    figure.canvas.draw()
    legends = [legend for axes in figure.axes for legend in axes.get_children() if isinstance(legend, Legend)]
    assert len(legends) >= 3
    for legend in legends:
        box = legend.get_window_extent()
        for axes in figure.axes:
            if axes.lines and axes.axison:
                assert not box.overlaps(title_of(axes).get_window_extent()), axes.get_label()
                # The inside of the axes, without the width of a dot.
                assert not box.overlaps(axes.get_window_extent().padded(-1.0)), axes.get_label()
        assert box.x0 >= 0
        assert box.x1 <= figure.bbox.x1 + 1
        assert box.y1 <= figure.bbox.y1


def test_a_bag_without_states_shows_the_rest(tmp_path: Path) -> None:
    figure = picture(read_series(write_run(tmp_path / "run", content_of("reference_joint"), topics=REST)))
    kinds = {str(axes.get_label()).split(":")[1] for axes in figure.axes if str(axes.get_label()).count(":") == 2}
    assert kinds == {"drive", "torque", "angle", "velocity"}


@pytest.mark.parametrize("topic", [*REST, *STATES])
def test_a_bag_with_one_topic_is_drawn(tmp_path: Path, topic: str) -> None:
    for name, content in (("limb", content_of("arm")), ("none", None)):
        figure = picture(read_series(write_run(tmp_path / name, content, topics=(topic,))))
        figure.canvas.draw()
        assert any(axes.lines or axes.images for axes in figure.axes)


@pytest.mark.parametrize("count", [1, 8])
def test_each_muscle_has_one_look_of_its_own_in_all_panels(tmp_path: Path, count: int) -> None:
    figure = picture(read_series(write_run(tmp_path / "run", with_muscles(count))))
    looks = {}
    for kind in ("drive", "muscle_force", "fibre_length"):
        lines = panel(figure, kind).lines
        looks[kind] = [(line.get_color(), line.get_linestyle()) for line in lines]
        assert len(set(looks[kind])) == count
    assert looks["drive"] == looks["muscle_force"] == looks["fibre_length"]


def test_many_units_become_a_raster(tmp_path: Path) -> None:
    figure = picture(read_series(write_run(tmp_path / "run", with_muscles(2, units=100))))
    axes = panel(figure, "frequency")
    assert len(axes.lines) == 1, "between the muscles"
    (image,) = axes.images
    cells = image.get_array()
    assert cells.shape == (200, 101)
    wanted = 20 * values_of(200, 101).T
    assert_array_equal(cells.mask, wanted <= 5)
    assert_allclose(cells.compressed(), wanted[wanted > 5])
    assert [label.get_text() for label in axes.get_yticklabels()] == ["m0", "m1"]
    figure.canvas.draw()


def test_several_joints_stand_side_by_side_with_their_own_muscles(tmp_path: Path) -> None:
    run = read_series(write_run(tmp_path / "run", content_of("arm")))
    assert run.limb is not None
    columns = columns_of(run)
    assert [column.title for column in columns] == ["shoulder", "elbow"]
    assert [[name.split()[0] for name, _, _ in column.muscles] for column in columns] == [
        ["SF", "SE"],
        ["BIC", "BRA", "TRI"],
    ]
    figure = picture(run)
    angles = values_of(2, 101)
    for index, axes in enumerate(panels(figure, "angle")):
        assert_allclose(drawn(axes, "#000000"), np.degrees(angles[:, index]))
    for index, axes in enumerate(panels(figure, "drive")):
        assert len(axes.lines) == len(columns[index].muscles)


def test_pennate_muscles_show_their_angle_and_the_lengths_that_differ(tmp_path: Path) -> None:
    bag = write_run(tmp_path / "run", content_of("reference_joint"), pennation=0.3)
    figure = picture(read_series(bag))
    assert_allclose(drawn(panel(figure, "pennation_angle"), look_of(0)[0]), np.degrees(0.3))
    assert_allclose(drawn(panel(figure, "muscle_length"), look_of(0)[0]), 200 + 10 * values_of(2, 101)[:, 0])


def test_an_envelope_bag_shows_channels_and_recorded_angles(tmp_path: Path) -> None:
    figure = picture(read_series(write_envelopes(tmp_path / "env", ["RF", "BF", "VM"], ["FX"])))
    found = panels(figure, "drive")
    assert [axes.get_title(loc="left") for axes in found] == [f"EMG envelope {name}" for name in ("RF", "BF", "VM")]
    for index, axes in enumerate(found):
        assert_allclose(drawn(axes, look_of(index)[0]), values_of(3, 101)[:, index])
    assert_allclose(drawn(panel(figure, "angle"), "#000000"), np.degrees(values_of(1, 101)[:, 0]))
    assert figure.get_suptitle() == "walk.txt"


def test_a_bag_of_limb_emg_shows_raw_emg_gaps_and_notes(tmp_path: Path) -> None:
    rng, names = np.random.default_rng(0), ("RF", "BF", "VM", "ST")
    time = np.arange(6000) / 1000.0
    values = rng.normal(size=(6000, 4)) * (0.05 + np.clip(np.sin(np.pi * time), 0, 1))[:, None]
    values[4100, 0] = 60.0
    values[3000:4000, 1] = np.nan
    values[:, 2] = np.clip(values[:, 2], -0.5, 0.5)
    values[:, 3] = 0.0
    recording = Recording("/somewhere/walk.txt", names, ("mV", "uV", "", "mV"), values, 1000.0)
    options = EnvelopeOptions(channels={"RF": "rectus", "BF": "BF", "VM": "VM", "ST": "ST"}, keep_gaps=True)
    result = envelopes(recording, options)
    write_emg(result, tmp_path / "env", options)
    series = read_series(tmp_path / "env")
    figure = picture(series)
    raw, drive = panels(figure, "raw"), panels(figure, "drive")
    assert [axes.get_title(loc="left") for axes in raw] == [f"Raw EMG {name}" for name in ("rectus", *names[1:])]
    assert [axes.get_ylabel() for axes in raw] == ["mV", "uV", "no unit", "mV"]
    # As drawn, thinned, with the highest value kept.
    assert np.nanmax(drawn(raw[0], "#999999")) == pytest.approx(60.0)
    assert_allclose(np.nanmax(drawn(drive[2], look_of(2)[0])), 1.0)
    marks = [[(mark.kind, mark.start, mark.end) for mark in one.marks] for one in columns_of(series)[0].panels if one]
    assert marks[0] == [("spike", 4.1, 4.1)]
    assert marks[1] == [("gap", pytest.approx(2.999), pytest.approx(4.0))]
    assert [kind for kind, _, _ in marks[2]] == ["clipping", "clipping"]
    assert marks[3] == [("no signal", 0.0, 5.999)]
    for axes, kind in zip(raw, ("spike", "gap", "clipping", "no signal"), strict=True):
        assert [text.get_text() for text in axes.texts] == [kind]
    assert [[text.get_text() for text in axes.texts] for axes in drive] == [[], ["gap"], [], ["no signal"]]
    (remarks,) = (axes for axes in figure.axes if axes.get_label() == "remarks")
    written = " ".join(remarks.texts[0].get_text().split())
    assert len(result.notes) == 5
    for note in result.notes:
        assert f"note: {note}" in written
    # Raw EMG and envelope of a channel stand beside each other.
    figure.draw_without_rendering()
    for left, right in zip(raw, drive, strict=True):
        assert_allclose(left.get_position().bounds[1::2], right.get_position().bounds[1::2], atol=1e-6)
        assert left.get_position().x1 < right.get_position().x0


def test_a_part_of_a_bag_of_limb_emg_can_be_drawn_and_one_without_raw_emg(tmp_path: Path) -> None:
    values = np.random.default_rng(0).normal(size=(6000, 9))
    names = tuple(f"muscle {k}" for k in range(9))
    result = envelopes(Recording("walk.txt", names, ("mV",) * 9, values, 1000.0))
    write_emg(result, tmp_path / "env")
    series = read_series(tmp_path / "env", start=2.0, end=3.0)
    assert series.raw is not None
    assert (series.start, series.end) == (2.0, 3.0)
    assert_allclose(series.raw.series.values, values[2000:3001], rtol=1e-6)
    # Nine channels take two columns of panels, each beside that of its raw EMG.
    assert [len([one for one in column.panels if one]) for column in columns_of(series)] == [5, 5, 4, 4]
    write_emg(result, tmp_path / "less", raw=False)
    assert read_series(tmp_path / "less").raw is None
    assert panels(picture(read_series(tmp_path / "less")), "raw") == []


def test_the_recorded_angle_is_drawn_beside_the_simulated_one(tmp_path: Path) -> None:
    run = write_run(tmp_path / "run", content_of("reference_joint"))
    late = write_envelopes(tmp_path / "env", ["RF"], ["FX"], first=500)
    figure = picture(read_series(run, reference=late))
    axes = panel(figure, "angle")
    line = next(line for line in axes.lines if line.get_label() == "recorded")
    assert_allclose(line.get_ydata(), np.degrees(values_of(1, 101)[:, 0]))
    assert_allclose(line.get_xdata(), np.arange(101) / RATE, atol=1e-9)
    assert [text.get_text() for text in axes.get_legend().get_texts()][:2] == ["recorded", "simulated"]


def test_recorded_angles_find_their_joints_by_name(tmp_path: Path) -> None:
    run = write_run(tmp_path / "run", content_of("arm"))
    named = write_envelopes(tmp_path / "named", ["RF"], ["x", "elbow"])
    figure = picture(read_series(run, reference=named))
    shoulder, elbow = panels(figure, "angle")
    assert not any(line.get_label() == "recorded" for line in shoulder.lines)
    line = next(line for line in elbow.lines if line.get_label() == "recorded")
    assert_allclose(line.get_ydata(), np.degrees(values_of(2, 101)[:, 1]))
    other = write_envelopes(tmp_path / "other", ["RF"], ["FX"])
    with pytest.raises(UserError, match=r"angles are FX; the name of a joint .shoulder, elbow. is needed.*FX=shoulder"):
        read_series(run, reference=other)
    none = write_envelopes(tmp_path / "none", ["RF"], [])
    with pytest.raises(UserError, match=r"which has /emg_envelope.*; a message on reference_angle is needed"):
        read_series(run, reference=none)


def test_namespaces(tmp_path: Path) -> None:
    limb = content_of("reference_joint")
    bag = write_run(tmp_path / "left", limb, namespace="left")
    for namespace in ("", "left", "/left/"):
        run = read_series(bag, namespace=namespace)
        assert run.limb is not None
        assert run.drive is not None
    with pytest.raises(UserError, match=r"namespace is right; one of left is needed"):
        read_series(bag, namespace="right")
    two = tmp_path / "two"
    message = make_message(TOPIC_TYPES["activation"], 0, tick=0, name=["a"], activation=[0.5])
    with BagWriter(two, {}) as writer:
        for side in ("left", "right"):
            writer.write(f"/{side}/activation", 0, message)
    with pytest.raises(UserError, match=r"namespace is empty; one of left, right is needed"):
        read_series(two)
    assert read_series(two, namespace="right").drive is not None


def test_a_stretch_of_time(run_bag: Path) -> None:
    run = read_series(run_bag, start=0.25, end=0.5)
    assert (run.start, run.end) == (0.25, 0.5)
    figure = picture(run)
    axes = panel(figure, "muscle_force")
    assert axes.get_xlim() == (0.25, 0.5)
    assert_allclose(drawn(axes, look_of(0)[0]), 100 * values_of(2, 101)[25:51, 0])
    figure.canvas.draw()
    # Between two samples there is nothing to draw, but nothing fails.
    picture(read_series(run_bag, start=0.251, end=0.259)).canvas.draw()
    assert read_series(run_bag, end=7.0).end == 1.0


@pytest.mark.parametrize(
    ("start", "end", "line"),
    [
        (1.0, None, r"start is 1; a number < 1 in s is needed, the end of .*run"),
        (5.0, 9.0, r"start is 5; a number < 1 in s is needed, the end of .*run"),
        (None, 0.0, r"end is 0; a number > 0 in s is needed, the start of .*run"),
        (0.5, 0.5, r"end is 0.5; a number > the start \(0.5\) in s is needed"),
        (float("nan"), None, r"start is nan; a finite number in s is needed"),
    ],
)
def test_a_stretch_that_is_not_there(run_bag: Path, start: float | None, end: float | None, line: str) -> None:
    with pytest.raises(UserError, match=line):
        read_series(run_bag, start=start, end=end)


def test_a_bag_without_anything_to_draw(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag", {}) as bag:
        bag.write("robot_description", 0, make_message(TOPIC_TYPES["robot_description"], data="x"))
    with pytest.raises(UserError, match=r"has /robot_description.*nothing to draw; a message on activation or "):
        read_series(tmp_path / "bag")


def test_a_bag_of_a_run_that_never_began(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag", {}) as bag:
        bag.expect({topic: TOPIC_TYPES[topic] for topic in ("activation", "joint_states")})
    with pytest.raises(UserError, match=r"bag: /activation, /joint_states have no messages, nothing to draw"):
        read_series(tmp_path / "bag")


def test_a_limb_that_cannot_be_read_is_left_out_and_noted(tmp_path: Path) -> None:
    info = {"limb": "name: x\n", "limb_file": "x.yaml"}
    with BagWriter(tmp_path / "bag", info) as bag:
        for k in range(3):
            bag.write("joint_states", k, make_message(TOPIC_TYPES["joint_states"], k, name=["a", "b"], position=[k, 1]))
    run = read_series(tmp_path / "bag")
    assert len(run.notes) == 1
    assert "x.yaml" in run.notes[0]
    assert len(panel(picture(run), "angle").lines) == 2


def test_long_recordings_keep_their_peaks() -> None:
    times = np.arange(200_000) / 1000
    values = np.sin(times)
    values[123_456], values[77_777] = 9.0, -9.0
    short, thin = thinned(times, values)
    assert len(short) < 3000
    assert thin.max() == 9.0
    assert short[thin.argmax()] == times[123_456]
    assert thin.min() == -9.0
    assert (short[0], short[-1]) == (times[0], times[-1])
    assert np.all(np.diff(short) > 0)
    cells = pooled(times, values[:, np.newaxis])
    assert len(cells) == 1200
    assert cells.max() == 9.0
    assert not np.isnan(cells).any()


@pytest.mark.parametrize("size", [300, 30_000])
def test_nothing_is_drawn_where_ticks_are_missing(size: int) -> None:
    times = np.concatenate([np.arange(size), 2 * size + np.arange(size)]) / 1000
    found, values = thinned(times, np.ones(2 * size))
    (gap,) = np.flatnonzero(np.isnan(values))
    assert found[gap - 1] == times[size - 1]
    assert found[gap + 1] == times[size]
    cells = pooled(times, np.ones((2 * size, 1)))
    assert np.isnan(cells).mean() == pytest.approx(1 / 3, abs=0.01)


def test_missing_numbers_do_not_hide_peaks() -> None:
    times = np.arange(20_000) / 1000
    values = np.zeros(20_000)
    values[::7] = np.nan
    values[10_000] = 5.0
    assert np.nanmax(thinned(times, values)[1]) == 5.0


@pytest.mark.parametrize("bins", [1, 7, 1200])
def test_few_samples_stay_as_they_are(bins: int) -> None:
    for size in (0, 1, 2, 4):
        times = np.arange(size) * 0.5
        assert_array_equal(thinned(times, times, bins)[1], times)
