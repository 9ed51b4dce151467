"""A few of the messages of strangers of `python -m tests.faults strangers`, to real nodes."""

from __future__ import annotations

import pytest

from tests.faults import strangers


@pytest.mark.parametrize("number", [9, 17, 29, 57, 66, 121])
def test_a_stranger_changes_nothing_unsaid(number):
    (trial,) = strangers.trials(1, number)
    assert trial.good, trial
