"""Raw EMG in bags of any type: which field, whose names, which value belongs to which sample, and at what time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from limb_nodes.bags.types import limb_typestore, make_message
from limb_nodes.errors import UserError
from limb_nodes.signals.bag_field import BagOptions
from limb_nodes.signals.emg import envelopes
from limb_nodes.signals.recording import Recording, read_recording
from tests.bags import foreign
from tests.bags.foreign import SECOND, array, header, store_of

RATE = 1000.0
PERIOD = 1_000_000
START = 1_700_000_000 * SECOND + 123_456_789
NAMES = ("RF", "VM", "BF")
VALUES = np.random.default_rng(2).normal(size=(240, 3)).round(3)


def times(count: int, samples: int = 1) -> list[int]:
    """When messages of some samples each are received, ns."""
    return [START + k * samples * PERIOD for k in range(count)]


def read(path: Path, rate: float | None = None, **options: Any) -> Recording:
    return read_recording(path, rate=rate, bag=BagOptions(**options))


def check(recording: Recording, values: Any = VALUES, names: Sequence[str] = NAMES, atol: float = 0.0) -> None:
    assert recording.names == tuple(names)
    assert recording.rate == RATE
    np.testing.assert_allclose(recording.values, values, rtol=0, atol=atol)


def refusal(path: Path, rate: float | None = None, **options: Any) -> str:
    with pytest.raises(UserError) as caught:
        read(path, rate, **options)
    line = str(caught.value)
    assert "\n" not in line
    assert len(line) < 600
    return line


def named(row: Any, names: Sequence[str] = NAMES, stamp: int = 0) -> Any:
    return make_message("limb_msgs/msg/MuscleActivation", stamp, name=names, activation=row)


# Which field


def test_limb_msgs(tmp_path: Path) -> None:
    rows = [(time, named(row)) for time, row in zip(times(240), VALUES, strict=True)]
    recording = read(foreign.write(tmp_path / "a", "/emg_raw", rows))
    check(recording)
    assert recording.notes == (
        "times are those of reception, for the stamps do not rise: message 2 of /emg_raw is stamped 0 s, the one "
        "before 0 s after the first",
    )


def test_the_only_topic_with_channels_is_read_and_named(tmp_path: Path) -> None:
    rows = [(time, named(row, stamp=time)) for time, row in zip(times(240), VALUES, strict=True)]
    recording = read(foreign.write(tmp_path / "a", "/left/amplifier", rows))
    check(recording)
    assert recording.notes == ("read from the topic /left/amplifier, field activation",)


@pytest.mark.parametrize(
    ("definition", "fill", "field"),
    [
        ("std_msgs/Header header\nstring[] labels\nfloat32[] volt\n", {"volt": 0, "labels": 1}, None),
        ("float64[3] volt\nstring[3] muscles\nstring note\n", {"volt": 0, "muscles": 1}, None),
        ("float64[] volt\nfloat64[] offset\nstring[] names\n", {"volt": 0, "names": 1, "offset": 2}, "volt"),
        ("string[] units\nstring[] names\nfloat32[] volt\n", {"volt": 0, "names": 1}, None),
        ("int16[] counts\nstring[] names\n", {"counts": 3, "names": 1}, "counts"),
        ("string[<=8] names\nfloat64[<=8] volt\n", {"volt": 0, "names": 1}, None),
    ],
)
def test_any_message_with_floats_and_names(
    definition: str, fill: dict[str, int], field: str | None, tmp_path: Path
) -> None:
    store = store_of(Sample=definition)
    sample = store.types["lab_msgs/msg/Sample"]
    whole = np.round(VALUES * 1000)
    rows = []
    for k, time in enumerate(times(240)):
        ready = {0: VALUES[k], 1: list(NAMES), 2: np.zeros(1), 3: whole[k].astype(np.int16)}
        values: dict[str, Any] = {name: ready[what] for name, what in fill.items()}
        if "volt" in values:
            values["volt"] = VALUES[k].astype("f4" if "float32" in definition else "f8")
        if "Header" in definition:
            values["header"] = header(store, time)
        if "note" in definition:
            values["note"] = "impedance " * (k % 3)  # a text of no interest, of changing length
        if "units" in definition:
            values["units"] = ["mV"] * 3
        rows.append((time, sample(**values)))
    path = foreign.write(tmp_path / "a", "/x", rows, store)
    check(read(path, topic="/x", field=field), whole if field == "counts" else VALUES, atol=1e-6)


def test_nested_fields_and_elements(tmp_path: Path) -> None:
    inner = "string name\nfloat64[] samples\nfloat32 gain\n"
    store = store_of(Lead=inner, Unit="lab_msgs/Lead[] leads\n", Device="std_msgs/Header header\nlab_msgs/Unit unit\n")
    lead, unit, device = (store.types[f"lab_msgs/msg/{name}"] for name in ("Lead", "Unit", "Device"))
    rows = []
    for k in range(24):
        leads = [
            lead(name=name, samples=VALUES[10 * k : 10 * k + 10, i].copy(), gain=2.0) for i, name in enumerate(NAMES)
        ]
        rows.append((START + (10 * k + 9) * PERIOD, device(header(store, k * 10 * PERIOD), unit(leads))))
    path = foreign.write(tmp_path / "a", "/device/out", rows, store)
    recording = read(path, field="unit.leads.samples")
    check(recording)
    assert "messages on /device/out hold 10 samples; each message's time is that of its last sample" in recording.notes
    assert "fields unit.leads.samples, unit.leads.gain" in refusal(path)
    assert "is unit.leads.name, which holds string[]; a field of numbers of /device/out is needed: unit.leads" in (
        refusal(path, topic="out", field="unit.leads.name")
    )
    gains = read(path, topic="out", field="unit.leads.gain", rate=100.0)
    assert gains.names == NAMES
    assert (gains.values == 2.0).all()


def test_single_number(tmp_path: Path) -> None:
    one = limb_typestore().types["std_msgs/msg/Float32"]
    path = foreign.write(
        tmp_path / "a",
        "/emg",
        [(t, one(data=float(v))) for t, v in zip(times(240), VALUES[:, 0].tolist(), strict=True)],
    )
    check(read(path, topic="emg", field="data", names=["RF"]), VALUES[:, :1], ["RF"], atol=1e-6)
    assert "field is missing: /emg (std_msgs/msg/Float32) has no array of floats; one of data is" in refusal(
        path, topic="emg"
    )
    assert "field is missing: /emg (std_msgs/msg/Float32) has no array of floats; one of data is needed" in refusal(
        path
    )


def test_what_could_be_meant_is_listed_in_one_line(tmp_path: Path) -> None:
    state = make_message("sensor_msgs/msg/JointState", name=["a"], position=[1.0], effort=[2.0])
    path = foreign.write(tmp_path / "a", "/joints", [(t, state) for t in times(3)])
    assert (
        "topic is missing, for there is no message on emg_raw or emg; one of /joints (fields position, effort)"
        in refusal(path)
    )
    assert refusal(path, topic="joints").endswith(
        "field is missing; one of /joints (fields position, effort) is needed"
    )
    assert "topic is /emg, on which there is no message; one of /joints (fields" in refusal(path, topic="/emg")
    assert "field is torque; a field of numbers of /joints is needed: position, velocity, effort" in refusal(
        path, topic="joints", field="torque"
    )
    check(read(path, field="effort"), np.full((3, 1), 2.0), ["a"])


# MultiArrays


def multi(path: Path, messages: Sequence[Any], samples: int = 1) -> Path:
    return foreign.write(path, "/emg", list(zip(times(len(messages), samples), messages, strict=True)))


@pytest.mark.parametrize("bits", [32, 64])
def test_one_sample_a_message(bits: int, tmp_path: Path) -> None:
    path = multi(tmp_path / "a", [array(row, bits=bits) for row in VALUES])
    check(read(path, names=NAMES), atol=1e-6 if bits == 32 else 0.0)
    assert "names is missing, for topic /emg, message 1 names no channels of its 3 values; a name for" in refusal(path)
    assert "names is A, B; 3 names are needed, as topic /emg, message 1 has" in refusal(path, names=["A", "B"])


BLOCKS = VALUES.reshape(24, 10, 3)


@pytest.mark.parametrize(
    "dims",
    [
        [("channels", 3, 30), ("samples", 10, 10)],  # as the message's definition has it
        [("Channel", 3, 10), ("", 10, 1)],  # the step of each, as numpy has it
        [("", 3, 0), ("time", 10, 0)],
        [("muscle", 3, 30), ("", 10, 10)],
        [("", 3, 30), ("", 10, 10)],  # by the number of names
        [("samples", 10, 1), ("channels", 3, 10)],  # steps that are not in the order of the dimensions
        [("block", 1, 30), ("channels", 3, 30), ("samples", 10, 10)],
    ],
)
def test_blocks_of_channels(dims: list[tuple[str, int, int]], tmp_path: Path) -> None:
    path = multi(tmp_path / "a", [array(block.T, dims, bits=64) for block in BLOCKS], 10)
    check(read(path, names=NAMES))


@pytest.mark.parametrize(
    "dims",
    [
        [("samples", 10, 30), ("channels", 3, 3)],
        [("frame", 10, 3), ("x", 3, 1)],
        [("", 10, 0), ("", 3, 0)],
        [("channels", 3, 1), ("samples", 10, 3)],
    ],
)
def test_blocks_of_samples(dims: list[tuple[str, int, int]], tmp_path: Path) -> None:
    path = multi(tmp_path / "a", [array(block, dims, bits=64) for block in BLOCKS], 10)
    check(read(path, names=NAMES))


def test_rows_with_room_between_and_an_offset(tmp_path: Path) -> None:
    messages = []
    for block in BLOCKS:
        padded = np.full((3, 12), np.nan)
        padded[:, :10] = block.T
        data = np.concatenate([[9.0, 9.0], padded.reshape(-1)])
        messages.append(array(data, [("channels", 3, 36), ("samples", 10, 12)], offset=2, bits=64))
    check(read(multi(tmp_path / "a", messages, 10), names=NAMES))


def test_blocks_whose_order_is_not_told(tmp_path: Path) -> None:
    plain = multi(tmp_path / "a", [array(block, bits=64) for block in BLOCKS], 10)
    assert "rows is missing: topic /emg, message 1 holds 30 values of 3 channels and does not tell their order" in (
        refusal(plain, names=NAMES)
    )
    check(read(plain, names=NAMES, rows="samples"))
    turned = multi(tmp_path / "b", [array(block.T, bits=64) for block in BLOCKS], 10)
    check(read(turned, names=NAMES, rows="channels"))
    square = multi(tmp_path / "c", [array(VALUES[:3], [("", 3, 9), ("", 3, 3)])] * 3, 3)
    assert "rows is missing" in refusal(square, names=NAMES)
    strange = multi(tmp_path / "d", [array(BLOCKS[0], [("samples", 10, 7), ("channels", 3, 2)])] * 3, 10)
    assert "rows is missing" in refusal(strange, names=NAMES)


def test_one_channel_has_one_order(tmp_path: Path) -> None:
    path = multi(tmp_path / "a", [array(block[:, 0], bits=64) for block in BLOCKS], 10)
    check(read(path, names=["RF"]), VALUES[:, :1], ["RF"])


@pytest.mark.parametrize("dims", [[("RF,VM,BF", 3, 3)], [("RF", 1, 1), ("VM", 1, 1), ("BF", 1, 1)]])
def test_labels_may_be_the_names(dims: list[tuple[str, int, int]], tmp_path: Path) -> None:
    check(read(multi(tmp_path / "a", [array(row, dims, bits=64) for row in VALUES])))


def test_messages_with_different_numbers_of_samples(tmp_path: Path) -> None:
    """What an amplifier had ready when it was asked; each message is stamped at its last sample."""
    ends = np.cumsum(np.tile([7, 10, 13], 8))
    blocks = np.split(VALUES, ends[:-1])
    rows = [
        (START + int(end) * PERIOD, array(block, [("samples", len(block), 0), ("channels", 3, 0)], bits=64))
        for end, block in zip(ends, blocks, strict=True)
    ]
    recording = read(foreign.write(tmp_path / "a", "/emg", rows), names=NAMES)
    check(recording)
    assert "messages on /emg hold 7 to 13 samples; each message's time is that of its last sample" in recording.notes


def test_a_message_that_was_lost_is_a_gap(tmp_path: Path) -> None:
    rows = [
        (time, array(block, [("samples", 10, 30), ("channels", 3, 3)], bits=64))
        for time, block in zip(times(24, 10), BLOCKS, strict=True)
    ]
    recording = read(foreign.write(tmp_path / "a", "/emg", rows[:5] + rows[7:]), names=NAMES)
    expected = VALUES.copy()
    expected[50:70] = np.nan
    check(recording, expected)
    assert "rows missing between the first and the last time: 20" in recording.notes


def test_all_in_one_message_needs_a_rate(tmp_path: Path) -> None:
    message = array(VALUES, [("samples", 240, 720), ("channels", 3, 3)], bits=64)
    path = foreign.write(tmp_path / "a", "/emg", [(START, message)])
    assert "rate is missing, for all samples on /emg are in one message; a number > 0 in Hz is needed" in refusal(
        path, names=NAMES
    )
    check(read(path, 1000.0, names=NAMES))


def test_messages_without_values_are_left_out(tmp_path: Path) -> None:
    messages = [array(row, bits=64) for row in VALUES]
    recording = read(multi(tmp_path / "a", [*messages, array([]), array([])]), names=NAMES)
    check(recording)
    assert "messages without values on /emg, left out: 2" in recording.notes


# Names and values that are wrong


def bag(path: Path, messages: Sequence[Any]) -> Path:
    return foreign.write(path, "/emg_raw", list(zip(times(len(messages)), messages, strict=True)))


def test_names_in_another_order_are_put_in_order(tmp_path: Path) -> None:
    turned = [2, 0, 1]
    messages = [named(row[turned], [NAMES[i] for i in turned]) if k % 3 else named(row) for k, row in enumerate(VALUES)]
    check(read(bag(tmp_path / "a", messages)))


@pytest.mark.parametrize(
    ("messages", "words"),
    [
        (
            [named([1.0, 2], ["a", "b"]), named([1.0, 2], ["a", "c"])],
            "message 2 names a, c; the names of the first mess",
        ),
        (
            [named([1.0, 2], ["a", "b"]), named([1.0], ["a"])],
            "message 2 names a; the names of the first message, a, b,",
        ),
        ([named([1.0, 2], ["a", "b"]), named([1.0, 2, 3], ["a", "b"])], "message 2 holds 3 values; 2 are needed, one"),
        ([named([1.0], ["a", "b"])] * 2, "message 1 holds 1 values; 2 are needed, one for each of a, b"),
        (
            [named([1.0, 2, 3, 4], ["a", "b"])] * 2,
            "rows is missing: topic /emg_raw, message 1 holds 4 values of 2 chan",
        ),
        ([named([1.0, 2], ["a", "a"])] * 2, "message 1 names two channels 'a'; different names are needed"),
        ([named([1.0, 2], ["a", ""])] * 2, "message 1 has the name ''; different names are needed"),
        ([named([1.0, 2], [])] * 2, "names is missing, for topic /emg_raw, message 1 names no channels of its 2"),
        ([named([], [])] * 2, "topic /emg_raw holds no value in activation; at least one sample is needed"),
        ([named([np.nan], ["a"])] * 2, "topic /emg_raw: holds no value; at least one sample is needed"),
        (
            [named([1.0], ["a"]), named([-np.inf], ["a"])],
            "topic /emg_raw, message 2: a is -inf; a finite number, or NaN",
        ),
        ([named([1.0], ["a"])], "holds one row; at least 2 are needed for a rate"),
        (
            [make_message("std_msgs/msg/String", data="1 2")] * 2,
            "field is missing: /emg_raw (std_msgs/msg/String) has no",
        ),
        ([make_message("sensor_msgs/msg/Image")] * 2, "one of height, width, is_bigendian, step, data is needed"),
        (
            [named(np.zeros(10_001), [f"c{i}" for i in range(10_001)])] * 2,
            "message 1 has 10001 names; at most 10000 are read",
        ),
    ],
)
def test_bad_messages_are_told_in_one_line(messages: list[Any], words: str, tmp_path: Path) -> None:
    path = bag(tmp_path / "a", messages)
    line = refusal(path)
    assert line.startswith(str(path))
    assert words in line


@pytest.mark.parametrize("count", [2**32 - 1, 2**31, 10**6])
@pytest.mark.parametrize("which", ["name", "value", "text"])
def test_a_count_beyond_the_message_is_refused_at_once(count: int, which: str, tmp_path: Path) -> None:
    """Nothing is allocated for a size that the data do not bear out."""
    store = limb_typestore()
    good = bytes(store.serialize_cdr(named([1.0, 2.0], ["ab", "cd"]), "limb_msgs/msg/MuscleActivation"))
    position = {
        "name": good.index(b"\3\0\0\0ab") - 4,
        "text": good.index(b"\3\0\0\0ab"),
        "value": good.rindex(b"\2\0\0\0"),
    }
    raw = bytearray(good)
    assert raw[position[which]] in (2, 3)
    raw[position[which] : position[which] + 4] = count.to_bytes(4, "little")

    from rosbags.rosbag2 import Writer

    with Writer(tmp_path / "a", version=9) as writer:
        connection = writer.add_connection("/emg_raw", "limb_msgs/msg/MuscleActivation", typestore=store)
        for time in times(3):
            writer.write(connection, time, bytes(raw))
    assert "a message is 100 bytes long; " in refusal(tmp_path / "a", topic="emg_raw").replace(
        f"{len(good)} bytes", "100 bytes"
    )


def test_a_type_that_nobody_knows(tmp_path: Path) -> None:
    store = store_of(Sample="float64[] volt\nstring[] name\n")
    sample = store.types["lab_msgs/msg/Sample"](volt=np.array([1.0]), name=["a"])
    path = foreign.write(tmp_path / "a", "/emg_raw", [(t, sample) for t in times(3)], store, foreign.SQLITE)
    import sqlite3

    for text, words in (
        ("float64[] volt\nstring[ name\n", "its definition in the bag cannot be read"),
        (None, "bag conv"),
    ):
        with sqlite3.connect(path / "a.db3") as database:
            if text is None:
                database.execute("DELETE FROM message_definitions")
            else:
                database.execute("UPDATE message_definitions SET encoded_message_definition = ?", (text,))
        database.close()
        line = refusal(path, topic="emg_raw")
        assert "topic /emg_raw has the unknown type lab_msgs/msg/Sample" in line
        assert words in line


# Stamps


SECONDS = 6.0
JITTERS: dict[str, Callable[[np.random.Generator, np.ndarray], np.ndarray]] = {
    "noise of 0.3 ms": lambda rng, t: t + rng.normal(0.0, 0.3e-3, len(t)),
    "delays with a long tail": lambda rng, t: t + rng.exponential(4e-3, len(t)),
    "packets of 32 at once": lambda rng, t: t[np.minimum(np.arange(len(t)) // 32 * 32 + 31, len(t) - 1)],
    "packets each 50 ms, spread by 0.1 ms": lambda rng, t: (
        np.arange(len(t)) // 50 * 0.05 + 0.05 + np.arange(len(t)) % 50 * 1e-4
    ),
    "a pause of 0.8 s, then all at once": lambda rng, t: np.where((t > 2.0) & (t < 2.8), 2.8, t),
    "a drift of 200 ppm and steps of 10 ms": lambda rng, t: np.round(t * 1.0002, 2),
    "a clock that is set back by 2 s": lambda rng, t: t - 2.0 * (t > 3.0),
}


def emg(count: int) -> np.ndarray:
    """Two bursting channels, [samples, 2]."""
    rng = np.random.default_rng(11)
    t = np.arange(count) / RATE
    bursts = np.stack([0.5 - 0.5 * np.cos(2 * np.pi * 0.8 * t), 0.5 + 0.5 * np.sin(2 * np.pi * 1.3 * t)], axis=1)
    return bursts**2 * rng.normal(size=(count, 2))


def stamped(path: Path, received: np.ndarray) -> Path:
    """A bag whose stamps are exact."""
    rows = []
    for k, row in enumerate(emg(len(received))):
        message = named(row, ["RF", "VM"], START + k * PERIOD)
        rows.append((START + round(float(received[k]) * 1e9), message))
    rows.sort(key=lambda row: row[0])
    return foreign.write(path, "/emg_raw", rows)


@pytest.mark.parametrize("jitter", JITTERS)
def test_exact_stamps_give_the_envelope_of_exact_times_of_reception(jitter: str, tmp_path: Path) -> None:
    exact = np.arange(int(SECONDS * RATE)) / RATE
    received = JITTERS[jitter](np.random.default_rng(4), exact)
    # A network keeps the order of what one program sends, and a recorder writes down what it gets.
    received = received if "set back" in jitter else np.maximum.accumulate(received)
    expected = envelopes(read(stamped(tmp_path / "exact", exact), stamps="received"))
    path = stamped(tmp_path / "a", received)
    if "set back" in jitter:
        # The recorder's clock put some messages before others; the stamps of what is read do not rise.
        recording = read(path, stamps="header")
        assert any(note.startswith("messages put in the order of their stamps: ") for note in recording.notes)
    else:
        recording = read(path)
        start = "times are the stamps in the messages; times of reception differ by up to "
        assert any(note.startswith(start) for note in recording.notes)
    result = envelopes(recording)
    assert result.rate == expected.rate == RATE
    assert result.values.shape == expected.values.shape
    assert np.abs(result.values - expected.values).max() < 0.02
    np.testing.assert_array_equal(read(path, stamps="header").values, recording.values)


@pytest.mark.parametrize(
    "jitter", ["noise of 0.3 ms", "packets of 32 at once", "a drift of 200 ppm and steps of 10 ms"]
)
def test_times_of_reception_alone_give_nearly_the_same_envelope(jitter: str, tmp_path: Path) -> None:
    exact = np.arange(int(SECONDS * RATE)) / RATE
    received = np.maximum.accumulate(JITTERS[jitter](np.random.default_rng(4), exact))
    expected = envelopes(read(stamped(tmp_path / "exact", exact))).values
    result = envelopes(read(stamped(tmp_path / "a", received), stamps="received")).values
    assert result.shape == expected.shape
    assert np.abs(result - expected).max() < 0.02


def test_stamps_that_are_there_twice(tmp_path: Path) -> None:
    messages = [named(row, stamp=START + k // 2 * PERIOD) for k, row in enumerate(VALUES)]
    path = bag(tmp_path / "a", messages)
    assert "stamps is header; received is needed, for stamps are there twice: message 2 of /emg_raw is stamped 0 s" in (
        refusal(path, stamps="header")
    )
    check(read(path))


def test_times_of_reception_by_option(tmp_path: Path) -> None:
    exact = np.arange(500) / RATE
    path = stamped(tmp_path / "a", exact * 2.0)
    assert read(path).rate == RATE
    assert read(path, stamps="received").rate == RATE / 2
    rows = [(time, array(row)) for time, row in zip(times(240), VALUES, strict=True)]
    plain = foreign.write(tmp_path / "b", "/emg", rows)
    assert "stamps is header; received is needed, for messages on /emg hold no stamp" in refusal(
        plain, names=NAMES, stamps="header"
    )


def test_a_stamp_without_a_header(tmp_path: Path) -> None:
    store = store_of(Sample="builtin_interfaces/Time stamp\nfloat64[] volt\nstring[] name\n")
    sample, time = store.types["lab_msgs/msg/Sample"], store.types["builtin_interfaces/msg/Time"]
    rows = []
    for k, row in enumerate(VALUES):
        stamp = time(sec=(START + k * PERIOD) // SECOND, nanosec=(START + k * PERIOD) % SECOND)
        rows.append((START + k // 7, sample(stamp=stamp, volt=row, name=list(NAMES))))
    check(read(foreign.write(tmp_path / "a", "/x", rows, store)))
