"""A rate that is no finite number where only the record of a movement looks ends the movement there, and says so."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from limb_nodes.model import load_limb
from limb_nodes.model.load import with_values
from limb_nodes.solve.failure import SolveError
from limb_nodes.solve.whole import WholeModel

PARAMS = Path(__file__).resolve().parents[2] / "params"


def test_a_movement_ends_before_the_first_rate_that_is_no_number() -> None:
    limb = load_limb(PARAMS / "pennate_leg.yaml")
    soleus = next(i for i, muscle in enumerate(limb.muscles) if muscle.laws["tendon"].values["slack_length"] == 0.326)
    values = {f"muscles[{soleus}].tendon.damping": 4.0661252042315147e-13, "segments[0].mass": 0.00023649882831197044}
    model = WholeModel(with_values(limb, values), once=True)
    parts = []
    with pytest.raises(SolveError, match=r": the solution stops at 0\.001 s: a rate is not a finite number"):
        for part in model.simulate_in_parts(np.full((6, model.layout.muscles), 0.5), 1000.0):
            parts.append(part)
    (part,) = parts
    assert len(part.acceleration) == len(part.time) == len(part.muscle["muscle_force"]) == 1
    assert np.isfinite(part.acceleration).all()
