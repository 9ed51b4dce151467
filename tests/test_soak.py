"""`python -m tests.soak` looks at a run in four processes, and notices what grows."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from limb_nodes.foundation.topics import NODES
from limb_nodes.nodes.settings import Outcome
from tests.soak import GAIN, Look, faults

ROOT = Path(__file__).resolve().parents[1]


def test_a_short_run_is_looked_at_and_is_well(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "tests.soak", "--duration", "20", "--folder", str(tmp_path)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    lines = done.stdout.splitlines()
    assert (done.returncode, lines[-1]) == (0, "nothing grows, nothing is missing"), done.stdout + done.stderr
    assert lines[-2].startswith("20001 ticks in ")
    assert lines[-2].endswith(" 0 missing")
    for name in ("limb run", "activation_input", "muscle_stack", "limb_dynamics", "recorder"):
        assert f"{name} MB, files" in lines[0]
    assert list(tmp_path.iterdir()) == []


MEMORY, FILES = dict.fromkeys(NODES, 100.0), dict.fromkeys(NODES, 19)
WELL = [Look(tick, float(tick), 0.1, MEMORY, FILES, 1.0) for tick in range(8)]
DONE = Outcome(8, 0, 0, 0, 0, 0, 8.0, False)


@pytest.mark.parametrize(
    ("last", "outcome", "words"),
    [
        ({}, DONE, None),
        ({"memory": {**MEMORY, "recorder": 100.0 + GAIN + 1.0}}, DONE, "recorder has grown from 100.0 to 109.0 MB"),
        ({"files": {**FILES, "recorder": 20}}, DONE, "recorder has 20 files open, 19 before"),
        ({}, replace(DONE, missing=3), "0 ticks and 3 messages of others are missing"),
        ({}, replace(DONE, ticks=6), "2 ticks and 0 messages of others are missing"),
    ],
)
def test_what_is_not_as_it_should_be_is_said(last, outcome, words) -> None:
    assert faults([*WELL[:-1], replace(WELL[-1], **last)], outcome, 8) == ([words] if words else [])
