"""The table of the drives gives what the laws give."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from limb_nodes.levels.motor_unit.recruitment import unit_thresholds
from limb_nodes.model import load_limb, with_values
from limb_nodes.model.shipped import shipped
from limb_nodes.solve.whole import TABLE_PAYS, WholeModel

LIMBS = ["reference_joint", "reference_joint_tendon", "seated_knee", "arm", "pennate_leg"]
ROOT = Path(__file__).resolve().parents[2]


def by_law(model: WholeModel, excitation: np.ndarray) -> np.ndarray:
    """The drives by the laws themselves: short inputs use no table."""
    parts = np.array_split(excitation, -(-len(excitation) // (TABLE_PAYS // 2)))
    return np.concatenate([model.drives(part) for part in parts])


def thresholds(model: WholeModel, muscles: int) -> np.ndarray:
    """Excitations at, just below and just above every threshold of the limb."""
    values = sorted(
        value
        for muscle in model.limb.muscles
        for value in unit_thresholds([unit.values["pcsa"] for unit in muscle.units], muscle.activation_threshold)
    )
    near = [place for value in values for place in (np.nextafter(value, 0.0), value, np.nextafter(value, 1.0))]
    return np.repeat(np.array(near)[:, np.newaxis], muscles, axis=1)


def inputs(model: WholeModel) -> np.ndarray:
    """Excitations everywhere in the range, at its ends, at thresholds and beside them."""
    muscles = model.layout.muscles
    anywhere = np.random.default_rng(5).random((TABLE_PAYS, muscles))
    ends = np.repeat([[0.0], [1.0], [0.0], [5e-324], [1.0 - 1e-16]], muscles, axis=1)
    return np.concatenate([anywhere, ends, thresholds(model, muscles)])


@pytest.mark.parametrize("name", LIMBS)
def test_shipped_limbs(name):
    model = WholeModel(load_limb(shipped(f"{name}.yaml")))
    given = inputs(model)
    np.testing.assert_allclose(model.drives(given), by_law(model, given), rtol=0, atol=2e-12)


def test_every_alternative_at_once():
    model = WholeModel(load_limb(ROOT / "tests/levels/alternatives.yaml"))
    given = inputs(model)
    np.testing.assert_allclose(model.drives(given), by_law(model, given), rtol=0, atol=1e-11)


def test_two_hundred_units():
    limb = load_limb(shipped("reference_joint_tendon.yaml"))
    changes = {}
    for m, muscle in enumerate(limb.muscles):
        place = f"muscles[{m}].units[0]"
        changes[f"{place}.count"] = 200
        for name in ("parallel_sarcomeres", "maximum_passive_force", "pcsa"):
            changes[f"{place}.{name}"] = muscle.units[0].values[name] / 200
    model = WholeModel(with_values(limb, changes))
    given = inputs(model)
    assert len(np.unique(thresholds(model, 1))) > 500
    np.testing.assert_allclose(model.drives(given), by_law(model, given), rtol=0, atol=1e-11)


LAW = """
import math
from limb_nodes.levels import law

@law("force_frequency")
def crooked(frequency_norm):
    '''A law with an infinite slope, and waves too fast for any polynomial.'''
    return math.sqrt(frequency_norm) * (1.0 + 1e-3 * math.sin(1e6 * frequency_norm * (1.0 - frequency_norm)))
"""


def test_a_law_that_no_polynomial_follows(tmp_path):
    text = shipped("reference_joint.yaml").read_text()
    start, end = text.index("    force_frequency:"), text.index("    passive_force:")
    (tmp_path / "crooked_law.py").write_text(LAW)
    (tmp_path / "limb.yaml").write_text(text[:start] + "    force_frequency: crooked_law:crooked\n" + text[end:])
    model = WholeModel(load_limb(tmp_path / "limb.yaml", allow_laws=True))
    given = inputs(model)
    np.testing.assert_allclose(model.drives(given), by_law(model, given), rtol=0, atol=2e-12)


def test_one_solve_makes_no_table():
    limb = load_limb(shipped("reference_joint_tendon.yaml"))
    often, once = WholeModel(limb), WholeModel(limb, once=True)
    given = inputs(once)
    np.testing.assert_array_equal(once.drives(given), by_law(often, given))
    rate, excitation = 1000.0, np.clip(np.sin(np.arange(2 * TABLE_PAYS) / 300.0)[:, np.newaxis] * [1.0, -1.0], 0.0, 1.0)
    one, other = (model.simulate(excitation, rate, observe=False).angle for model in (often, once))
    np.testing.assert_allclose(one, other, rtol=0, atol=1e-6)
    assert "drive_table" in vars(often)
    assert "drive_table" not in vars(once)
