"""Times and rates that no recording has end in one line, before anything is written."""

from __future__ import annotations

from pathlib import Path

import pytest

from limb_nodes.cli import main

PLAIN = ["--no-band-pass", "--no-low-pass"]


@pytest.mark.parametrize(
    ("step", "options", "part"),
    [
        (1e6, [], "lasts 3e+09 s at 1e-06 Hz; less than 2147483648 s"),
        (1e9, [], "lasts 3e+12 s at 1e-09 Hz; less than 2147483648 s"),
        (1e10, [], "lasts 3e+13 s"),
        (0.001, ["--rate", "1e-9"], "lasts 3e+12 s at 1e-09 Hz"),
        (0.001, ["--rate", "1e-300", "--no-times"], "lasts 3e+303 s at 1e-300 Hz"),
        (1e-7, [], "the times are 1e-07 s apart; 1e-06 s or more is needed, or a rate"),
        (1e-200, [], "the times are 1e-200 s apart; 1e-06 s or more is needed"),
        (5e-324, [], "s apart; 1e-06 s or more is needed"),
    ],
)
def test_times_that_no_recording_has(
    step: float, options: list[str], part: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "emg.csv"
    rows = [f"{row * step!r},{row * 7919 % 13 - 6}" for row in range(3000)]
    file.write_text("\n".join(["time (s),RF (mV)", *rows]), encoding="utf-8")
    out = tmp_path / "out"
    assert main(["emg", str(file), "--out", str(out), *PLAIN, *options]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert part in said
    assert not out.exists()


def test_a_step_of_many_days_is_a_step(tmp_path: Path) -> None:
    file = tmp_path / "emg.csv"
    rows = [f"{row * 1e6!r},{row * 7919 % 13 - 6}" for row in range(400)]
    file.write_text("\n".join(["time (s),RF (mV)", *rows]), encoding="utf-8")
    assert main(["emg", str(file), "--out", str(tmp_path / "out"), *PLAIN]) == 0


def test_a_duration_that_the_stamps_of_ros_do_not_hold(capsys: pytest.CaptureFixture[str]) -> None:
    limb = Path(__file__).resolve().parents[2] / "params" / "reference_joint.yaml"
    arguments = ["simulate", str(limb), "--activation", "flexor=0.9,extensor=0", "--rate", "0.01"]
    assert main([*arguments, "--duration", "1e10"]) == 2
    assert capsys.readouterr().err == "limb: error: --duration is 1e+10; at most 1e+09 in s is needed\n"
