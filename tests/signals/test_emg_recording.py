"""Reading raw recordings: text with a header line, text with a channel header, and what is wrong with them."""

from pathlib import Path

import numpy as np
import pytest

from limb_nodes.errors import UserError
from limb_nodes.signals.recording import read_recording

CHANNELS = """File Name: made.log
Channel 1: 'RF', 3 values, engineering units: mV, no filters.
Channel 2: 'FX', 1 values, engineering units: deg, no filters, extrapolated from 50 to 1000 samples per second.

0.1\t10
\t20
0.3\t30
\t
"""


@pytest.fixture
def write(tmp_path):
    def write(text, name="recording.csv"):
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return str(path)

    return write


def test_channel_header_gives_names_units_and_rate(write):
    recording = read_recording(write(CHANNELS))
    assert recording.names == ("RF", "FX")
    assert recording.units == ("mV", "deg")
    assert recording.rate == 1000.0
    np.testing.assert_array_equal(recording.values, [[0.1, 10], [np.nan, 20], [0.3, 30]])
    assert recording.notes == ("rows without any value at the end, left out: 1",)


def test_channel_header_says_where_values_lack(write):
    recording = read_recording(write(CHANNELS.replace("3 values", "5 values")))
    assert "the header promises 5 values, 3 are there" in recording.notes


@pytest.mark.parametrize("separator", [",", "\t"])
def test_rate_follows_from_the_times(write, separator):
    rows = ["time (ms),RF [mV],VM (left)", "10,1,2", "10.5,3,4", "11,5,6"]
    recording = read_recording(write("\n".join(rows).replace(",", separator)))
    assert recording.rate == 2000.0
    assert recording.names == ("RF", "VM (left)")
    assert recording.units == ("mV", "")
    np.testing.assert_array_equal(recording.values, [[1, 2], [3, 4], [5, 6]])


def test_times_rounded_in_the_file_give_the_true_rate(write):
    times = np.round(np.arange(5000) / 1024, 4)
    recording = read_recording(write("time,RF\n" + "\n".join(f"{t},{i}" for i, t in enumerate(times))))
    assert recording.rate == pytest.approx(1024, abs=0.05)
    assert len(recording.values) == 5000


def test_rows_that_are_not_there_become_gaps(write):
    recording = read_recording(write("t,RF\n0,1\n0.01,2\n0.02,3\n0.05,6\n0.06,7\n"))
    assert recording.rate == 100.0
    np.testing.assert_array_equal(recording.values[:, 0], [1, 2, 3, np.nan, np.nan, 6, 7])
    assert recording.notes == ("rows missing between the first and the last time: 2",)


def test_rate_is_given_if_there_are_no_times(write):
    recording = read_recording(write("# from the lab\nRF,VM\r\n1,2\r\n3,nan\r\n\r\n"), rate=500.0)
    assert recording.rate == 500.0
    np.testing.assert_array_equal(recording.values, [[1, 2], [3, np.nan]])


def test_byte_order_mark_and_latin_text_are_read(write):
    assert read_recording(write(b"\xef\xbb\xbfRF\n1\n2\n"), rate=1.0).names == ("RF",)
    assert read_recording(write("RF [µV]\n1\n2\n".encode("latin-1")), rate=1.0).units == ("µV",)


@pytest.mark.parametrize(
    ("text", "rate", "words"),
    [
        ("", None, "the file is empty"),
        ("RF,VM\n", 1000.0, "no rows below the header"),
        ("1,2\n3,4\n", 1000.0, "line 1: is a row of numbers; names, for example time,RF,VM, are needed"),
        ("RF,VM\n1,2\n3\n4,5\n", 1000.0, "line 3: holds 1 columns; 2 are needed"),
        ("RF,VM\n1,2\n3,x4\n", 1000.0, "line 3: VM is 'x4'; a finite number is needed"),
        ("RF,VM\n1,2\n3,inf\n", 1000.0, "line 3: VM is 'inf'; a finite number is needed"),
        ("RF,VM\n1,2\n", None, "rate is missing: there are no times, and the header states no samples per second"),
        ("RF,VM\n1,2\n", 0.0, "rate is 0; a number > 0 and <= 1e+06 in Hz is needed"),
        ("RF,VM\n1,2\n", float("nan"), "rate is nan; a number > 0"),
        ("RF,VM\n,\n,nan\n", 1000.0, "holds no value; at least one sample is needed"),
        ("time,RF\n0,1\n", None, "holds one row; at least 2"),
        ("time\n0\n1\n", None, "no column beside the times"),
        ("time,RF\n0,1\n,2\n2,3\n", None, "line 3: time is missing; a number > 0, the time before,"),
        ("time,RF\n0,1\n1,2\n1,3\n", None, "line 4: time is 1; a number > 1, the time before,"),
        (
            "time,RF\n" + "".join(f"{t},1\n" for t in (0, 1, 2, 2.6, 3, 4.4, 5.8, 7.2)),
            None,
            "line 5: time is 2.6; times at an even distance",
        ),
        ("RF\n" + "1" * 200_000, 1000.0, "no rows below the header"),
        ("R" * 200_000 + "\n1", 1000.0, "line 2: holds 1 column (delimiter"),
        ("RF\n1\n" + "x" * 1000, 1000.0, "xxx...xxx"),
        (b"RF\0\0\n", 1000.0, "is no text file"),
        (CHANNELS.replace("from 50 to 1000 samples per second", ""), None, "the header states no samples per second"),
        (CHANNELS[: CHANNELS.index("0.1")], None, "no rows below the header"),
    ],
)
def test_bad_files_are_named_with_the_place(write, text, rate, words):
    path = write(text)
    with pytest.raises(UserError) as error:
        read_recording(path, rate=rate)
    line = str(error.value)
    assert words in line
    assert "\n" not in line
    if "rate is" not in words or "missing" in words:
        assert line.startswith(path)


def test_file_that_is_not_there():
    with pytest.raises(UserError, match=r"nowhere\.txt: no such file"):
        read_recording(Path("nowhere.txt"))
