"""Limb files that something has happened to: some of what `python -m tests.faults limb_files` tries."""

from __future__ import annotations

from tests.faults.limb_files import trials


def test_a_mutated_limb_is_refused_in_one_line_or_can_be_solved() -> None:
    bad = [trial for trial in trials(120, 7) if not trial.good]
    assert bad == []
