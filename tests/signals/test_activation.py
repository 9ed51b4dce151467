"""Activation sources: bags, CSV files, waveforms, constants; and all that can be wrong with them."""

import numpy as np
import pytest

from limb_nodes.bags.types import make_message
from limb_nodes.bags.write import BagWriter
from limb_nodes.errors import UserError
from limb_nodes.signals.activation import load_activation
from tests.recordings import recorded

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
    result = load_activation(bag(), MUSCLES, 100.0)
    np.testing.assert_array_equal(result.values[:, 0], [1 - k / 10 for k in range(11)])
    np.testing.assert_array_equal(result.values[:, 1], [k / 10 for k in range(11)])
    assert result.names == ("flexor", "extensor")
    assert (result.rate, result.duration) == (100.0, 0.1)
    assert result.notes == ("not used, for the limb has no such muscle: other",)


def test_another_topic_of_a_bag_follows_a_colon(bag):
    other = bag("left/envelopes")
    assert load_activation(other, MUSCLES, 100.0).notes[0] == "read from the topic /left/envelopes, field activation"
    for source in (f"{other}:envelopes", f"{other}:/left/envelopes", f"{other}:/left/envelopes:activation"):
        np.testing.assert_array_equal(
            load_activation(source, MUSCLES, 100.0).values, load_activation(other, MUSCLES, 100.0).values
        )
    bad(
        f"{other}:/right", "topic is /right, on which there is no message; one of /left/envelopes (field activation) is"
    )
    bad(f"{other}:envelopes:tick", "message 1 holds 1 values; 3 are needed")
    bad(
        f"{other}:envelopes:name",
        "field is name, which holds string[]; a field of numbers of /left/envelopes is needed",
    )
    bad(f"{other}:", "which is no file; a bag, a CSV file")
    bad("nothing:topic", "which is no file; a bag, a CSV file")


def test_stamps_are_the_times_of_envelopes(tmp_path):
    """As `ros2 bag record` keeps them: received in real time, stamped in simulation time."""
    with BagWriter(tmp_path / "bag", {}) as writer:
        for tick in range(11):
            message = make_message(
                "limb_msgs/msg/MuscleActivation", tick * 10_000_000, tick=tick, name=["m"], activation=[tick / 10]
            )
            writer.write("emg_envelope", 1_700_000_000_000_000_000 + tick // 4 * 37_000_000, message)
    result = load_activation(str(tmp_path / "bag"), ["m"], 100.0)
    np.testing.assert_array_equal(result.values[:, 0], np.arange(11) / 10)
    assert result.notes == ("times are the stamps in the messages; times of reception differ by up to 0.033 s",)


def test_envelopes_that_were_received_in_packets(tmp_path):
    with BagWriter(tmp_path / "bag", {}) as writer:
        for k in range(200):
            message = make_message("limb_msgs/msg/MuscleActivation", name=["m"], activation=[k / 200])
            writer.write("emg_envelope", 5_000_000_000 + k // 4 * 40_000_000, message)
    result = load_activation(str(tmp_path / "bag"), ["m"], 100.0, 1.9)
    np.testing.assert_allclose(result.values[:, 0], np.arange(191) / 200, atol=1e-9)
    assert any(note.startswith("times are those of reception, for the stamps do not rise") for note in result.notes)


def test_another_rate_is_interpolated(bag):
    result = load_activation(bag(), MUSCLES, 250.0, 0.1)
    np.testing.assert_allclose(result.values[:, 1], np.arange(26) / 25, atol=1e-12)
    slow = load_activation(bag(name="b"), MUSCLES, 20.0, 0.05)
    np.testing.assert_allclose(slow.values[:, 1], [0, 0.5], atol=1e-12)


def test_part_of_a_recording_can_be_taken(bag):
    assert len(load_activation(bag(), MUSCLES, 100.0, 0.03).values) == 4


def test_recorded_run_gives_what_drove_it(bag, tmp_path):
    path = tmp_path / "run"
    with BagWriter(path, {}) as writer:
        for tick in range(3):
            for topic, value in (("emg_envelope", 0.25), ("activation", 0.75)):
                stamp = tick * 1_000_000
                message = make_message(
                    "limb_msgs/msg/MuscleActivation", stamp, tick=tick, name=["m"], activation=[value]
                )
                writer.write(topic, stamp, message)
    assert load_activation(str(path), ["m"], 1000.0).values.tolist() == [[0.75]] * 3


def test_missing_ticks_are_bridged_and_noted(bag):
    result = load_activation(bag(ticks=[0, 1, 2, 5, 6]), MUSCLES, 100.0)
    np.testing.assert_allclose(result.values[:, 1], np.arange(7) / 10, atol=1e-12)
    assert "ticks missing on /emg_envelope, bridged by straight lines: 2" in result.notes


def test_csv_may_be_uneven_and_start_late(write):
    source = write("time (ms)\tflexor\textensor\n100\t0\t1\n120\t0.2\t1\n150\t0.5\t0.25\n")
    result = load_activation(source, MUSCLES, 100.0)
    np.testing.assert_allclose(result.values[:, 0], np.arange(6) / 10, atol=1e-12)
    np.testing.assert_allclose(result.values[:, 1], [1, 1, 1, 0.75, 0.5, 0.25], atol=1e-12)
    assert result.notes == ("its times start at 0.1 s; counted from there",)


def test_constants_in_a_line():
    result = load_activation("flexor=0.9, extensor=0", MUSCLES, 50.0, 0.1)
    np.testing.assert_array_equal(result.values, [[0.9, 0.0]] * 6)
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
        ("when,flexor,extensor\n0,0,0\n", "no column 'time' in s; there are when, flexor, extensor"),
        ("time,flexor,extensor\n0,0,0\n1,1.5,0\n", "line 3: flexor is 1.5; a number in [0, 1] is needed"),
        ("time,flexor,extensor\n0,0,0\n1,0,-0.1\n", "line 3: extensor is -0.1; a number in [0, 1] is needed"),
        ("time,flexor,extensor\n0,0,0\n1,0,\n", "line 3: extensor is missing; a number in [0, 1] is needed"),
        ("time,flexor,extensor\n0,0,0\n1,0,nan\n", "line 3: extensor is missing"),
        (
            "time,flexor,extensor\n0,0,0\n,0,0\n",
            "line 3: time is missing; a number > 0, the time before,",
        ),
        (
            "time,flexor,extensor\n0,0,0\n1,0,0\n1,0,0\n",
            "line 4: time is 1; a number > 1, the time before,",
        ),
        ("time,flexor,extensor\n,0,0\n1,0,0\n", "line 2: time is missing; a number in s is needed"),
        ("time,flexor,extensor\n0,0,0\n", "lasts 0 s; one tick of 0.01 s (rate 100 Hz) or more is needed"),
    ],
)
def test_bad_csv(write, text, words):
    bad(write(text), words)


@pytest.mark.parametrize("by", [1e-16, 1e-12, 1e-9, 9e-7])
def test_values_outside_by_rounding_are_clipped_and_counted(write, bag, by):
    text = write(f"time,flexor,extensor\n0,{-by:.17g},0\n1,0.5,{1 + by:.17g}\n2,{1 + by:.17g},1\n")
    result = load_activation(text, MUSCLES, 1.0)
    np.testing.assert_array_equal(result.values, [[0, 0], [0.5, 1], [1, 1]])
    count = 1 if 1 + by == 1 else 3
    assert result.notes == (f"values outside [0, 1] by rounding, by 1e-06 at most, clipped: {count}",)
    values = [[0, 0, -by], [1 + by, 5, 0.5], [0, 0, 0]]
    result = load_activation(bag(values=values, ticks=range(3)), MUSCLES, 100.0)
    np.testing.assert_array_equal(result.values, [[0, 0], [0.5, 1], [0, 0]])


@pytest.mark.parametrize("value", ["1.000002", "-0.000002", "1.5", "inf"])
def test_values_outside_by_more_are_refused_without_talk_of_percent(write, value):
    source = write(f"time,flexor,extensor\n0,0,0\n1,{value},0\n")
    with pytest.raises(UserError) as error:
        load_activation(source, MUSCLES, 1.0)
    assert "percent" not in str(error.value)


@pytest.mark.parametrize(
    ("rows", "line"), [("0,0.4,0\n1,60,0", 3), ("0,0.4,0\n1,1.2,0\n2,60,0", 3), ("0,60,0\n1,0,0", 2)]
)
def test_percent_is_refused_with_the_advice(write, rows, line):
    words = "a number in [0, 1] is needed; it reaches 60: divide it by 100 if it is in percent"
    bad(write(f"time,flexor,extensor\n{rows}\n"), f"line {line}: flexor is ")
    bad(write(f"time,flexor,extensor\n{rows}\n"), words)


def test_recorded_envelopes_at_the_edge():
    folder = recorded("emg_formats") / "envelope-edge"
    negative = load_activation(str(folder / "negative_1e-12.csv"), ["RF", "BF"], 100.0)
    assert (negative.values.min(), negative.values.max()) == (0.0, 0.2)
    assert negative.notes[0] == "values outside [0, 1] by rounding, by 1e-06 at most, clipped: 2"
    above = load_activation(str(folder / "overshoot_1e-9.csv"), ["RF"], 100.0)
    assert above.values.max() == 1.0
    assert above.notes[0] == "values outside [0, 1] by rounding, by 1e-06 at most, clipped: 1"
    bad(str(folder / "percent.csv"), "divide it by 100 if it is in percent", muscles=["RF"])


def test_bad_bags(bag, tmp_path):
    with BagWriter(tmp_path / "a", {}) as writer:
        writer.write("external", 0, make_message("std_msgs/msg/String", data="flexor"))
    bad(str(tmp_path / "a"), "no message on activation or emg_envelope; the bag has /external, /run_info")
    bad(bag(name="b"), "no column 'knee'", muscles=["knee"])
    values = [[0, 0, 0], [0, 0, float("nan")], [0, 0, 0]]
    bad(bag(values=values, ticks=range(3), name="c"), "tick 1: flexor is missing; a number in [0, 1] is needed")
    values[1][2] = 1.25
    bad(bag(values=values, ticks=range(3), name="d"), "topic /emg_envelope, tick 1: flexor is 1.25; a number in [0, 1]")
    (tmp_path / "empty").mkdir()
    bad(str(tmp_path / "empty"), "is no bag")


def test_unlisted_columns_may_hold_anything(write):
    source = write("time,flexor,extensor,note\n0,0,0,77\n1,0,0,\n")
    assert load_activation(source, MUSCLES, 1.0).values.shape == (2, 2)


@pytest.mark.parametrize(
    ("rate", "duration", "words"),
    [
        (0.0, None, "rate is 0; a number > 0 in Hz is needed"),
        (float("nan"), None, "rate is nan; a number > 0 in Hz is needed"),
        (-1.0, None, "rate is -1; a number > 0 in Hz is needed"),
        (100.0, 0.0, "duration is 0; a number > 0 in s is needed"),
        (100.0, float("inf"), "duration is inf; a number > 0 in s is needed"),
        (100.0, 0.025, "duration is 0.025; a whole number of ticks of 0.01 s is needed"),
        (100.0, 20.0, "duration is 20; a number <= 0.1 in s is needed"),
        (1e15, None, "at most 1e+08 ticks"),
        (1e15, 1.0, "at most 1e+08 ticks"),
    ],
)
def test_impossible_rate_or_duration(bag, rate, duration, words):
    bad(bag(), words, rate=rate, duration=duration)


@pytest.mark.parametrize(
    ("source", "words"),
    [
        ("nowhere.csv", "source is 'nowhere.csv', which is no file; a bag, a CSV file"),
        ("flexor=0.9", "no muscle 'extensor', a muscle of the limb; there are flexor"),
        ("flexor=0.9,extensor", "flexor=0.9,extensor: 'extensor' is no constant; MUSCLE=VALUE"),
        ("flexor=0.9,extensor=", "'extensor=' is no constant; MUSCLE=VALUE"),
        ("flexor=0.9,flexor=0.1", "flexor is there twice; one value for each muscle is needed"),
        ("flexor=1.1,extensor=0", "flexor is 1.1; a number in [0, 1] is needed"),
        ("flexor=nan,extensor=0", "flexor is nan; a number in [0, 1] is needed"),
        ("flexor=x,extensor=0", "flexor is x; a number in [0, 1] is needed"),
    ],
)
def test_bad_lines(source, words):
    bad(source, words, duration=1.0)


def test_constants_need_a_duration():
    bad("flexor=0.9,extensor=0", "flexor=0.9,extensor=0: duration is missing; a number > 0 in s is needed")
