"""Maxima from other recordings, and the raw EMG that the bag keeps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from limb_nodes.bags.read import BagReader
from limb_nodes.cli import main
from limb_nodes.errors import FieldError, UserError
from limb_nodes.signals.emg import envelopes
from limb_nodes.signals.envelope_bag import read_raw, write_envelopes
from limb_nodes.signals.options import EnvelopeOptions
from limb_nodes.signals.recording import Recording


def made(
    *names: str, scale: float = 1.0, rate: float = 1000.0, unit: str = "mV", source: str = "task.csv", seed: int = 0
) -> Recording:
    values = scale * np.random.default_rng(seed).normal(size=(round(2 * rate), len(names)))
    return Recording(source, names, (unit,) * len(names), values, rate)


def peak_of(recording: Recording, name: str, **options: object) -> float:
    result = envelopes(recording, EnvelopeOptions(**options))
    return result.channels[result.names.index(name)].maximum


@pytest.mark.parametrize("options", [{}, {"causal": True, "mains": 50.0}, {"low_pass": 3.0, "band": (30.0, 300.0)}])
def test_the_largest_envelope_of_all_recordings_counts_as_one(options):
    task = made("RF", "BF")
    first = made("BF", "RF", "other", scale=2.0, source="mvc1.csv", seed=1)
    second = made("RF", scale=3.0, rate=1500.0, source="mvc2.csv", seed=2)
    result = envelopes(task, EnvelopeOptions(**options), [first, second])
    expected = {"RF": peak_of(second, "RF", **options), "BF": peak_of(first, "BF", **options)}
    assert {channel.column: channel.maximum for channel in result.channels} == pytest.approx(expected)
    own = envelopes(task, EnvelopeOptions(**options))
    for i, channel in enumerate(own.channels):
        np.testing.assert_allclose(result.values[:, i], own.values[:, i] * channel.maximum / expected[channel.column])
    assert result.values.max() < 0.7
    (note,) = result.notes
    assert note.startswith("maxima: ")
    assert f"RF {expected['RF']:.4g} mV (mvc2.csv at " in note
    assert f"BF {expected['BF']:.4g} mV (mvc1.csv at " in note
    assert result.maximum_from == ("mvc1.csv", "mvc2.csv")


def test_units_are_turned_into_that_of_the_task():
    strong = made("RF", scale=2.0, source="mvc.csv", seed=1)
    in_volts = Recording("mvc.csv", ("RF",), ("V",), strong.values * 1e-3, 1000.0)
    in_microvolts = Recording("mvc.csv", ("RF",), ("µV",), strong.values * 1e3, 1000.0)
    expected = envelopes(made("RF"), None, [strong]).values
    for other in (in_volts, in_microvolts):
        np.testing.assert_allclose(envelopes(made("RF"), None, [other]).values, expected)
    with pytest.raises(UserError, match=r"mvc.csv: channel RF has no unit; mV, as in the recording to normalise, is"):
        envelopes(made("RF"), None, [made("RF", unit="", source="mvc.csv")])


def test_a_missing_channel_is_refused_by_name():
    mvc = made("RF", source="mvc.csv", seed=1)
    line = (
        "maximum_from is mvc.csv, without a signal of channel BF; a recording with it is needed, or --maximum BF=VALUE"
    )
    with pytest.raises(FieldError) as error:
        envelopes(made("RF", "BF"), None, [mvc])
    assert str(error.value) == line
    silent = Recording("mvc.csv", ("RF", "BF"), ("mV", "mV"), np.hstack([mvc.values, 0 * mvc.values]), 1000.0)
    with pytest.raises(FieldError) as error:
        envelopes(made("RF", "BF"), None, [silent])
    assert str(error.value) == line
    given = envelopes(made("RF", "BF"), EnvelopeOptions(maximum={"BF": 2.0}), [mvc])
    assert given.channels[1].maximum == 2.0
    assert envelopes(made("RF", "BF"), EnvelopeOptions(skip=("BF",)), [mvc]).names == ("RF",)


def test_a_spike_in_the_maximum_is_noted_with_its_file():
    mvc = made("RF", scale=2.0, source="mvc.csv", seed=1)
    plain = peak_of(mvc, "RF")
    mvc.values[700, 0] = 100.0
    result = envelopes(made("RF"), None, [mvc])
    assert result.notes[0].startswith("mvc.csv: channel RF: a lone spike, 100 mV at 0.7 s, ")
    assert result.channels[0].maximum > 1.5 * plain
    removed = envelopes(made("RF"), EnvelopeOptions(remove_spikes=True), [mvc])
    assert removed.channels[0].maximum == pytest.approx(plain, rel=0.02)


def test_a_filter_that_cannot_work_on_the_maximum_names_its_file():
    with pytest.raises(FieldError, match=r"^mvc.csv \(600 Hz\): band corner is 450; a number > 0 and < 300 in Hz"):
        envelopes(made("RF"), None, [made("RF", rate=600.0, source="mvc.csv")])


def write(path: Path, recording: Recording) -> str:
    times = np.arange(len(recording.values)) / recording.rate
    header = ",".join(["time [s]", *(f"{n} [{u}]" for n, u in zip(recording.names, recording.units, strict=True))])
    np.savetxt(path, np.column_stack([times, recording.values]), "%.6g", ",", header=header, comments="")
    return str(path)


def test_the_command_takes_several_files_and_keeps_the_raw_emg(tmp_path, capsys):
    task = write(tmp_path / "task.csv", made("RF", "BF"))
    mvcs = [write(tmp_path / f"mvc{k}.csv", made(name, scale=4.0, seed=k)) for k, name in ((1, "RF"), (2, "BF"))]
    out = tmp_path / "env"
    arguments = ["emg", task, "-o", str(out), "--channel", "RF=knee extensor", "--channel", "BF"]
    steps = ["--causal", "--mains", "60", "--delay", "0.05", "--resample", "100"]
    assert main([*arguments, *steps, "--maximum-from", *mvcs]) == 0
    assert f"({mvcs[1]} at " in capsys.readouterr().out
    with BagReader(out) as bag:
        info = bag.run_info()
        times, raw = read_raw(bag, "emg_raw", info["raw_rate"], 2)
        assert bag.topics["/emg_raw"] == "std_msgs/msg/Float32MultiArray"
        assert bag.count("emg_raw") == 2
        assert len(bag.table("emg_envelope")["time"]) == 200
    assert info["maximum_from"] == mvcs
    assert info["parameters"]["causal"] is True
    assert info["parameters"]["delay"] == 0.05
    np.testing.assert_allclose(times, np.arange(2000) / 1000.0, atol=1e-9)
    np.testing.assert_allclose(raw, made("RF", "BF").values, rtol=1e-5)
    assert main([*arguments[:3], str(tmp_path / "b"), "--maximum-from", mvcs[0]]) == 2
    assert capsys.readouterr().err == (
        f"limb: error: --maximum-from is {mvcs[0]}, without a signal of channel BF; a recording with it is needed, or "
        "--maximum BF=VALUE\n"
    )
    assert not (tmp_path / "b").exists()
    assert main([*arguments[:3], str(tmp_path / "c"), "--no-raw"]) == 0
    with BagReader(tmp_path / "c") as bag:
        assert "/emg_raw" not in bag.topics


def test_what_was_noticed_is_in_the_bag(tmp_path):
    raw = made("a", "b", "c", "d", rate=np.float64(1000.0))
    raw.values[500:800, 0] = np.nan
    raw.values[:, 1] = 0.0
    raw.values[:, 2] = np.clip(raw.values[:, 2], -1, 1)
    raw.values[1200:1500, 2] = 0.25
    raw.values[100, 3] = 90.0
    result = envelopes(raw, EnvelopeOptions(keep_gaps=True))
    write_envelopes(result, tmp_path / "env")
    with BagReader(tmp_path / "env") as bag:
        noticed = bag.run_info()["artefacts"]
    assert [(one["column"], one["kind"], one["start"], one["end"]) for one in noticed] == [
        ("a", "gap", 0.5, 0.8),
        ("b", "no signal", 0.0, 1.999),
        *((one.column, one.kind, one.start, one.end) for one in result.artefacts[2:4]),
        ("c", "still", 1.2, 1.499),
        ("d", "spike", 0.1, 0.1),
    ]
    assert [one["kind"] for one in noticed[2:4]] == ["clipping", "clipping"]


def test_the_raw_emg_keeps_its_gaps_at_an_odd_rate(tmp_path):
    raw = made("RF", "BF", rate=1925.926)
    raw.values[100:120, 1] = np.nan
    write_envelopes(envelopes(raw), tmp_path / "env")
    with BagReader(tmp_path / "env") as bag:
        times, values = read_raw(bag, "emg_raw", 1925.926, 2)
        with pytest.raises(UserError, match="3852 values; as many of each of 7 channels are needed"):
            read_raw(bag, "emg_raw", 1925.926, 7)
    np.testing.assert_allclose(times, np.arange(len(raw.values)) / 1925.926, atol=2e-9)
    np.testing.assert_allclose(values, raw.values, rtol=1e-6)
