"""A few of the mutated limb files of `python -m tests.faults limb_files`."""

from __future__ import annotations

from tests.faults import limb_files


def test_a_few_mutated_files_are_refused_in_a_line_or_solved():
    assert [trial for trial in limb_files.trials(60, 1) if not trial.good] == []
