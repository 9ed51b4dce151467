"""Kinds of text that the recorded files do not show, the options that overrule what is concluded, and refusals."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from limb_nodes import cli
from limb_nodes.bags.read import BagReader
from limb_nodes.errors import FieldError, UserError
from limb_nodes.signals.column import column_of
from limb_nodes.signals.recording import Recording, read_recording
from limb_nodes.signals.text_options import TextOptions

ROWS = 40
A = np.round(np.sin(np.arange(ROWS)), 4)
B = np.round(np.cos(np.arange(ROWS)), 4)
TIMES = np.arange(ROWS) / 1000
Write = Callable[..., Path]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    def write(text: str | bytes, encoding: str = "utf-8") -> Path:
        path = tmp_path / "recording.csv"
        path.write_bytes(text if isinstance(text, bytes) else text.encode(encoding))
        return path

    return write


def rows(form: str = "{t:.3f},{a},{b}", end: str = "\n") -> str:
    return "".join(form.format(k=k, t=t, a=a, b=b) + end for k, (t, a, b) in enumerate(zip(TIMES, A, B, strict=True)))


def comma(text: str) -> str:
    return text.replace(",", ";").replace(".", ",")


def is_read(recording: Recording, names: tuple[str, ...] = ("RF", "BF"), rate: float = 1000.0) -> None:
    assert recording.names == names
    assert recording.rate == rate
    np.testing.assert_array_equal(recording.values, np.column_stack([A, B][: len(names)]))


def refusal(path: Path, rate: float | None = None, **options: object) -> str:
    with pytest.raises(UserError) as refused:
        read_recording(path, rate=rate, text=TextOptions(**options))  # type: ignore[arg-type]
    assert "\n" not in str(refused.value)
    return str(refused.value)


KINDS = {
    "double-spaced": "time,RF,BF\r\r\n" + rows(end="\r\r\n"),
    "old Mac": "time,RF,BF\r" + rows(end="\r"),
    "blank lines": "\n\ntime,RF,BF\n\n" + rows().replace("\n", "\n\n", 3),
    "quoted numbers": '"time","RF","BF"\n' + rows('"{t:.3f}","{a}","{b}"'),
    "quoted decimal commas": '"time","RF","BF"\n' + rows('"{t:.3f}","{a}","{b}"').replace(".", ","),
    "Excel's blank cells": "My recording,,,\n,,,\ntime,RF,BF,\n" + rows("{t:.3f},{a},{b},"),
    "trailing delimiters of rows only": "time,RF,BF\n" + rows("{t:.3f},{a},{b},"),
    "names of numpy.savetxt": "# made\n# time RF BF\n" + rows("{t:.3f} {a} {b}"),
    "row names of R": "time RF BF\n" + rows("{k} {t:.3f} {a} {b}"),
    "German units": comma("Zeit / s,RF / mV,BF / mV\n" + rows()),
    "units in a row with brackets": "Time,RF,BF\n[s],[mV],[mV]\n" + rows(),
    "milliseconds": "Time (ms),RF,BF\n" + rows().replace("0.0", "", 1).replace("\n0.0", "\n"),
    "exponents": "time,RF,BF\n" + rows("{t:.6e},{a:.4e},{b:.4E}"),
    "time behind": "RF,BF,timestamp\n" + rows("{a},{b},{t:.3f}"),
    "time without a name of time": "when,RF,BF\n" + rows(),
    "a marker that begins late": "time,Marker,RF,BF\n" + rows("{t:.3f},,{a},{b}").replace("0.030,,", "0.030,start,"),
    "trailing text": "time,RF,BF,comment\n" + rows("{t:.3f},{a},{b},fine"),
    "Vicon Nexus": "Devices\n1000\n,,Delsys - EMG,\nFrame,Sub Frame,RF,BF\n,,V,V\n"
    + rows("{k},0,{a},{b}")
    + "\nTrajectories\n100\n,,hip,,\nFrame,Sub Frame,X,Y,Z\n,,mm,mm,mm\n1,0,1,2,3\n",
    "Qualisys": f"NO_OF_SAMPLES\t{ROWS}\nFREQUENCY\t1000\nDESCRIPTION\t--\nSAMPLE\tTIME\tRF\tBF\n"
    + rows("{k}\t{t:.5f}\t{a}\t{b}"),
    "a second table": "time,RF,BF\n" + rows() + "\nSummary\nmean,max\n0.1,0.2\n",
    "a last line that is cut": "time,RF,BF\n" + rows() + "0.04",
    "two columns of the same times": "time,timestamp,RF,BF\n" + rows("{t:.3f},{t:.4f},{a},{b}"),
    "storage of OpenSim 4": "Coordinates\nversion=1\nnRows=40\nnColumns=3\ninDegrees=yes\n\nUnits are S.I. units.\n\n"
    "endheader\ntime\tRF\tBF\n" + rows("{t:.8f}\t{a}\t{b}"),
    "storage of OpenSim 1": "recording\ndatacolumns 3\ndatarows 40\nrange 0 0.039\nendheader\ntime RF BF\n"
    + rows("  {t:.8f}   {a}   {b}"),
}  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
def test_kind_is_read_right(kind: str, write: Write) -> None:
    text = KINDS[kind]
    if kind == "milliseconds":
        text = "Time (ms),RF,BF\n" + "".join(f"{k},{a},{b}\n" for k, (a, b) in enumerate(zip(A, B, strict=True)))
    is_read(read_recording(write(text)))


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-32", "cp1252"])
def test_encodings(encoding: str, write: Write) -> None:
    recording = read_recording(write("time,Müller [µV],BF [mV]\n" + rows(), encoding))
    assert recording.names == ("Müller", "BF")
    assert recording.units[0] in {"µV", "uV"}


def test_encoding_of_a_script(write: Write) -> None:
    names = "大腿直筋", "大腿二頭筋", "内側広筋と外側広筋", "半腱様筋の測定値"
    recording = read_recording(write(f"時間,time,{names[0]},{names[1]}\n" + rows("0,{t:.3f},{a},{b}"), "shift_jis"))
    given = read_recording(
        write(f"時間,time,{names[0]},{names[1]}\n" + rows("0,{t:.3f},{a},{b}"), "shift_jis"),
        text=TextOptions(encoding="shift_jis"),
    )
    assert given.names[-2:] == names[:2]
    assert len(recording.names) == 3


def test_several_rates_that_end_early_without_delimiters(write: Write) -> None:
    text = "X[s],RF[V],X[s],ACC[g],X[s],knee[deg]\n"
    for k, (a, t) in enumerate(zip(A, TIMES, strict=True)):
        slow = f",{k / 100},0.1,{k / 100},{5 * k}" if k < 4 else ""
        text += f"{t:.3f},{a}{slow}\n"
    recording = read_recording(write(text))
    assert recording.names == ("RF", "knee")
    np.testing.assert_array_equal(recording.values[:, 0], A)
    np.testing.assert_allclose(recording.values[:31, 1], np.arange(31) / 2)
    assert np.isnan(recording.values[31:, 1]).all()
    assert any("ACC (g) left out: it has 100 Hz" in note for note in recording.notes)
    assert any("knee taken from 100 Hz" in note for note in recording.notes)


def test_channels_of_different_rates_are_refused_by_name(write: Write) -> None:
    text = "".join(f"{k / 1000:.3f},1.5,{k / 500:.3f},2.5\n" for k in range(40))
    path = write("X[s],RF[V],X[s],BF[V]\n" + text)
    assert "RF has 1000 Hz and BF 500 Hz; channels of one rate are needed" in refusal(path)
    assert read_recording(path, text=TextOptions(skip=("BF",))).rate == 1000.0


@pytest.mark.parametrize(
    ("cell", "name", "unit"),
    [
        ("RF [mV]", "RF", "mV"), ("RF(mV)", "RF", "mV"), ("RF   [ mV  ]", "RF", "mV"), ("RF [Millivolts]", "RF", "mV"),
        ("RF {uV}", "RF", "uV"), ("RF_mV", "RF", "mV"), ("RF uV", "RF", "uV"), ("RF / mV", "RF", "mV"),
        ("RF,mV", "RF", "mV"), ("time_s", "time", "s"), ("Time (seconds)", "Time", "s"), ("knee [°]", "knee", "°"),
        ("VM (left)", "VM (left)", ""), ("RF (1)", "RF (1)", ""), ("ACC X (G)", "ACC X", "G"), ("T [N·m]", "T", "N·m"),
        ("T [furlong]", "T", "furlong"), ("RF [MV]", "RF", "MV"), ("RF_m", "RF_m", ""), ("RF V", "RF V", ""),
    ],
)  # fmt: skip
def test_names_and_units(cell: str, name: str, unit: str) -> None:
    column = column_of(cell)
    assert (column.name, column.unit) == (name, unit)


@pytest.mark.parametrize(
    "name", ["Time", "time", "t", "Timestamp", "elapsed time", "Zeit", "Temps", "TimeStamp", "rec_time", "X[s]"]
)
def test_names_of_time(name: str) -> None:
    assert column_of(name).says_time


@pytest.mark.parametrize("name", ["RF", "ST", "tibialis", "lifting [N]", "time to peak [N]", "temp"])
def test_other_names(name: str) -> None:
    assert not column_of(name).says_time


class TestOptions:
    """Each decision can be overruled."""

    def test_delimiter_and_decimal(self, write: Write) -> None:
        path = write("RF;BF\n" + "1,234;2,345\n" * 30)
        assert "1,234, with a comma for decimals or for thousands" in refusal(path, rate=100.0)
        given = read_recording(path, rate=100.0, text=TextOptions(decimal=","))
        np.testing.assert_array_equal(given.values[0], [1.234, 2.345])
        path = write("RF\n" + "1,5\n" * 30)
        assert read_recording(path, rate=100.0).values[0] == 1.5
        assert "no line above names" in refusal(path, rate=100.0, delimiter="comma")

    @pytest.mark.parametrize("delimiter", [",", "comma"])
    def test_delimiter_by_sign_and_name(self, write: Write, delimiter: str) -> None:
        is_read(read_recording(write("time,RF,BF\n" + rows()), text=TextOptions(delimiter=delimiter)))

    def test_header_row(self, write: Write) -> None:
        path = write("old,OLD1,OLD2\nx,y,z\ntime,RF,BF\n" + rows())
        is_read(read_recording(path, text=TextOptions(header_row=3)))
        assert read_recording(path, rate=1.0, text=TextOptions(header_row=1)).names == ("OLD1", "OLD2")
        assert "header_row is 999; a line above rows" in refusal(path, header_row=999)
        bare = write(rows("{a},{b}"))
        assert "names, for example time,RF,VM, are needed above it, or header row 0" in refusal(bare, rate=1000.0)
        is_read(
            read_recording(bare, rate=1000.0, text=TextOptions(header_row=0, delimiter=",")), ("column 1", "column 2")
        )

    def test_time(self, write: Write) -> None:
        path = write("time,Time 2,RF,BF\n" + rows("{k},{t:.3f},{a},{b}"))
        assert "time is not clear: 'time' or 'Time 2' holds times" in refusal(path)
        is_read(read_recording(path, text=TextOptions(time="Time 2")))
        assert "time names 'RG'; one of time, Time 2, RF, BF is needed" in refusal(path, time="RG")
        is_read(read_recording(path, rate=1000.0, text=TextOptions(no_times=True)))
        assert "rate is missing" in refusal(path, no_times=True)

    def test_two_columns_that_rise_evenly(self, write: Write) -> None:
        path = write("x,y,RF\n" + rows("{t:.3f},{t:.4f}5,{a}"))
        assert "time is not clear: 'x' or 'y' rises evenly" in refusal(path)
        assert read_recording(path, text=TextOptions(time="x")).rate == 1000.0

    def test_unit(self, write: Write) -> None:
        path = write("time,RF,ACC [G]\n" + "".join(f"{k},{a},1\n" for k, a in enumerate(A)))
        assert "units of time is not clear: 1 Hz if it is in s, 1000 Hz if in ms" in refusal(path)
        recording = read_recording(path, text=TextOptions(units={"time": "ms", "": "microvolts"}))
        assert recording.rate == 1000.0
        assert recording.units == ("uV", "G")
        assert "units names 'x'" in refusal(path, units={"x": "mV"})

    def test_skip_acts_before_cells_are_read(self, write: Write) -> None:
        path = write("time,RF,BF,odd\n" + rows("{t:.3f},{a},{b},{k}").replace(",17\n", ",17x\n"))
        assert "line 19: odd is '17x'" in refusal(path)
        recording = read_recording(path, text=TextOptions(skip=("odd",)))
        is_read(recording)
        assert recording.skipped == ("odd",)
        assert "skip names 'odder'" in refusal(path, skip=("odder",))

    def test_wanted_columns_are_kept_whatever_their_name(self, write: Write) -> None:
        path = write("time,trigger,BF\n" + rows())
        assert read_recording(path).names == ("BF",)
        is_read(read_recording(path, text=TextOptions(wanted=("trigger", "BF"))), ("trigger", "BF"))

    def test_rate(self, write: Write) -> None:
        path = write("time,RF,BF\n" + rows())
        recording = read_recording(path, rate=500.0)
        assert recording.rate == 500.0
        assert "rate 500 Hz as given; the times say 1000 Hz" in recording.notes

    @pytest.mark.parametrize(
        ("options", "words"),
        [
            ({"delimiter": "x"}, "delimiter is 'x'; one of comma, semicolon, tab, blanks"),
            ({"decimal": ":"}, "decimal is ':'"),
            ({"header_row": -1}, "header_row is -1"),
            ({"encoding": "klingon"}, "encoding is 'klingon'"),
            ({"encoding": "utf-16"}, "is no text in utf-16"),
        ],
    )
    def test_options_without_meaning(self, write: Write, options: dict[str, object], words: str) -> None:
        assert words in refusal(write("time,RF,BF\n" + rows() + "0"), **options)

    def test_command(self, write: Write, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        noise = np.random.default_rng(0).normal(size=2000)
        text = "".join(f"{k};{1e3 * value:.0f};x\n" for k, value in enumerate(noise))
        path = write("n;RF;note\n" + text)
        given = [
            "emg",
            str(path),
            "-o",
            str(tmp_path / "env"),
            "--delimiter",
            "semicolon",
            "--decimal",
            ",",
            "--time",
            "n",
        ]
        assert cli.main([*given, "--unit", "n=ms", "--unit", "uV", "--skip", "note", "--header-row", "1"]) == 0
        assert "rate 1000 Hz" in capsys.readouterr().out
        with BagReader(tmp_path / "env") as reader:
            assert reader.table("emg_envelope")["envelope"].shape == (2000, 1)
        assert cli.main(["emg", str(path), "-o", str(tmp_path / "other"), "--time", "m"]) == 2
        assert "--time names 'm'" in capsys.readouterr().err


def test_cells_that_are_no_number_are_missing_if_they_are_few(write: Write) -> None:
    text = "RF,BF\n" + "".join(f"{k % 7}.{k:04d},1.5\n" for k in range(3000)).replace("\n2.1500,", "\n7.5V,")
    recording = read_recording(write(text), rate=1000.0)
    assert np.isnan(recording.values[1500, 0])
    assert np.isnan(recording.values).sum() == 1
    assert "RF is '7.5V' in line 1502: no number, taken as missing" in recording.notes
    many = text.replace("\n1", "\nx1")
    assert "line 3: RF is 'x1.0001'; a finite number is needed, or the column skipped" in refusal(
        write(many), rate=1000.0
    )


@pytest.mark.parametrize("row", [0, 1, 2, 30])
def test_a_wrong_cell_in_a_short_file_is_refused_with_its_line(row: int, write: Write) -> None:
    lines = ["RF,BF", *(f"{k},1.5" for k in range(100, 140))]
    lines[1 + row] = f"x{lines[1 + row]}"
    line = refusal(write("\n".join(lines)), rate=1000.0)
    assert f"line {2 + row}: RF is 'x{100 + row}'; a finite number is needed" in line


def test_names_may_be_numbers_of_channels(write: Write) -> None:
    is_read(read_recording(write("time,1,2\n" + rows())), ("1", "2"))


def test_repeated_names_are_told_apart(write: Write) -> None:
    recording = read_recording(write("time,EMG,EMG\n" + rows()))
    assert recording.names == ("EMG", "EMG (2)")
    assert "2 columns are named EMG: EMG, EMG (2) ..." in recording.notes


def test_absolute_start_is_kept(write: Write) -> None:
    text = "".join(f"{1772460000.25 + t:.6f},{a}\n" for t, a in zip(TIMES, A, strict=True))
    assert read_recording(write("time,RF\n" + text)).start == 1772460000.25
    jump = text.splitlines()
    jump[20] = "1772459999.000000,0.5"
    line = refusal(write("time,RF\n" + "\n".join(jump)))
    assert "line 22: time is -1.25 after the first" in line


@pytest.mark.parametrize(
    "content",
    [
        b",".join([b"a"] * 1_000_000) + b"\n" + b",".join([b"1"] * 1_000_000),
        b",".join([b"c"] * 5000) + b"\n" + b",".join([b"1"] * 5000),
        b"# remark\n" * 1_200_000 + b"time,RF\n0,1\n1,2\n",
        b"x" * 10_000_000,
        b"\n" * 10_000_000 + b"RF\n1\n",
        b"RF\n1\n" + b"2" * 9_000_000,
        b"# {" + b"[" * 900_000 + b"\n1\n2\n",
        b"(" * 900_000 + b"\n1\n2\n",
    ],
    ids=["columns", "5000 columns", "header", "one line", "blank lines", "long row", "JSON", "brackets"],
)
def test_sizes_are_refused_at_once(content: bytes, write: Write) -> None:
    path = write(content)
    begun = time.process_time()
    refusal(path, rate=1000.0)
    assert time.process_time() - begun < 1.0


def test_two_readings_are_both_told(write: Write) -> None:
    with pytest.raises(FieldError) as refused:
        read_recording(write("1,5\n2,5\n3,7\n"), rate=100.0, text=TextOptions(header_row=0))
    assert "delimiter is not clear: line 1 holds 2 columns (delimiter comma, decimal point) or 1 column" in str(
        refused.value
    )
