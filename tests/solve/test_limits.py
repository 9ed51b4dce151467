"""Joint ranges of a limb with muscles, and solves that cannot go on."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from limb_nodes.model import parse_limb
from limb_nodes.solve.failure import SolveError
from limb_nodes.solve.limits import crossing
from limb_nodes.solve.pieces import pieces
from limb_nodes.solve.whole import WholeModel

RATE = 1000.0


def pulse(time: np.ndarray) -> np.ndarray:
    """The flexor pulls for half a second, then nobody does [T, 2]."""
    return np.column_stack([np.where(time < 0.5, 1.0, 0.0), np.zeros(time.size)])


@pytest.fixture(scope="module")
def found(model_named):
    model = model_named("reference_joint", {"segments[0].range": [-2.0, 0.6]})
    return model.simulate(pulse(np.arange(1501) / RATE), RATE, method="explicit", tolerance=1e-11)


class TestLimit:
    """The reference joint against a limit at 0.6 rad."""

    def test_it_stops_and_stays_while_it_is_pressed(self, found):
        angle, velocity = found.angle[:, 0], found.velocity[:, 0]
        first = int(np.argmax(angle == 0.6))
        assert 0 < first < 400
        assert (angle <= 0.6).all()
        assert (angle[first:500] == 0.6).all()
        assert (velocity[first:500] == 0.0).all()
        assert (found.acceleration[first:500] == 0.0).all()
        assert found.velocity[first - 1, 0] > 0.1

    def test_it_leaves_when_it_is_pulled_back(self, found, model_named):
        """From the instant at which the torque changes its sign, as the free limb does from rest there."""
        last = int(np.flatnonzero(found.angle[:, 0] == 0.6)[-1])
        assert last == 499
        rest = model_named("reference_joint", {"segments[0].angle": 0.6})
        # The flexor's force sinks to nothing within the last millisecond of the pulse.
        u = pulse(np.arange(1501) / RATE)
        torque = {t: rest.simulate(u[t : t + 2], RATE).acceleration[0, 0] for t in (499, 500)}
        assert torque[499] > 0 > torque[500]
        free = rest.simulate(np.zeros((601, 2)), RATE, method="explicit", tolerance=1e-11)
        gap = found.angle[500:1101, 0] - free.angle[:, 0]
        # The two start less than a millisecond apart.
        assert np.abs(gap).max() < 1e-3 * np.abs(free.velocity).max() + 1e-9
        assert found.angle[1100, 0] < 0.0

    def test_instant_of_the_impact(self, found, model_named):
        """By scipy's event location, on the free limb."""
        model = model_named("reference_joint")
        rates = model.right_hand_side(pieces(model.drives(np.full((2, 2), [1.0, 0.0]))), 1.0)

        def touch(t, y):
            return y[0] - 0.6

        touch.terminal = True
        solved = solve_ivp(rates, (0, 1), model.initial_state(), "DOP853", events=touch, rtol=1e-12, atol=1e-13)
        instant = solved.t_events[0][0]
        before = int(instant * RATE)
        assert np.flatnonzero(found.angle[:, 0] == 0.6)[0] == before + 1
        reached = solve_ivp(rates, (0, before / RATE), model.initial_state(), "DOP853", rtol=1e-12, atol=1e-13)
        assert found.angle[before, 0] == pytest.approx(reached.y[0, -1], abs=1e-8)

    @pytest.mark.parametrize("method", ["explicit", "implicit"])
    def test_instant_of_the_release(self, method, model_named):
        """By scipy's root of the torque at rest on the limit, and its free limb from there."""
        time = np.arange(1201) / RATE
        excitation = np.column_stack([np.clip(1.0 - time, 0.0, 1.0), np.zeros(time.size)])
        held = {"segments[0].range": [-2.0, 0.6], "segments[0].angle": 0.6}
        found = model_named("reference_joint", held).simulate(excitation, RATE, method=method, tolerance=1e-11)
        model = model_named("reference_joint")
        rates = model.right_hand_side(pieces(model.drives(excitation)), 1.0 / RATE)

        instant = brentq(lambda t: rates(t, np.array([0.6, 0.0]))[1], 0.01, 0.99, xtol=1e-13)
        last = int(instant * RATE)
        assert (found.angle[: last + 1, 0] == 0.6).all()
        after = time[last + 1 :]
        free = solve_ivp(rates, (instant, after[-1]), [0.6, 0.0], "DOP853", t_eval=after, rtol=1e-12, atol=1e-13)
        np.testing.assert_allclose(found.angle[last + 1 :, 0], free.y[0], rtol=0, atol=1e-8)

    def test_a_start_on_the_limit(self, model_named):
        still = np.zeros((301, 2))
        held = {"segments[0].range": [0.3, 1.0], "segments[0].angle": 0.3}
        found = model_named("reference_joint", held).simulate(still, RATE, method="explicit")
        assert (found.angle == 0.3).all()
        falling = {"segments[0].range": [-1.0, 0.3], "segments[0].angle": 0.3}
        found = model_named("reference_joint", falling).simulate(still, RATE, method="explicit")
        free = model_named("reference_joint", {"segments[0].angle": 0.3}).simulate(still, RATE, method="explicit")
        np.testing.assert_allclose(found.angle, free.angle, atol=1e-9)
        np.testing.assert_allclose(found.acceleration[1:], free.acceleration[1:], atol=1e-6)
        thrown = {**held, "segments[0].velocity": -3.0}
        found = model_named("reference_joint", thrown).simulate(still, RATE, method="explicit")
        assert (found.angle == 0.3).all()
        assert (found.velocity[1:] == 0.0).all()

    def test_explicit_and_implicit_meet_the_same_limits(self, model_named, waves):
        model = model_named("reference_joint_tendon", {"segments[0].range": [-0.1, 0.25], "segments[0].angle": 0.1})
        excitation = waves(np.arange(1501) / RATE, 2)
        one, two = (model.simulate(excitation, RATE, method=method) for method in ("explicit", "implicit"))
        assert (one.angle == -0.1).any() or (one.angle == 0.25).any()
        np.testing.assert_allclose(one.angle, two.angle, rtol=0, atol=1e-6)


@given(st.tuples(*[st.floats(-3.0, 3.0)] * 3), st.floats(0.05, 0.95), st.floats(0.1, 10.0), st.floats(0.0, 5.0))
def test_a_cubic_is_crossed_at_its_root(shape, root, width, start):
    """Cubics with one root between the ends: a factor that rises through it, times one that is never negative."""
    a, b, c = shape

    def gap(x):
        return (x - root) * (0.1 + (a * x + b) ** 2 + c * c)

    def slope(x):
        return 0.1 + (a * x + b) ** 2 + c * c + (x - root) * 2.0 * a * (a * x + b)

    ends = (0.0, 1.0)
    (low, low_speed), (high, high_speed) = ((gap(x), slope(x) / width) for x in ends)
    found = crossing.py_func(start, low, low_speed, start + width, high, high_speed)
    assert found == pytest.approx(start + root * width, abs=1e-9 * (1.0 + start + width))


@pytest.mark.parametrize("name", ["reference_joint", "reference_joint_tendon"])
@pytest.mark.parametrize("muscle", [0, 1])
def test_an_excitation_that_is_not_a_number_ends_the_solve(name, muscle, model_named):
    excitation = np.full((101, 2), 0.9)
    excitation[40:, muscle] = np.nan
    with pytest.raises(SolveError, match=r"yaml: the solution stops at 0\.03\d* s: a rate is not"):
        model_named(name).simulate(excitation, RATE, method="explicit")


def test_a_load_beyond_all_measure_ends_the_solve(model_named):
    model = model_named("reference_joint", {"tip_force": [1e300, 1e300]})
    with pytest.raises(SolveError, match="the solution stops at"):
        model.simulate(np.zeros((11, 2)), RATE, method="explicit")


@pytest.mark.parametrize("width", [1e-3, 1e-5, 1e-7, 1e-9])
def test_a_joint_may_have_hardly_any_room(width):
    """A fixation: the movement stays within the range, and the limb is solved in few steps."""
    text = Path("params/seated_knee.yaml").read_text()
    assert "range: [0.0, 1.75]" in text
    limb = parse_limb(text.replace("range: [0.0, 1.75]", f"range: [1.5708, {1.5708 + width:.12f}]"), "knee.yaml")
    pulled = 0.3 + 0.3 * np.sin(np.arange(401) / 30.0)
    found = WholeModel(limb).simulate(np.stack([pulled, pulled, 0.6 - pulled, 0.6 - pulled], axis=1), 200.0)
    assert found.angle.min() >= 1.5708 - 1e-12
    assert 0.1 * width < np.ptp(found.angle) <= width + 1e-12
    assert sum(found.steps) < 3000
