"""Text files by mutation of good ones; `python -m tests.signals.text_fuzz 5000` checks more of them."""

from __future__ import annotations

import resource
from pathlib import Path

import pytest

from limb_nodes.signals.recording import read_recording
from tests.signals.text_fuzz import GOOD, LONGEST, MOST_MEMORY, check, mutated, wrong_numbers

FILES = 300
STEP = 50


@pytest.mark.parametrize("name", GOOD)
def test_good_files_are_read(name: str, tmp_path: Path) -> None:
    file = tmp_path / "file.csv"
    file.write_bytes(GOOD[name].encode())
    recording = read_recording(file)
    assert recording.values.shape == (60, 2)
    assert recording.rate == (250.0 if name == "openbci" else 1000.0)
    assert wrong_numbers(recording, GOOD[name].encode()) == []
    # The check itself sees a number that is another one.
    recording.values[30, 1] += 1e-9
    assert wrong_numbers(recording, GOOD[name].encode()) == [recording.names[1]]


@pytest.mark.parametrize("first", range(0, FILES, STEP))
def test_mutated_files_are_read_right_or_refused_in_a_line(first: int, tmp_path: Path) -> None:
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    accepted = sum(check(seed, tmp_path / "file.csv")[0] for seed in range(first, first + STEP))
    assert 0 < accepted < STEP
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < MOST_MEMORY
    assert LONGEST <= 2.0
    assert mutated(first) == mutated(first)
