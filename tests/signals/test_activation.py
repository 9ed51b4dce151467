"""Activation sources: bags, CSV files, waveforms, constants; and all that can be wrong with them."""

import numpy as np
import pytest

from limb_nodes.bags.types import make_message
from limb_nodes.bags.write import BagWriter
from limb_nodes.errors import UserError
from limb_nodes.signals.activation import load_activation

MUSCLES = ["flexor", "extensor"]


@pytest.fixture
def write(tmp_path):
    def write(text, name="source.csv"):
        path = tmp_path / name
        path.write_text(text)
        return str(path)

    return write


@pytest.fixture
def bag(tmp_path):
    def bag(topic="emg_envelope", ticks=range(11), values=None, names=("extensor", "other", "flexor"), name="bag"):
        with BagWriter(tmp_path / name, {}) as writer:
            for tick in ticks:
                row = values[tick] if values is not None else [tick / 10, 0.5, 1 - tick / 10]
                stamp = tick * 10_000_000
                message = make_message("limb_msgs/msg/MuscleActivation", stamp, tick=tick, name=names, activation=row)
                writer.write(topic, stamp, message)
        return str(tmp_path / name)

    return bag


def test_bag_is_taken_as_recorded(bag):
    found = load_activation(bag(), MUSCLES, 100.0)
    np.testing.assert_array_equal(found.values[:, 0], [1 - k / 10 for k in range(11)])
    np.testing.assert_array_equal(found.values[:, 1], [k / 10 for k in range(11)])
    assert found.names == ("flexor", "extensor")
    assert (found.rate, found.duration) == (100.0, 0.1)
    assert found.notes == ("not used, for the limb has no such muscle: other",)


def test_another_rate_is_interpolated(bag):
    found = load_activation(bag(), MUSCLES, 250.0, 0.1)
    np.testing.assert_allclose(found.values[:, 1], np.arange(26) / 25, atol=1e-12)
    slow = load_activation(bag(name="b"), MUSCLES, 20.0, 0.05)
    np.testing.assert_allclose(slow.values[:, 1], [0, 0.5], atol=1e-12)


def test_part_of_a_recording_can_be_taken(bag):
    assert len(load_activation(bag(), MUSCLES, 100.0, 0.03).values) == 4


def test_recorded_run_gives_what_drove_it(bag, tmp_path):
    path = tmp_path / "run"
    with BagWriter(path, {}) as writer:
        for tick in range(3):
            for topic, value in (("emg_envelope", 0.25), ("activation", 0.75)):
                message = make_message(
                    "limb_msgs/msg/MuscleActivation", tick, tick=tick, name=["m"], activation=[value]
                )
                writer.write(topic, tick * 1_000_000, message)
    assert load_activation(str(path), ["m"], 1000.0).values.tolist() == [[0.75]] * 3


def test_missing_ticks_are_bridged_and_noted(bag):
    found = load_activation(bag(ticks=[0, 1, 2, 5, 6]), MUSCLES, 100.0)
    np.testing.assert_allclose(found.values[:, 1], np.arange(7) / 10, atol=1e-12)
    assert "ticks missing on emg_envelope, bridged by straight lines: 2" in found.notes


def test_csv_may_be_uneven_and_start_late(write):
    source = write("time (ms)\tflexor\textensor\n100\t0\t1\n120\t0.2\t1\n150\t0.5\t0.25\n")
    found = load_activation(source, MUSCLES, 100.0)
    np.testing.assert_allclose(found.values[:, 0], np.arange(6) / 10, atol=1e-12)
    np.testing.assert_allclose(found.values[:, 1], [1, 1, 1, 0.75, 0.5, 0.25], atol=1e-12)
    assert found.notes == ("its times start at 0.1 s; counted from there",)


def test_constants_in_a_line():
    found = load_activation("flexor=0.9, extensor=0", MUSCLES, 50.0, 0.1)
    np.testing.assert_array_equal(found.values, [[0.9, 0.0]] * 6)
    many = [f"muscle_{k}" for k in range(60)]
    assert load_activation(",".join(f"{m}=0.5" for m in many), many, 1.0, 1.0).values.shape == (2, 60)


def bad(source, words, muscles=MUSCLES, rate=100.0, duration=None):
    with pytest.raises(UserError) as error:
        load_activation(source, muscles, rate, duration)
    line = str(error.value)
    assert words in line
    assert "\n" not in line


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("time,flexor\n0,0\n1,0\n", "no column 'extensor', a muscle of the limb; there are flexor"),
        ("when,flexor,extensor\n0,0,0\n", "no column 'time' (s); there are when, flexor, extensor"),
        ("time,flexor,extensor\n0,0,0\n1,1.5,0\n", "line 3, flexor: 1.5; must be a number in [0, 1]"),
        ("time,flexor,extensor\n0,0,0\n1,0,-0.1\n", "line 3, extensor: -0.1; must be a number in [0, 1]"),
        ("time,flexor,extensor\n0,0,0\n1,0,\n", "line 3, extensor: no value; must be a number in [0, 1]"),
        ("time,flexor,extensor\n0,0,0\n1,0,nan\n", "line 3, extensor: no value"),
        ("time,flexor,extensor\n0,0,0\n,0,0\n", "line 3, time: no value; must be later"),
        ("time,flexor,extensor\n0,0,0\n1,0,0\n1,0,0\n", "line 4, time: 1 s; must be later than the one before"),
        ("time,flexor,extensor\n,0,0\n1,0,0\n", "line 2, time: no value; must be later"),
        ("time,flexor,extensor\n0,0,0\n", "lasts 0 s, less than one tick of 0.01 s"),
    ],
)
def test_bad_csv(write, text, words):
    bad(write(text), words)


def test_bad_bags(bag, tmp_path):
    bad(bag("external", name="a"), "no message on activation or emg_envelope; the bag has /external")
    bad(bag(name="b"), "no column 'knee'", muscles=["knee"])
    values = [[0, 0, 0], [0, 0, float("nan")], [0, 0, 0]]
    bad(bag(values=values, ticks=range(3), name="c"), "tick 1, flexor: no value; must be a number in [0, 1]")
    values[1][2] = 1.25
    bad(bag(values=values, ticks=range(3), name="d"), "topic emg_envelope, tick 1, flexor: 1.25; must be a number")
    (tmp_path / "empty").mkdir()
    bad(str(tmp_path / "empty"), "not a bag")


def test_unlisted_columns_may_hold_anything(write):
    source = write("time,flexor,extensor,note\n0,0,0,77\n1,0,0,\n")
    assert load_activation(source, MUSCLES, 1.0).values.shape == (2, 2)


@pytest.mark.parametrize(
    ("rate", "duration", "words"),
    [
        (0.0, None, "rate 0: must be greater than 0"),
        (float("nan"), None, "rate nan: must be greater than 0"),
        (-1.0, None, "rate -1: must be greater than 0"),
        (100.0, 0.0, "duration 0: must be greater than 0"),
        (100.0, float("inf"), "duration inf: must be greater than 0"),
        (100.0, 0.025, "duration 0.025: must be a whole number of ticks of 0.01 s"),
        (100.0, 20.0, "lasts 0.1 s, shorter than the duration of 20 s"),
        (1e15, None, "ticks; at most"),
        (1e15, 1.0, "ticks; at most"),
    ],
)
def test_impossible_rate_or_duration(bag, rate, duration, words):
    bad(bag(), words, rate=rate, duration=duration)


@pytest.mark.parametrize(
    ("source", "words"),
    [
        ("nowhere.csv", "activation 'nowhere.csv': no such file or folder"),
        ("flexor=0.9", "no muscle 'extensor', a muscle of the limb; there are flexor"),
        ("flexor=0.9,extensor", "'extensor' is not MUSCLE=VALUE"),
        ("flexor=0.9,extensor=", "'extensor=' is not MUSCLE=VALUE"),
        ("flexor=0.9,flexor=0.1", "'flexor' stands twice"),
        ("flexor=1.1,extensor=0", "flexor is 1.1; a number in [0, 1] is needed"),
        ("flexor=nan,extensor=0", "flexor is nan; a number in [0, 1] is needed"),
        ("flexor=x,extensor=0", "flexor is x; a number in [0, 1] is needed"),
    ],
)
def test_bad_lines(source, words):
    bad(source, words, duration=1.0)


def test_constants_need_a_duration():
    bad("flexor=0.9,extensor=0", "a waveform has no end; give a duration in s")
