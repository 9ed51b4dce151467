"""Looking at the muscles of a run changes nothing of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from limb_nodes.exchange.muscles import MusclePart
from limb_nodes.exchange.ticks import Ticks
from limb_nodes.model import load_limb

PARAMS = Path(__file__).resolve().parents[2] / "params"


@pytest.mark.parametrize("name", ["arm", "pennate_leg", "reference_joint_tendon"])
def test_what_the_next_tick_depends_on_stays(name):
    part = MusclePart(load_limb(PARAMS / f"{name}.yaml"), Ticks(1000.0))
    before = part.stepper.remembered
    part.angle, part.velocity, part.excitation = part.angle + 0.4, part.velocity + 0.3, part.excitation + 0.5
    first = part.muscles()
    np.testing.assert_array_equal(part.stepper.remembered, before)
    np.testing.assert_array_equal(part.muscles(), first)
    assert np.isfinite(first).all()
