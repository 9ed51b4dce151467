"""Level of the sarcomere: lengths, energetics and the force-velocity law."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from limb_nodes.levels.sarcomere import derenyi_vicsek as dv
from limb_nodes.levels.sarcomere import lengths
from tests.independent.reference_joint import force_velocity

# Rabbit psoas, report 2.1.2.
PSOAS = {"power_stroke": 11e-9, "binding_site_spacing": 45e-9, "attachment_force": 4e-12}
MAXIMUM_FORCE = 9.7778e-13
MAXIMUM_VELOCITY = 2.29817e-6


def maximum_velocity(adp: float = 0.0, adp_binding_rate: float = 0.0, atp: float = 3e-3) -> float:
    inhibition = dv.adp_inhibition_constant(230.0, adp_binding_rate)
    michaelis = dv.michaelis_constant(dv.unhindered_michaelis_constant(230.0, 0.76e6), adp, inhibition)
    return dv.maximum_sarcomere_velocity(dv.saturated_velocity(4e-12, 4e-12, 11e-9, 230.0), atp, michaelis)


def relative_force(velocity: float, elasticity: float = 3 / 11, plateau: float = 1.4) -> float:
    """Force over isometric force at a velocity in units of 1.15 V_max."""
    return dv.sarcomere_force(velocity, 1.0, elasticity, 1.0, plateau)


def test_lengths():
    assert lengths.optimal_sarcomere_length(1.35e-6) == pytest.approx(2.7e-6)
    assert lengths.maximum_sarcomere_length(1.6e-6, 1.35e-6) == pytest.approx(4.3e-6)
    assert lengths.minimum_sarcomere_length(1.6e-6) == pytest.approx(1.44e-6)


def test_isometric_force():
    assert dv.maximum_sarcomere_force(**PSOAS, bound_probability=1.0) == pytest.approx(MAXIMUM_FORCE, rel=1e-5)


def test_phosphate_unbinds_heads():
    assert dv.bound_probability(76.0, 3100.0, 0.0) == 1.0
    # 3100/(M s) of 12 mM are 37.2/s against 76/s.
    assert dv.bound_probability(76.0, 3100.0, 12e-3) == pytest.approx(76 / 113.2)


def test_greatest_velocity():
    assert maximum_velocity() == pytest.approx(MAXIMUM_VELOCITY, rel=1e-5)
    assert maximum_velocity(atp=1e9) == pytest.approx(11e-9 * 230, rel=1e-9)


def test_adp_slows():
    # K_m = 230/0.76e6 (1 + 0.8e-3 * 3.5e5 / 230) = 6.71053e-4 M.
    assert maximum_velocity(0.8e-3, 3.5e5) == pytest.approx(2.53e-6 * 3 / 3.671053, rel=1e-6)
    assert maximum_velocity(0.8e-3, 0.0) == maximum_velocity()


@pytest.mark.parametrize(
    ("velocity", "force"),
    [(0.1, 0.6690), (0.3, 0.2693), (0.5, 0.1274), (1.0, -0.0003), (0.0, 1.0), (-0.1, 1.1520)],
)
def test_force_at_velocity(velocity, force):
    """Velocity in units of V_max, force of the isometric one, to the digits that are printed."""
    norm = dv.sarcomere_velocity_norm(velocity * MAXIMUM_VELOCITY, MAXIMUM_VELOCITY)
    assert norm == pytest.approx(velocity / 1.15)
    assert relative_force(norm) == pytest.approx(force, abs=0.5e-4)


# Debye length over power stroke; from 2 on, 2.12 itself rises again far beyond the greatest velocity.
elasticities = st.floats(0.01, 1.9)
plateaus = st.floats(1.05, 3.0)


@given(elasticities, plateaus)
def test_value_and_slope_are_continuous_at_zero(elasticity, plateau):
    slope = -(1 + elasticity / 0.15)
    # So close to zero, exp(-0.15/v) is 0 and the bend of the hyperbola below the tolerance.
    step = 1e-9
    assert relative_force(0.0, elasticity, plateau) == 1.0
    for side in (step, -step):
        assert (relative_force(side, elasticity, plateau) - 1) / side == pytest.approx(slope, rel=1e-5)


@given(st.floats(-20.0, 1.5), st.floats(1e-6, 0.5), elasticities, plateaus)
def test_force_falls_with_shortening_velocity(velocity, more, elasticity, plateau):
    assert relative_force(velocity + more, elasticity, plateau) < relative_force(velocity, elasticity, plateau)


@given(st.floats(0.0, 1e6), elasticities, plateaus)
def test_lengthening_stays_below_the_plateau(velocity, elasticity, plateau):
    assert 1.0 <= relative_force(-velocity, elasticity, plateau) <= plateau
    assert relative_force(-1e9, elasticity, plateau) == pytest.approx(plateau, rel=1e-6)


@given(st.floats(-20.0, 1.2), elasticities, plateaus)
def test_force_follows_the_formula_as_printed(velocity, elasticity, plateau):
    printed = force_velocity(velocity, elasticity, plateau)
    assert relative_force(velocity, elasticity, plateau) == pytest.approx(printed, rel=1e-9, abs=1e-12)
