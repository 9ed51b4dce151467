"""Files as people have them (`emg_formats`): each is read right by number, or refused with what to do."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from limb_nodes import cli
from limb_nodes.errors import UserError
from limb_nodes.signals.activation import load_activation
from limb_nodes.signals.recording import Recording, read_recording
from tests.recordings import recorded

RF_BF = ("RF", "BF")


@dataclass(frozen=True)
class Right:
    """The right reading: channels and units, rate (Hz), first and last values of the channels; what the notes say.

    left: words of the notes on what is left out or peculiar.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    rate: float
    samples: int
    first: tuple[float, ...]
    last: tuple[float, ...]
    left: tuple[str, ...] = ()
    start: float | None = 0.0
    rate_given: float | None = None
    missing: int = 0


def plain(unit: str, rate: float = 1000.0, power: int = 0, samples: int = 1499, **changes: object) -> Right:
    """The signal that most of the files hold, times a power of ten."""
    first, last = [
        tuple(float(f"{text}e{power}") for text in pair) for pair in (("1.728", "1.535"), ("-4.43", "9.761"))
    ]
    given = {"names": RF_BF, "units": (unit, unit), "rate": rate, "samples": samples, "first": first, "last": last}
    return Right(**{**given, **changes})  # type: ignore[arg-type]


def stamped(**changes: object) -> Right:
    """The signal of the files in `lsl-jitter`."""
    given: dict[str, object] = {"first": (0.001728, -0.004347), "last": (-0.00443, 0.064885)}
    return plain("mV", **{**given, **changes})  # type: ignore[arg-type]


ARTEFACT = {"samples": 6000, "first": (0.001728, -0.004347), "last": (0.003322, 0.001837)}
ENVELOPE = {"names": ("RF", "BF", "VM", "ST"), "units": ("",) * 4, "rate": 100.0, "samples": 201}
READ = {
    "artefact/clean.csv": plain("mV", **ARTEFACT),
    "artefact/clipped.csv": plain("mV", **{**ARTEFACT, "first": (0.005184, -0.01304), "last": (0.009965, 0.005512)}),
    "artefact/spike.csv": plain("mV", **ARTEFACT),
    "artefact/nan_10ms.csv": plain("mV", **ARTEFACT, missing=10),
    "artefact/nan_2s.csv": plain("mV", **ARTEFACT, missing=2000),
    "dead-channel/dead.csv": Right(
        ("RF", "BF", "IM EMG9"), ("mV",) * 3, 1000.0, 1499, (1.728, 1.535, 0.0), (-4.43, 9.761, 0.0)
    ),
    "dead-channel/unplugged.csv": plain("mV", names=("RF", "unplugged"), first=(1.728, 0.0001), last=(-4.43, 0.0001)),
    "decimal-comma/semicolon.csv": plain("mV", power=-3, left=("semicolons", "decimal comma")),
    "decimal-comma/semicolon_point.csv": plain("mV", power=-3, left=("semicolons",)),
    "decimal-comma/sep_line.csv": plain(
        "mV", power=-3, samples=1498, last=(0.001649, -0.186569), left=("decimal comma", "names in line 2")
    ),
    "decimal-comma/spaces.txt": plain("", power=-3, left=("blanks",)),
    "decimal-comma/tab_comma.txt": plain("mV", power=-3, left=("decimal comma",)),
    "headers/duplicate.csv": plain("", names=("EMG", "EMG (2)"), left=("2 columns are named EMG",)),
    "headers/elapsed.csv": plain("mV"),
    "headers/index.csv": plain("", left=("column 1 left out",)),
    "headers/no_time_sampleidx.csv": plain("", left=("sample left out",), start=None, rate_given=1000.0),
    "headers/padded.csv": plain("mV"),
    "headers/quoted.csv": plain("mV", names=("RF, left", "BF")),
    "headers/time_named.csv": plain("mV"),
    "headers/time_seconds.csv": plain("mV", units=("mV", "uV")),
    "headers/trailing.csv": plain(""),
    "headers/underscore.csv": plain("mV"),
    "headers/unit_row.csv": plain("uV", samples=1498, last=(1.649, -186.569)),
    "headers/vol.csv": plain("mV", units=("V", "mV")),
    "lsl-jitter/chunks.csv": stamped(start=-0.0095, left=("times evened",)),
    "lsl-jitter/drift30ppm.csv": stamped(rate=999.97),
    "lsl-jitter/gap.csv": stamped(),
    "lsl-jitter/jitter_2ms.csv": stamped(start=0.001, left=("times evened",)),
    "lsl-jitter/jitter_small.csv": stamped(left=("times evened",)),
    # The rows of these two that go back or change the rate are cut off.
    "lsl-jitter/jump_back.csv": stamped(),
    "lsl-jitter/rate_changes.csv": stamped(),
    "noraxon-mr/mr.csv": plain(
        "uV", rate=2000.0, samples=1496, names=("LT RECTUS FEM.", "RT BICEPS FEM."), first=(1.728, -4.347),
        last=(-64.327, -4.82), left=("Activity", "Marker"),
    ),
    "noraxon-mr/mr_cut.csv": plain(
        "uV", rate=2000.0, names=("LT RECTUS FEM.", "RT BICEPS FEM."), first=(1.728, -4.347), last=(-67.275, 3.09),
        left=("Activity", "Marker"),
    ),
    "noraxon-mr/mr_old.csv": plain(
        "uV", rate=2000.0, names=("Rectus Fem.", "Biceps Fem."), first=(1.728, -4.347), last=(-67.275, 3.09)
    ),
    "openbci/myo200.csv": plain("", 200.0, samples=1200, names=("emg1", "emg2"), first=(0.0, 0.0), last=(1.0, 0.0)),
    "openbci/myo_connect.csv": plain(
        "", 200.0, samples=1200, names=("emg1", "emg2"), first=(0.0, 0.0), last=(1.0, 0.0), start=1772459999.9975,
        left=("taken in us",),
    ),
    "openbci/openbci.txt": plain(
        "", 250.0, samples=1495, names=("EXG Channel 0", "EXG Channel 1"), first=(-44998.2721, -11998.0574),
        last=(-45010.0952, -11990.9953), start=1772459999.976,
        left=("Timestamp (Formatted)", "Sample Index left out", "Accel Channel 0 left out: acceleration"),
    ),
    "openbci/plain250.csv": plain("uV", 250.0, first=(1.728, 1.943), last=(-4.43, 19.505)),
    "opensignals/biosppy_like.txt": plain(
        "", names=("EMG",), units=("",), samples=1496, first=(2049.0,), last=(2045.0,), start=None
    ),
    "opensignals/opensignals.txt": plain(
        "", names=("CH1", "CH2"), samples=1497, first=(32774.0, 32774.0), last=(32753.0, 33087.0), start=None,
        left=("nSeq left out", "DI left out"),
    ),
    "opensim-sto/emg_v1.sto": plain(
        "", samples=1493, first=(0.00172792, 0.00153509), last=(0.00701073, -0.22205244), left=("promises 4000 values",)
    ),
    "opensim-sto/emg_v2.sto": plain("", samples=1493, first=(0.00172792, 0.00153509), last=(0.00701073, -0.22205244)),
    "opensim-sto/excitations.mot": Right(
        ("RF", "BF", "VM", "ST"), ("",) * 4, 100.0, 401, (0.2, 0.05, 0.2, 0.05), (0.12431975, 0.05, 0.2, 0.05)
    ),
    "trigno-discover/cut_by_hand.csv": plain(
        "mV", 2148.1481, names=("EMG 1", "EMG 1 (2)"), first=(0.001728, -0.004138), last=(-0.076539, -0.004476),
        left=("ACC X (G) left out",),
    ),
    "trigno-discover/discover.csv": plain(
        "mV", 2148.1481, samples=1492, names=("Avanti Sensor 1 (75923) EMG 1", "Avanti Sensor 2 (75911) EMG 1"),
        first=(0.001728, -0.004138), last=(-0.108823, -0.006885), left=("ACC X (G) left out",),
    ),
    "trigno-discover/emgworks.csv": plain(
        "V", 2148.1481, names=("Avanti sensor 1: EMG 1",), units=("V",), first=(1.728e-6,), last=(-7.6539e-05,),
        left=("ACC 1X (g) left out",),
    ),
    "unknown-unit/acc.csv": Right(
        ("RF", "ACC X", "Torque", "knee", "Temp", "Force"), ("mV", "G", "N·m", "deg", "°C", "lbf"), 1000.0, 1499,
        (0.03456, 0.9, 0.0, 45.0, 31.0, 0.0), (-0.0886, 0.9997, 9.974, 74.921, 31.01, 4.987),
    ),
    "envelope-edge/negative_1e-12.csv": Right(
        **ENVELOPE, first=(-1e-12, 0.02, 0.1, 0.02), last=(-1e-12, 0.02, 0.1, 0.02)
    ),
    "envelope-edge/overshoot_1e-9.csv": Right(
        **ENVELOPE, first=(0.0, 0.02, 0.1, 0.02), last=(1.4997597841616175e-32, 0.02, 0.1, 0.02)
    ),
    "envelope-edge/percent.csv": Right(
        **ENVELOPE, first=(0.0, 0.02, 0.1, 0.02), last=(8.998558695971147e-31, 0.02, 0.1, 0.02)
    ),
}  # fmt: skip
REFUSED = {
    "headers/no_time_sampleidx.csv": "rate is missing: there are no times",
}


def is_right(recording: Recording, right: Right) -> None:
    assert recording.names == right.names
    assert recording.units == right.units
    assert recording.rate == pytest.approx(right.rate, rel=1e-4)
    assert len(recording.values) == right.samples
    assert np.isnan(recording.values).sum() == right.missing
    np.testing.assert_array_equal(recording.values[0], right.first)
    np.testing.assert_array_equal(recording.values[-1], right.last)
    notes = "\n".join(recording.notes)
    for words in right.left:
        assert words in notes
    assert (recording.start is None) == (right.start is None)
    if right.start is not None:
        assert recording.start == pytest.approx(right.start, abs=1.0 / right.rate)


@pytest.mark.parametrize("name", READ)
def test_file_is_read_right_by_number(name: str) -> None:
    right = READ[name]
    is_right(read_recording(recorded(f"emg_formats/{name}"), rate=right.rate_given), right)


@pytest.mark.parametrize("name", REFUSED)
def test_file_is_refused_with_the_remedy(name: str) -> None:
    with pytest.raises(UserError) as refused:
        read_recording(recorded(f"emg_formats/{name}"))
    line = str(refused.value)
    assert REFUSED[name] in line
    assert "\n" not in line


def test_every_file_is_in_the_table() -> None:
    folder = recorded("emg_formats")
    files = {str(path.relative_to(folder)) for path in folder.glob("*/*")}
    assert files == {*READ, *REFUSED}


def test_a_gap_of_two_seconds_is_refused_by_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    given = ["emg", str(recorded("emg_formats/artefact/nan_2s.csv")), "-o"]
    assert cli.main([*given, str(tmp_path / "refused")]) == 2
    line = capsys.readouterr().err
    assert line.count("\n") == 1
    assert "--longest-gap" in line
    assert cli.main([*given, str(tmp_path / "kept"), "--keep-gaps"]) == 0


def test_envelopes_at_the_edge() -> None:
    muscles = ["RF", "BF", "VM", "ST"]
    for name in ("negative_1e-12", "overshoot_1e-9"):
        result = load_activation(str(recorded(f"emg_formats/envelope-edge/{name}.csv")), muscles, 100.0)
        assert 0.0 <= result.values.min() <= result.values.max() <= 1.0
        assert any("by rounding" in note for note in result.notes)
    with pytest.raises(UserError, match="percent"):
        load_activation(str(recorded("emg_formats/envelope-edge/percent.csv")), muscles, 100.0)


def test_excitations_of_opensim_are_activations() -> None:
    muscles = ["VM", "RF"]
    result = load_activation(str(recorded("emg_formats/opensim-sto/excitations.mot")), muscles, 100.0)
    assert result.values.shape == (401, 2)
    np.testing.assert_array_equal(result.values[0], [0.2, 0.2])
    np.testing.assert_array_equal(result.values[-1], [0.2, 0.12431975])


@pytest.mark.parametrize("name", ["1Nmar", "9Apie", "11Apie", "1Asen", "7Npie"])
def test_recordings_of_the_cohort_are_read(name: str) -> None:
    file = recorded(f"uci_cohort/{name}.txt")
    recording = read_recording(file, rate=1000.0)
    assert recording.units == ("mV", "mV", "mV", "mV", "deg")
    notes = "\n".join(recording.notes)
    assert ("FX is '7.5V' in line 5690" in notes) == (name == "1Nmar")
    assert ("column 6 left out" in notes) == (name in {"9Apie", "11Apie"})
