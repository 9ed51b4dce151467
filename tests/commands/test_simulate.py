"""`limb simulate`: in parts, and with what was solved kept if it cannot go on."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from limb_nodes.bags.read import BagReader
from limb_nodes.cli import main
from limb_nodes.model import load_limb
from limb_nodes.signals.activation import load_activation
from limb_nodes.solve import whole
from limb_nodes.solve.whole import WholeModel
from tests.solve.broken_limb import write_broken_limb

LIMB, WAVES = "params/reference_joint.yaml", "params/activation_sine_cosine.yaml"
# The peak of the memory of a process (MB) that simulates and records.
PEAK = """
import sys
from limb_nodes.cli import main

assert main(sys.argv[1:]) == 0
print(next(int(line.split()[1]) // 1024 for line in open("/proc/self/status") if line.startswith("VmHWM")))
"""


def test_a_bag_in_parts_is_that_of_the_whole_solve(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(whole, "LONGEST_PART", 150)
    assert main(["simulate", LIMB, "--activation", WAVES, "--duration", "1", "--out", str(tmp_path / "run")]) == 0
    limb = load_limb(LIMB)
    expected = WholeModel(limb).simulate(load_activation(WAVES, limb.muscle_names, 1000.0, 1.0).values, 1000.0)
    with BagReader(tmp_path / "run") as bag:
        movement, muscles, drive = (bag.table(topic) for topic in ("movement_pattern", "muscle_state", "activation"))
    np.testing.assert_array_equal(movement["angle"], expected.angle)
    np.testing.assert_array_equal(movement["acceleration"], expected.acceleration)
    np.testing.assert_array_equal(muscles["muscle_force"], expected.muscle["muscle_force"])
    np.testing.assert_array_equal(movement["tick"], np.arange(1001))
    np.testing.assert_array_equal(movement["stamp"], np.arange(1001) * 1_000_000)
    assert (drive["last_tick"] == 1000).all()


def test_memory_does_not_grow_with_the_duration(tmp_path: Path) -> None:
    def peak(duration: int) -> int:
        out = ["--out", str(tmp_path / f"run{duration}")]
        arguments = ["simulate", LIMB, "--activation", WAVES, "--duration", str(duration), *out]
        done = subprocess.run([sys.executable, "-c", PEAK, *arguments], capture_output=True, text=True, check=True)
        return int(done.stdout.splitlines()[-1])

    # At 1 kHz a minute took 130 MB as a whole.
    assert peak(60) < peak(5) + 40


def test_what_was_solved_before_a_failure_is_kept_and_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    limb = write_broken_limb(tmp_path, 1.24)
    given = [str(limb), "--activation", "flexor=0.9,extensor=0", "--duration", "2", "--allow-laws"]
    assert main(["simulate", *given, "--out", str(tmp_path / "run")]) == 1
    told = capsys.readouterr()
    (line,) = told.err.splitlines()
    assert line.startswith(f"limb: error: {limb}: the solution stops at 0.")
    assert "muscle flexor, unit unit, law breaks_off:breaks_off of force_length: force_length_factor is nan" in line
    with BagReader(tmp_path / "run") as bag:
        movement, units = bag.table("movement_pattern"), bag.table("motor_unit_state")
    assert f"solved     {movement['time'][-1]:g} s" in told.out
    assert 0.0 < movement["time"][-1] < 1.0
    assert all(np.isfinite(values).all() for values in (movement["angle"], units["force_length_factor"]))
    assert f"bag        {tmp_path / 'run'}" in told.out
