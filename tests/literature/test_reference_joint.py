"""The reference joint of the report's section 3.3: figures 3.2 to 3.11, by number.

What must come out follows from mechanics, or from the model as `tests.independent` writes it down anew.
"""

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from limb_nodes.model import load_limb, with_values
from limb_nodes.solve.whole import WholeModel
from tests.independent.reference_joint import ABOUT_JOINT, ARM, COM, MASS, START, WEIGHT, equilibrium, pendulum, rates

PARAMS = Path(__file__).parents[2] / "params"
RATE = 1000.0


def limb(name: str, **values):
    return with_values(load_limb(PARAMS / f"{name}.yaml"), values)


def simulate(given, excitation, duration: float, rate: float = RATE):
    """Solve with excitations constant or given by a function of time."""
    time = np.arange(round(duration * rate) + 1) / rate
    columns = [e(time) if callable(e) else np.full(time.size, e) for e in excitation]
    return WholeModel(given).simulate(
        np.column_stack(columns) if columns else np.zeros((time.size, 0)), rate, tolerance=1e-11
    )


def frequency(time: np.ndarray, angle: np.ndarray) -> float:
    """From the falling zeros of the angle, each placed on a line between its neighbours."""
    at = np.flatnonzero((angle[:-1] > 0) & (angle[1:] <= 0))
    zeros = time[at] + (time[1] - time[0]) * angle[at] / (angle[at] - angle[at + 1])
    return (len(zeros) - 1) / (zeros[-1] - zeros[0])


class TestPendulum:
    """No muscle force: `muscles` empty."""

    @pytest.mark.parametrize(
        ("gravity", "load", "expected"),
        [(1.1, 0.0, 0.3397), (9.81, 0.0, 1.0143), (9.81, 200.0, 5.881)],
        ids=["fig_3_2", "fig_3_3", "fig_3_4"],
    )
    def test_frequency(self, gravity, load, expected):
        given = limb("reference_joint", muscles=[], gravity=[0.0, -gravity], tip_force=[0.0, -load])
        found = simulate(given, [], 30.0 if gravity < 2 else 10.0)
        measured = frequency(found.time, found.angle[:, 0])
        assert measured == pytest.approx(expected, rel=0.005)
        assert measured == pytest.approx(pendulum(gravity, load), rel=1e-4)
        # It swings about zero and back to where it started.
        assert found.angle.max() == pytest.approx(START, abs=1e-6)
        assert found.angle.min() == pytest.approx(-START, abs=1e-4)


def constant_force(force: dict[str, float], **more):
    """Muscles that pull with a constant force (N): 1e14 sarcomeres in parallel, fully active."""
    values = {"unit_kinds.slow.force_length": {"law": "constant"}, "unit_kinds.slow.maximum_passive_force": 0.0}
    names = ["flexor", "extensor"]
    for index, name in enumerate(names):
        values[f"muscles[{index}].units[0].sarcomere"] = {"law": "constant", "force": max(force[name], 1e-9) / 1e14}
    return with_values(limb("reference_joint"), {**values, **more})


class TestConstantForce:
    @pytest.mark.parametrize("side", [1.0, -1.0], ids=["fig_3_5", "fig_3_7"])
    def test_a_small_force_shifts_the_pendulum(self, side):
        names = {"flexor": 10.0 if side > 0 else 0.0, "extensor": 0.0 if side > 0 else 10.0}
        found = simulate(constant_force(names), [1.0, 1.0], 10.0)
        angle = found.angle[:, 0]
        rest = side * math.asin(10 * ARM / WEIGHT)
        assert rest == pytest.approx(side * 0.1, abs=0.002)
        # The turning points have the same energy: m g l cos(angle) + M angle.
        level = WEIGHT * math.cos(START) + side * 10 * ARM * START
        turn = (
            brentq(lambda a: WEIGHT * math.cos(a) + side * 10 * ARM * a - level, rest - 1.0 * side, rest)
            if side > 0
            else brentq(lambda a: WEIGHT * math.cos(a) - 10 * ARM * a - level, -1.5, rest)
        )
        assert angle.max() == pytest.approx(START, abs=1e-6)
        assert angle.min() == pytest.approx(turn, abs=1e-4)
        assert angle.mean() == pytest.approx(rest, abs=0.02)

    @pytest.mark.parametrize("side", [1.0, -1.0], ids=["fig_3_6", "fig_3_8"])
    def test_a_large_force_runs_away(self, side):
        names = {"flexor": 50.0 if side > 0 else 0.0, "extensor": 0.0 if side > 0 else 50.0}
        found = simulate(constant_force(names, gravity=[0.0, -1.1]), [1.0, 1.0], 2.0)
        assert (np.diff(side * found.velocity[:, 0]) > 0).all()
        assert side * found.angle[-1, 0] > 10
        # Kinetic energy is the work of muscle and gravity.
        work = side * 50 * ARM * (found.angle[:, 0] - START)
        work += MASS * 1.1 * COM * (np.cos(found.angle[:, 0]) - math.cos(START))
        np.testing.assert_allclose(0.5 * ABOUT_JOINT * found.velocity[:, 0] ** 2, work, rtol=1e-6, atol=1e-6)

    @pytest.mark.parametrize("side", [1.0, -1.0], ids=["fig_3_6", "fig_3_8"])
    def test_with_a_range_it_stops_at_the_limit_and_stays(self, side):
        names = {"flexor": 50.0 if side > 0 else 0.0, "extensor": 0.0 if side > 0 else 50.0}
        more = {"gravity": [0.0, -1.1], "segments[0].range": [-1.2, 1.2]}
        found = simulate(constant_force(names, **more), [1.0, 1.0], 2.0)
        angle, velocity = found.angle[:, 0], found.velocity[:, 0]
        first = int(np.argmax(np.abs(angle) >= 1.2))
        assert 0 < first < 1000
        assert np.array_equal(angle[first:], np.full(angle.size - first, side * 1.2))
        assert np.array_equal(velocity[first:], np.zeros(angle.size - first))
        assert np.array_equal(found.acceleration[first:, 0], np.zeros(angle.size - first))
        # Up to there it moves as without a range.
        free = simulate(constant_force(names, gravity=[0.0, -1.1]), [1.0, 1.0], 2.0)
        np.testing.assert_allclose(angle[:first], free.angle[:first, 0], atol=1e-9)
        assert np.abs(free.angle[first, 0]) >= 1.2 - 1e-9


def sine(t):
    return np.maximum(0.0, np.sin(2 * np.pi * t))


def cosine(t):
    return np.maximum(0.0, np.cos(2 * np.pi * t))


def test_fig_3_9_units_fire_from_their_threshold_on():
    found = simulate(limb("reference_joint"), [sine, cosine], 5.0)
    stimulation = found.unit["stimulation_frequency"]
    for column, signal in enumerate((sine(found.time), cosine(found.time))):
        fired = stimulation[:, column] > 0
        assert np.array_equal(fired, signal >= 0.8)
        assert 0.1 < fired.mean() < 0.3
        assert stimulation[fired, column].min() >= 5.0
        assert stimulation[fired, column].max() <= 15.0 + 1e-12
        np.testing.assert_allclose(stimulation[fired, column], 5 + 10 * (signal[fired] - 0.8) / 0.2)


def test_fig_3_9_movement_is_that_of_the_equations_written_anew():
    rate, duration = 1000.0, 0.6
    found = simulate(limb("reference_joint"), [sine, cosine], duration, rate)
    time = found.time
    # The drives are linear between samples; here the activation is, which differs by the sigmoid's bend over 1 ms.
    signals = sine(time), cosine(time)
    anew = rates(lambda t: [np.interp(t, time, signal) for signal in signals])
    expected = solve_ivp(anew, (0, duration), [START, 0.0], t_eval=time, rtol=1e-9, atol=1e-11, max_step=2e-3)
    np.testing.assert_allclose(found.angle[:, 0], expected.y[0], atol=2e-5)


@pytest.mark.parametrize(
    ("tendons", "angle", "torque"), [(False, 0.2262, 0.481), (True, 0.3962, 0.828)], ids=["fig_3_10", "fig_3_11"]
)
class TestHeldFlexor:
    """U = 0.9 in the flexor, 0 in the extensor, from 30 degrees at -2 rad/s."""

    def found(self, tendons: bool, duration: float):
        values = {"segments[0].velocity": -2.0}
        if tendons:
            values |= {"muscles[0].tendon.length": 0.05, "muscles[1].tendon.length": 0.05}
        return simulate(
            limb("reference_joint_tendon" if tendons else "reference_joint", **values), [0.9, 0.0], duration
        )

    def test_settles_where_the_flexor_holds_the_weight(self, tendons, angle, torque):
        found = self.found(tendons, 60.0)
        expected, tendon = equilibrium((0.9, 0.0), tendons)
        moment = WEIGHT * math.sin(expected)
        assert expected == pytest.approx(angle, abs=1e-4)
        assert moment == pytest.approx(torque, abs=5e-4)
        # It falls, turns and settles.
        assert found.velocity[0, 0] == -2.0
        assert found.angle[:, 0].min() < angle - 0.05
        assert found.angle[-1, 0] == pytest.approx(expected, abs=1e-4)
        assert abs(found.velocity[-1, 0]) < 1e-4
        assert found.muscle["muscle_torque"][-1].sum() == pytest.approx(moment, abs=1e-4)
        if tendons:
            assert tendon == pytest.approx([0.0304, 0.0300], abs=5e-5)
            np.testing.assert_allclose(found.muscle["tendon_length"][0], 0.05)
            np.testing.assert_allclose(found.muscle["tendon_length"][-1], tendon, atol=1e-6)

    def test_moves_as_the_equations_written_anew(self, tendons, angle, torque):
        found = self.found(tendons, 1.0)
        start = [START, -2.0, *([0.05, 0.05] if tendons else [])]
        anew = rates(lambda _: (0.9, 0.0), tendons)
        expected = solve_ivp(anew, (0, 1.0), start, t_eval=found.time, rtol=1e-9, atol=1e-12, max_step=5e-3)
        np.testing.assert_allclose(found.angle[:, 0], expected.y[0], atol=1e-6)
        np.testing.assert_allclose(found.velocity[:, 0], expected.y[1], atol=1e-5)
        if tendons:
            np.testing.assert_allclose(found.muscle["tendon_length"], expected.y[2:].T, atol=1e-7)
