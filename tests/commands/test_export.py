"""`limb export`: what other programs read is what the bag holds; power and work are those of mechanics."""

from __future__ import annotations

import csv
import math
import subprocess
import sys
import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import trapezoid

from limb_nodes.analysis.export.power import Work
from limb_nodes.analysis.export.table import ROWS, BagTable, Choice
from limb_nodes.bags.bulk import write_table
from limb_nodes.bags.read import BagReader
from limb_nodes.bags.write import BagWriter
from limb_nodes.cli import main
from limb_nodes.foundation.topics import TOPIC_TYPES
from limb_nodes.model import load_limb
from limb_nodes.signals.activation import load_activation

ROOT = Path(__file__).resolve().parents[2]
MUSCLES, JOINTS = ["RF", "biceps femoris"], ["hip", "knee"]
PERIOD = 1_000_000
ENDS = "a name that ends in .sto or .mot or .csv or .parquet is needed"
Floats = NDArray[np.float64]


def write(writer: BagWriter, topic: str, stamps: Any, same: dict[str, Any], numbers: dict[str, Any]) -> None:
    """Write a topic, relative or within a namespace."""
    write_table(writer, topic, TOPIC_TYPES[topic.rpartition("/")[2]], np.asarray(stamps), same, numbers)


def random_run(path: Path, rows: int = ROWS + 500, namespace: str = "") -> dict[str, Floats]:
    """A bag of random numbers with the main topics of a run; its numbers [rows, 2] by topic.field."""
    rng = np.random.default_rng(7)
    stamps = np.arange(rows) * PERIOD
    numbers: dict[str, dict[str, Floats]] = {
        "activation": {"activation": rng.random((rows, 2))},
        "movement_pattern": {field: rng.normal(size=(rows, 2)) for field in ("angle", "velocity", "acceleration")},
        "joint_states": {"position": rng.normal(size=(rows, 2)), "velocity": rng.normal(size=(rows, 2))},
        "joint_torque": {"torque": rng.normal(size=(rows, 2)) * 1e3},
        "muscle_state": {
            field: rng.normal(size=(rows, 2)) for field in ("muscle_force", "muscle_tendon_velocity", "pennation_angle")
        },
        "motor_unit_state": {"force": rng.normal(size=(rows, 3))},
    }
    same: dict[str, dict[str, Any]] = {
        "activation": {"name": MUSCLES},
        "movement_pattern": {"joint": JOINTS},
        "joint_states": {"name": JOINTS},
        "joint_torque": {"joint": JOINTS},
        "muscle_state": {"name": MUSCLES},
        "motor_unit_state": {"muscle": ["RF", "RF", "biceps femoris"], "unit": ["slow", "fast", "slow"]},
    }
    with BagWriter(path, {}, namespace=namespace) as writer:
        for topic, values in numbers.items():
            write(writer, topic, stamps, same[topic], values)
    return {f"{topic}.{field}": value for topic, fields in numbers.items() for field, value in fields.items()}


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Floats]]:
    path = tmp_path_factory.mktemp("bags") / "walk"
    return path, random_run(path)


@pytest.fixture
def envelopes(tmp_path: Path) -> Path:
    """A bag as of `limb emg`: two envelopes and a recorded angle at 100 Hz."""
    stamps, values = np.arange(101) * 10_000_000, np.random.default_rng(3).random((101, 2))
    with BagWriter(tmp_path / "env", {}) as writer:
        write(writer, "emg_envelope", stamps, {"name": MUSCLES}, {"envelope": values})
        write(writer, "reference_angle", stamps, {"name": ["knee"]}, {"position": values[:, :1] * 2.0})
    return tmp_path / "env"


def storage(path: Path) -> tuple[str, dict[str, str], list[str], Floats]:
    """Name, keys, labels and rows of OpenSim's storage, by the page "Storage (.sto) Files" of its documentation."""
    lines = path.read_text(encoding="ascii").split("\n")
    end = lines.index("endheader")
    keys = dict(line.split("=", 1) for line in lines[1:end] if "=" in line)
    labels = lines[end + 1].split("\t")
    assert lines[-1] == "", "the last line ends as the others"
    rows = np.array([[float(cell) for cell in line.split("\t")] for line in lines[end + 2 : -1]])
    assert rows.shape == (int(keys["nRows"]), int(keys["nColumns"])) == (len(rows), len(labels))
    return lines[0], keys, labels, rows


def comma_separated(path: Path) -> dict[str, Floats]:
    with path.open(encoding="utf-8", newline="") as file:
        titles, *rows = csv.reader(file)
    return dict(zip(titles, np.array(rows, dtype=float).T, strict=True))


def test_a_storage_file_is_as_its_documentation_says(bag: tuple[Path, dict[str, Floats]], tmp_path: Path) -> None:
    path, numbers = bag
    assert main(["export", str(path), "-o", str(tmp_path / "a.sto")]) == 0
    name, keys, labels, rows = storage(tmp_path / "a.sto")
    assert (name, keys["version"], keys["inDegrees"]) == ("walk", "1", "no")
    assert labels[:8] == [
        "time",
        "RF",
        "biceps_femoris",
        "hip",
        "knee",
        "hip_velocity",
        "knee_velocity",
        "hip_acceleration",
    ]
    assert len(set(labels)) == len(labels)
    np.testing.assert_array_equal(rows[:, 0], np.arange(ROWS + 500) / 1000)
    for label, field, column in (
        ("biceps_femoris", "activation.activation", 1),
        ("knee", "movement_pattern.angle", 1),
        ("hip_velocity", "movement_pattern.velocity", 0),
        ("knee_torque", "joint_torque.torque", 1),
        ("RF_muscle_force", "muscle_state.muscle_force", 0),
        ("RF_pennation_angle", "muscle_state.pennation_angle", 0),
    ):
        np.testing.assert_array_equal(rows[:, labels.index(label)], numbers[field][:, column], err_msg=label)


def test_a_motion_has_degrees_and_says_so(bag: tuple[Path, dict[str, Floats]], tmp_path: Path) -> None:
    path, numbers = bag
    degrees = np.degrees(numbers["movement_pattern.angle"][:, 1])
    for options, said, expected in (
        (["-o", str(tmp_path / "a.mot")], "yes", degrees),
        (["-o", str(tmp_path / "b.mot"), "--radians"], "no", np.radians(degrees)),
        (["-o", str(tmp_path / "c.sto"), "--degrees"], "yes", degrees),
    ):
        assert main(["export", str(path), *options]) == 0
        _, keys, labels, rows = storage(Path(options[1]))
        assert keys["inDegrees"] == said
        np.testing.assert_allclose(rows[:, labels.index("knee")], expected, rtol=1e-15)
        scale = np.ptp(rows[:, labels.index("RF_pennation_angle")]) / np.ptp(
            numbers["muscle_state.pennation_angle"][:, 0]
        )
        assert scale == pytest.approx(180 / math.pi if said == "yes" else 1.0)
        np.testing.assert_array_equal(rows[:, labels.index("knee_torque")], numbers["joint_torque.torque"][:, 1])


def test_csv_has_units_in_its_names(bag: tuple[Path, dict[str, Floats]], tmp_path: Path) -> None:
    path, numbers = bag
    assert main(["export", str(path), "-o", str(tmp_path / "a.csv"), "--from", "0.5", "--to", "0.7"]) == 0
    columns = comma_separated(tmp_path / "a.csv")
    np.testing.assert_array_equal(columns["time [s]"], np.arange(500, 701) / 1000)
    for title, field, column in (
        ("biceps femoris", "activation.activation", 1),
        ("knee [rad]", "movement_pattern.angle", 1),
        ("hip_acceleration [rad/s^2]", "movement_pattern.acceleration", 0),
        ("knee_torque [N m]", "joint_torque.torque", 1),
        ("RF_muscle_tendon_velocity [m/s]", "muscle_state.muscle_tendon_velocity", 0),
    ):
        np.testing.assert_array_equal(columns[title], numbers[field][500:701, column], err_msg=title)
    assert main(["export", str(path), "-o", str(tmp_path / "b.csv"), "--degrees", "--columns", "knee*"]) == 0
    assert list(comma_separated(tmp_path / "b.csv"))[:4] == [
        "time [s]", "knee [deg]", "knee_velocity [deg/s]", "knee_acceleration [deg/s^2]",
    ]  # fmt: skip


def test_parquet_holds_the_same(bag: tuple[Path, dict[str, Floats]], tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet", reason="pyarrow is not installed")
    for ending in ("csv", "parquet"):
        assert main(["export", str(bag[0]), "-o", str(tmp_path / f"a.{ending}")]) == 0
    expected = comma_separated(tmp_path / "a.csv")
    table = parquet.read_table(tmp_path / "a.parquet")
    assert table.column_names == list(expected)
    for title, values in expected.items():
        np.testing.assert_array_equal(table[title].to_numpy(), values, err_msg=title)


def test_parquet_without_pyarrow_is_one_line(
    envelopes: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    out = tmp_path / "a.parquet"
    assert main(["export", str(envelopes), "-o", str(out)]) == 2
    line = f"limb: error: {out}: pyarrow is not installed; `pip install pyarrow` is needed for a .parquet\n"
    assert capsys.readouterr().err == line
    assert not out.exists()


def test_opensim_reads_it(
    bag: tuple[Path, dict[str, Floats]], envelopes: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # OpenSim writes a log into the folder in which it is loaded.
    monkeypatch.chdir(tmp_path)
    opensim = pytest.importorskip("opensim", reason="opensim is not installed")
    for path, ending in ((bag[0], ".sto"), (bag[0], ".mot"), (envelopes, ".sto"), (envelopes, ".mot")):
        out = tmp_path / f"{path.name}{ending}"
        assert main(["export", str(path), "-o", str(out)]) == 0
        name, _, labels, rows = storage(out)
        read = opensim.Storage(str(out))
        assert read.getName() == name
        assert read.isInDegrees() == (ending == ".mot")
        assert read.getSize() == len(rows)
        known = read.getColumnLabels()
        assert [known.get(i) for i in range(known.getSize())] == labels
        for index, label in enumerate(labels):
            column = opensim.ArrayDouble()
            if index:
                read.getDataColumn(label, column)
            else:
                read.getTimeColumn(column)
            np.testing.assert_array_equal([column.get(i) for i in range(column.getSize())], rows[:, index])
        table = opensim.TimeSeriesTable(str(out))
        assert list(table.getColumnLabels()) == labels[1:]
        np.testing.assert_array_equal(table.getMatrix().to_numpy(), rows[:, 1:])


def test_what_opensim_writes_drives_a_limb(envelopes: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Headers of versions 1 (Storage) and 3 (TimeSeriesTable)."""
    monkeypatch.chdir(tmp_path)
    opensim = pytest.importorskip("opensim", reason="opensim is not installed")
    assert main(["export", str(envelopes), "-o", "ours.sto", "--topics", "emg_envelope"]) == 0
    _, _, labels, rows = storage(Path("ours.sto"))
    opensim.Storage("ours.sto").printToFile("version1.sto", "w")
    opensim.STOFileAdapter.write(opensim.TimeSeriesTable("ours.sto"), "version3.sto")
    # Storage writes 8 digits behind the point, TimeSeriesTable 16 in all.
    for name, error in (("ours.sto", 0.0), ("version1.sto", 5.1e-9), ("version3.sto", 1e-15)):
        read = load_activation(name, labels[1:], 100.0, None)
        np.testing.assert_allclose(read.values, rows[:, 1:], rtol=0.0, atol=error, err_msg=name)


@pytest.mark.parametrize("ending", [".csv", ".sto", ".mot"])
def test_exported_envelopes_drive_a_limb(envelopes: Path, tmp_path: Path, ending: str) -> None:
    out = tmp_path / f"a{ending}"
    assert main(["export", str(envelopes), "-o", str(out), "--topics", "emg_envelope"]) == 0
    muscles = [name if ending == ".csv" else "_".join(name.split()) for name in MUSCLES]
    with BagReader(envelopes) as reader:
        expected = reader.table("emg_envelope")["envelope"]
    np.testing.assert_array_equal(load_activation(str(out), muscles, 100.0, None).values, expected)


def test_envelopes_keep_the_names_of_the_muscles(
    envelopes: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "a.csv"
    assert main(["export", str(envelopes), "-o", str(out)]) == 0
    assert capsys.readouterr().out == f"table  {out} (101 rows, 3 columns, 0 to 1 s)\n"
    assert list(comma_separated(out)) == ["time [s]", "RF", "biceps femoris", "knee [rad]"]


def test_power_is_force_times_shortening_and_torque_times_turning(
    bag: tuple[Path, dict[str, Floats]], tmp_path: Path
) -> None:
    """And work its integral by the trapezoidal rule, over the pieces too."""
    path, numbers = bag
    out = tmp_path / "a.csv"
    assert main(["export", str(path), "-o", str(out), "--columns", "*_power", "*_work"]) == 0
    columns = comma_separated(out)
    powers = {
        **dict(zip(JOINTS, (numbers["joint_torque.torque"] * numbers["movement_pattern.velocity"]).T, strict=True)),
        **dict(zip(MUSCLES, (numbers["muscle_state.muscle_force"]
                             * numbers["muscle_state.muscle_tendon_velocity"]).T, strict=True)),
    }  # fmt: skip
    quantities = ("power [W]", "work [J]")
    titles = [f"{name}_{what}" for names in (JOINTS, MUSCLES) for what in quantities for name in names]
    assert list(columns) == ["time [s]", *titles]
    for name, power in powers.items():
        np.testing.assert_array_equal(columns[f"{name}_power [W]"], power)
        work = [trapezoid(power[: row + 1], dx=1e-3) for row in (0, 1, ROWS - 1, ROWS, len(power) - 1)]
        np.testing.assert_allclose(
            columns[f"{name}_work [J]"][[0, 1, ROWS - 1, ROWS, len(power) - 1]], work, rtol=1e-9, atol=1e-12
        )


def test_work_counts_from_the_first_row(bag: tuple[Path, dict[str, Floats]], tmp_path: Path) -> None:
    whole, part = tmp_path / "whole.csv", tmp_path / "part.csv"
    assert main(["export", str(bag[0]), "-o", str(whole)]) == 0
    assert main(["export", str(bag[0]), "-o", str(part), "--from", "1", "--columns", "knee_work"]) == 0
    expected = comma_separated(whole)["knee_work [J]"][1000:]
    np.testing.assert_allclose(comma_separated(part)["knee_work [J]"], expected - expected[0], atol=1e-9)


def test_work_of_a_known_power() -> None:
    """The trapezoidal rule is exact for a straight line, whatever the steps and the pieces are."""
    times = np.sort(np.random.default_rng(1).uniform(0.0, 3.0, 50))
    work = Work()
    done = np.concatenate(
        [work.add(part, np.stack([2.0 * part, -part], axis=1)) for part in np.split(times, [1, 7, 30])]
    )
    np.testing.assert_allclose(done, (times**2 - times[0] ** 2)[:, np.newaxis] * [1.0, -0.5], atol=1e-12)


def test_work_of_the_muscles_is_the_energy_that_the_limb_gains(tmp_path: Path) -> None:
    """With the path's own moment arm muscles and joint do the same work; it becomes kinetic and potential energy."""
    text = (ROOT / "params" / "reference_joint.yaml").read_text(encoding="utf-8")
    limb_file = tmp_path / "limb.yaml"
    limb_file.write_text(text.replace("constant_moment_arm", "geometric_moment_arm"), encoding="utf-8")
    run, out = tmp_path / "run", tmp_path / "run.csv"
    drive = ["--activation", "flexor=1,extensor=0.2", "--duration", "0.5", "--rate", "2000"]
    assert main(["simulate", str(limb_file), *drive, "--out", str(run)]) == 0
    assert main(["export", str(run), "-o", str(out)]) == 0
    columns = comma_separated(out)
    joint, muscles = columns["joint_work [J]"], columns["flexor_work [J]"] + columns["extensor_work [J]"]
    assert np.ptp(joint) > 0.1, "the limb moves"
    np.testing.assert_allclose(muscles, joint, atol=1e-9)
    segment = load_limb(limb_file).segments[0]
    inertia = segment.inertia + segment.mass * segment.com_distance**2
    # The segment hangs straight down at angle 0.
    height = -segment.com_distance * np.cos(columns["joint [rad]"])
    energy = 0.5 * inertia * columns["joint_velocity [rad/s]"] ** 2 + segment.mass * 9.81 * height
    np.testing.assert_allclose(joint, energy - energy[0], atol=2e-5)
    shortening = np.sign(np.diff(columns["flexor_muscle_tendon_length [m]"])) < 0
    power = columns["flexor_power [W]"]
    assert (power[:-1][shortening & (power[1:] > 0)] >= 0).all(), "shortening gives energy"


def test_topics_are_chosen_and_named(
    bag: tuple[Path, dict[str, Floats]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, numbers = bag
    out = tmp_path / "a.csv"
    assert main(["export", str(path), "-o", str(out)]) == 0
    assert "note: left out unless they are asked for: /motor_unit_state\n" in capsys.readouterr().out
    assert main(["export", str(path), "-o", str(out), "--force", "--topics", "/joint_torque", "motor_unit_state"]) == 0
    columns = comma_separated(out)
    np.testing.assert_array_equal(columns["RF_fast_force [N]"], numbers["motor_unit_state.force"][:, 1])
    assert not any(title.endswith("[W]") for title in columns), "no power without velocities"
    topics = ["joint_torque", "joint_states", "movement_pattern"]
    assert main(["export", str(path), "-o", str(out), "--force", "--topics", *topics]) == 0
    columns = comma_separated(out)
    np.testing.assert_array_equal(columns["knee [rad]"], numbers["movement_pattern.angle"][:, 1])
    np.testing.assert_array_equal(columns["knee_joint_states [rad]"], numbers["joint_states.position"][:, 1])


def test_a_namespace_is_chosen(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, out = tmp_path / "two", tmp_path / "a.csv"
    with BagWriter(path, {}) as writer:
        for scale, side in ((1.0, "left"), (2.0, "right")):
            write(writer, f"/{side}/activation", np.arange(3), {"name": ["RF"]}, {"activation": np.full((3, 1), scale)})
    assert main(["export", str(path), "-o", str(out)]) == 2
    assert capsys.readouterr().err == f"limb: error: {path}: --namespace is missing; one of left, right is needed\n"
    assert main(["export", str(path), "-o", str(out), "--topics", "activation"]) == 2
    line = (
        f"{path}: --topics names activation, which is there twice; one of /left/activation, /right/activation is needed"
    )
    assert capsys.readouterr().err == f"limb: error: {line}\n"
    for options in (
        ["--namespace", "right"],
        ["--namespace", "right", "--topics", "activation"],
        ["--topics", "right/activation"],
    ):
        assert main(["export", str(path), "-o", str(out), "--force", *options]) == 0
        np.testing.assert_array_equal(comma_separated(out)["RF"], [2.0, 2.0, 2.0])


def test_rows_are_the_times_that_all_topics_have(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """As in a bag whose recorder was killed, and with live envelopes at times of their own."""
    path, out = tmp_path / "cut", tmp_path / "a.csv"
    values = np.arange(100.0)[:, np.newaxis] / 100
    with BagWriter(path, {}) as writer:
        write(writer, "activation", np.arange(100) * PERIOD, {"name": ["RF"]}, {"activation": values})
        write(writer, "joint_torque", np.arange(3, 98) * PERIOD, {"joint": ["knee"]}, {"torque": values[3:98]})
        write(writer, "emg_envelope", np.arange(50) * PERIOD * 2 + 17, {"name": ["RF"]}, {"envelope": values[:50]})
    assert main(["export", str(path), "-o", str(out)]) == 0
    columns = comma_separated(out)
    assert list(columns) == ["time [s]", "RF", "knee_torque [N m]"]
    for column in columns.values():
        np.testing.assert_allclose(column * (10 if column is columns["time [s]"] else 1), values[3:98, 0])
    assert capsys.readouterr().out == (
        "note: left out: /emg_envelope, for its times are not those of /activation\n"
        "note: left out: 5 times at which a topic has no message\n"
        f"table  {out} (95 rows, 2 columns, 0.003 to 0.097 s)\n"
    )
    assert main(["export", str(path), "-o", str(out), "--force", "--columns", "RF"]) == 0
    assert len(comma_separated(out)["RF"]) == 100, "topics that no column needs do not count"
    assert main(["export", str(path), "-o", str(out), "--force", "--topics", "activation", "emg_envelope"]) == 2
    line = "--topics names /emg_envelope, whose times are not those of /activation; a file for each is needed"
    assert capsys.readouterr().err == f"limb: error: {path}: {line}\n"


@pytest.mark.parametrize(
    ("options", "line"),
    [
        (["-o", "{tmp}/a.xlsx"], "--out is {tmp}/a.xlsx; " + ENDS),
        (["-o", "{tmp}/a"], "--out is {tmp}/a; " + ENDS),
        (["-o", "{tmp}/no/a.sto"], "--out is {tmp}/no/a.sto; a folder that exists is needed, unlike {tmp}/no"),
        (["-o", "{tmp}/there.sto"], "--out is {tmp}/there.sto, which exists already; a new name is needed, or --force"),
        (["-o", "{tmp}/a.sto", "--topics", "joint_torque"],
         "{bag}: --topics names joint_torque; one of /emg_envelope, /reference_angle is needed"),
        (["-o", "{tmp}/a.sto", "--topics", "run_info"],
         "{bag}: --topics names run_info, which holds std_msgs/msg/String; one of /emg_envelope, /reference_angle is "
         "needed"),
        (["-o", "{tmp}/a.sto", "--columns", "hip*"],
         "{bag}: --columns is hip*; a name or a pattern of RF, biceps femoris, knee is needed"),
        (["-o", "{tmp}/a.sto", "--from", "2"], "{bag}: no message from 2 s; a time that it has is needed"),
        (["-o", "{tmp}/a.sto", "--from", "nan"], "--from is nan; a number in s is needed"),
        (["-o", "{tmp}/a.sto", "--from", "0.5", "--to", "0.2"],
         "--to is 0.2; a number >= 0.5, the first time, is needed"),
        (["-o", "{tmp}/a.sto", "--namespace", "left"], "{bag}: --namespace is left; one of / is needed"),
    ],
)  # fmt: skip
def test_mistakes_are_one_line(
    envelopes: Path, tmp_path: Path, options: list[str], line: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "there.sto").write_text("mine")
    names = {"tmp": tmp_path, "bag": envelopes}
    assert main(["export", str(envelopes), *[option.format(**names) for option in options]]) == 2
    assert capsys.readouterr().err == f"limb: error: {line.format(**names)}\n"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["env", "there.sto"]
    assert (tmp_path / "there.sto").read_text() == "mine"


def test_bags_that_cannot_be_read(envelopes: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "a.sto"
    assert main(["export", str(tmp_path / "x"), "-o", str(out)]) == 2
    assert capsys.readouterr().err == f"limb: error: {tmp_path / 'x'}: no such bag\n"
    (envelopes / "metadata.yaml").unlink()
    (file,) = envelopes.glob("*.mcap")
    file.write_bytes(file.read_bytes()[:-20])
    assert main(["export", str(envelopes), "-o", str(out)]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert f"`limb recover {envelopes}`" in error
    with BagWriter(tmp_path / "empty", {}):
        pass
    assert main(["export", str(tmp_path / "empty"), "-o", str(out)]) == 2
    assert "the bag has /run_info" in capsys.readouterr().err
    assert not out.exists()


def test_numbers_that_opensim_does_not_read_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, out = tmp_path / "bag", tmp_path / "a.sto"
    values = np.array([[0.1], [np.nan], [0.2]])
    with BagWriter(path, {}) as writer:
        write(writer, "emg_envelope", np.arange(3) * PERIOD, {"name": ["RF"]}, {"envelope": values})
    assert main(["export", str(path), "-o", str(out)]) == 2
    assert capsys.readouterr().err == f"limb: error: {out}: RF is nan at 0.001 s; a finite number is needed in a .sto\n"
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["bag"], "nothing is left half written"
    assert main(["export", str(path), "-o", str(tmp_path / "a.csv")]) == 0
    np.testing.assert_array_equal(comma_separated(tmp_path / "a.csv")["RF"], values[:, 0])


def test_names_that_change_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "bag"
    with BagWriter(path, {}) as writer:
        for part, name in enumerate(["RF", "BF"]):
            stamps = (np.arange(ROWS) + part * ROWS) * PERIOD
            write(writer, "emg_envelope", stamps, {"name": [name]}, {"envelope": np.zeros((ROWS, 1))})
    for options in ([], ["--from", "4.096"]):
        assert main(["export", str(path), "-o", str(tmp_path / "a.csv"), *options]) == 2
        line = "topic /emg_envelope has other names at 4.096 s than at its start; the same in every message are needed"
        assert capsys.readouterr().err == f"limb: error: {path}: {line}\n"


def test_memory_does_not_grow_with_the_bag(tmp_path: Path) -> None:
    def most(rows: int) -> int:
        with BagWriter(tmp_path / str(rows), {}) as writer:
            numbers = {"activation": np.random.default_rng(1).random((rows, 8))}
            write(writer, "activation", np.arange(rows) * PERIOD, {"name": list("abcdefgh")}, numbers)
        with BagReader(tmp_path / str(rows)) as reader:
            tracemalloc.start()
            assert sum(len(times) for times, _ in BagTable(reader, Choice()).pieces()) == rows
            _, peak = tracemalloc.get_traced_memory()
            tracemalloc.stop()
            return peak

    assert most(32 * ROWS) < 2 * most(4 * ROWS)


def test_help_needs_no_pyarrow() -> None:
    script = "import sys; from limb_nodes.cli import parser; parser(['export']); sys.exit('pyarrow' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", script], check=False).returncode == 0
