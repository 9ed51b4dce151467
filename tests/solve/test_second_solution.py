"""Random limbs against a second solution that shares no code with this one."""

from __future__ import annotations

import numpy as np
import pytest

from limb_nodes.model import parse_limb
from limb_nodes.solve.whole import WholeModel
from tests.independent.random_limb import RandomLimb

RATE, DURATION = 1000.0, 0.6


def difference(seed: int) -> tuple[float, RandomLimb]:
    """The largest difference of an angle (rad)."""
    other = RandomLimb(seed)
    limb = parse_limb(other.yaml(), "random.yaml")
    found = WholeModel(limb).simulate(other.excitation(RATE, DURATION), RATE)
    expected = other.solve(found.time)
    assert expected is not None
    return float(np.abs(found.angle - expected).max()), other


@pytest.mark.parametrize("seed", range(8))
def test_angles_are_those_of_the_second_solution(seed):
    apart, _ = difference(seed)
    assert apart < 1e-6
