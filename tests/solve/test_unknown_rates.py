"""A rate that is no finite number where only the record of a movement looks ends the movement there, and says so."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from limb_nodes.model import load_limb
from limb_nodes.solve.failure import SolveError
from limb_nodes.solve.whole import WholeModel
from tests.solve.broken_limb import write_broken_limb


def test_a_movement_ends_before_the_first_rate_that_is_no_number(tmp_path: Path) -> None:
    """A law that gives NaN in a gap that the steps pass over, and a sample between them does not."""
    given, unit = np.tile([0.9, 0.0], (401, 1)), "fibre_length_norm"
    (tmp_path / "sound").mkdir()
    sound = WholeModel(load_limb(write_broken_limb(tmp_path / "sound", edge=9.0), allow_laws=True))
    wanted = sound.simulate(given, 1000.0)
    gap = float(wanted.unit[unit][200, 0])
    (tmp_path / "broken").mkdir()
    broken = load_limb(write_broken_limb(tmp_path / "broken", edge=gap - 1e-9, width=2e-9), allow_laws=True)
    parts = []
    with pytest.raises(SolveError, match=r": the solution stops at 0\.2 s: a rate is not a finite number"):
        for part in WholeModel(broken).simulate_in_parts(given, 1000.0):
            parts.append(part)
    (part,) = parts
    assert len(part.acceleration) == len(part.time) == len(part.muscle["muscle_force"]) == 200
    np.testing.assert_array_equal(part.angle, wanted.angle[:200])
