"""Analog channels of C3D files, written by ezc3d."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from limb_nodes import cli
from limb_nodes.errors import UserError
from limb_nodes.signals.column import numbered
from limb_nodes.signals.recording import read_recording

ezc3d = pytest.importorskip("ezc3d")

RATE, FRAMES = 2000.0, 100.0
LABELS, UNITS = ["RF", "VM", "Force.Fx", "knee"], ["V", "Millivolts", "N", "deg"]
VALUES = np.random.default_rng(3).normal(size=(4000, 4)) * [1e-4, 0.1, 50.0, 30.0]


def write(path: Path, labels=LABELS, units=UNITS, values=VALUES) -> Path:
    file = ezc3d.c3d()
    file["parameters"]["POINT"]["RATE"]["value"] = [FRAMES]
    file["data"]["points"] = np.zeros((4, 0, round(len(values) * FRAMES / RATE)))
    file["parameters"]["ANALOG"]["RATE"]["value"] = [RATE]
    file["parameters"]["ANALOG"]["LABELS"]["value"] = labels
    file["parameters"]["ANALOG"]["UNITS"]["value"] = units
    file["data"]["analogs"] = values.T[np.newaxis]
    file.write(str(path))
    return path


def refusal(path: Path) -> str:
    with pytest.raises(UserError) as error:
        read_recording(path)
    line = str(error.value)
    assert "\n" not in line
    return line


def test_channels_units_rate_and_values(tmp_path):
    recording = read_recording(write(tmp_path / "a.c3d"))
    assert recording.names == ("RF", "VM", "Force.Fx", "knee")
    assert recording.units == ("V", "mV", "N", "deg")
    assert recording.rate == RATE
    assert recording.notes == ()
    # The file holds numbers of 24 bits.
    np.testing.assert_allclose(recording.values, VALUES, rtol=1e-6, atol=1e-7)


def test_the_rate_that_is_given_counts(tmp_path):
    path = write(tmp_path / "a.c3d").rename(tmp_path / "a.C3D")
    assert read_recording(path, rate=1000.0).rate == 1000.0


def test_equal_and_missing_names(tmp_path):
    path = write(tmp_path / "a.c3d", labels=["EMG", "EMG", "", "knee"], units=["V", "V", "", "deg"])
    recording = read_recording(path)
    assert recording.names == ("EMG", "EMG (2)", "analog 3", "knee")
    assert recording.units[2] == ""


def test_a_number_that_a_name_has_already_is_passed_over():
    assert numbered(["EMG", "EMG", "EMG (2)", "EMG"]) == ["EMG", "EMG (3)", "EMG (2)", "EMG (4)"]
    assert numbered(["a", "b", "a", "a"]) == ["a", "b", "a (2)", "a (3)"]


def test_the_command_takes_emg_and_angles_and_names_the_rest(tmp_path, capsys):
    assert cli.main(["emg", str(write(tmp_path / "a.c3d")), "-o", str(tmp_path / "env")]) == 0
    printed = capsys.readouterr().out
    assert "Force.Fx" in printed
    assert "neither EMG nor angle" in printed
    assert "knee (angle)" in printed
    assert "rate 2000 Hz, 1.9995 s" in printed


def test_a_cut_file_says_how_much_is_there(tmp_path):
    path = write(tmp_path / "a.c3d")
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    recording = read_recording(path)
    assert 0 < len(recording.values) < 4000
    np.testing.assert_allclose(recording.values, VALUES[: len(recording.values)], rtol=1e-6, atol=1e-7)
    assert recording.notes == (f"the header promises 4000 values, {len(recording.values)} are there",)


def test_what_cannot_be_read_is_refused_in_one_line(tmp_path, monkeypatch):
    assert "no such file" in refusal(tmp_path / "none.c3d")
    (tmp_path / "text.c3d").write_text("time,RF\n0,1\n")
    assert "is no C3D file" in refusal(tmp_path / "text.c3d")
    (tmp_path / "empty.c3d").write_bytes(b"")
    assert "is no C3D file" in refusal(tmp_path / "empty.c3d")
    huge = bytearray(write(tmp_path / "huge.c3d").read_bytes())
    huge[2:10] = struct.pack("<4H", 65535, 65535, 1, 65535)
    (tmp_path / "huge.c3d").write_bytes(huge)
    assert "its header promises" in refusal(tmp_path / "huge.c3d")
    # Damage behind the header, which may end the package that reads it.
    for place in (514, 600, 900, 1200):
        damaged = bytearray(write(tmp_path / "damaged.c3d").read_bytes())
        damaged[place : place + 40] = b"\xff" * 40
        (tmp_path / "damaged.c3d").write_bytes(damaged)
        try:
            read_recording(tmp_path / "damaged.c3d")
        except UserError as error:
            assert "\n" not in str(error)
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    assert "the package ezc3d is needed" in refusal(write(tmp_path / "good.c3d"))
