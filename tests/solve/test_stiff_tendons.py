"""Tendons and aponeuroses that hardly damp: their length follows force and load at once."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from limb_nodes.solve.pieces import bent, pieces
from limb_nodes.solve.whole import WholeModel
from tests.independent import reference_joint
from tests.solve.test_stepping import run

RATE = 1000.0


def damped(limb_named, name: str, damping: float, viscosity: float | None = None):
    """A limb of params/ whose dampers are as weak as that (N s/m)."""
    limb = limb_named(name)
    values = {f"muscles[{m}].tendon.damping": damping for m in range(len(limb.muscles))}
    for m, muscle in enumerate(limb.muscles):
        if viscosity is not None and muscle.laws["aponeurosis"].law.name != "none":
            values[f"muscles[{m}].aponeurosis.viscosity"] = viscosity
    return limb_named(name, values)


def bursts(muscles: int, seconds: float) -> np.ndarray:
    """Muscles that are switched on and off again and again [T, muscles]."""
    time = np.arange(round(seconds * RATE) + 1)[:, np.newaxis] / RATE
    return (time * np.linspace(3.0, 4.0, muscles) % 1.0 > 0.5).astype(float)


@pytest.mark.parametrize("damping", [1.0, 1e-2])
def test_an_independent_solution(damping, limb_named, monkeypatch):
    """The reference joint, its flexor pulling, by scipy's Radau method on equations written on their own."""
    monkeypatch.setattr(reference_joint, "DAMPING", damping)
    time, start = np.linspace(0.0, 0.5, 501), [reference_joint.START, 0.0, 0.03, 0.03]
    slopes = reference_joint.rates(lambda _: (0.95, 0.0), tendons=True)
    wanted = solve_ivp(slopes, (0.0, 0.5), start, "Radau", t_eval=time, rtol=1e-10, atol=1e-13)
    model = WholeModel(damped(limb_named, "reference_joint_tendon", damping))
    found = model.simulate(np.tile([0.95, 0.0], (501, 1)), RATE, observe=False)
    assert np.ptp(found.angle) > 0.05
    np.testing.assert_allclose(found.angle[:, 0], wanted.y[0], rtol=0, atol=1e-7)
    np.testing.assert_allclose(found.internal, wanted.y[2:].T, rtol=0, atol=1e-8)


@pytest.mark.parametrize(
    ("name", "damping", "viscosity", "error", "most_steps"),
    [
        ("seated_knee", 1e-2, None, 1e-6, 30_000),
        ("seated_knee", 1e-4, None, 1e-6, 30_000),
        ("seated_knee", 1e-6, None, 1e-5, 500_000),
        ("pennate_leg", 1e2, 1e-4, 1e-6, 60_000),
        ("pennate_leg", 1e-4, 1e-4, 1e-6, 60_000),
    ],
)
def test_muscles_that_begin_and_cease_to_pull(name, damping, viscosity, error, most_steps, limb_named):
    """The default tolerance against a tighter one: a slack tendon is slowed a million times when its muscle begins."""
    limb = damped(limb_named, name, damping, viscosity)
    model, given = WholeModel(limb), bursts(len(limb.muscles), 1.0)
    assert model.suited_method == "implicit"
    found = model.simulate(given, RATE, observe=False)
    tight = model.simulate(given, RATE, tolerance=1e-10, observe=False)
    assert np.ptp(found.angle) > 0.1
    assert np.abs(found.angle - tight.angle).max() < error
    assert sum(found.steps) < most_steps


def test_the_movement_has_a_limit(limb_named):
    """Less and less damping changes less and less."""
    given = bursts(4, 0.6)
    movements = [
        WholeModel(damped(limb_named, "seated_knee", damping)).simulate(given, RATE, observe=False).angle
        for damping in (1.0, 1e-1, 1e-2, 1e-3, 1e-4)
    ]
    changes = [np.abs(after - before).max() for before, after in pairwise(movements)]
    assert changes[-1] < 2e-5
    assert all(after < 0.5 * before for before, after in pairwise(changes))


@pytest.mark.parametrize("damping", [1e4, 1.0, 1e-2, 1e-4])
def test_slopes_of_the_rates(damping, limb_named):
    """Those of the program against differences, muscles pulling at any velocity."""
    rng = np.random.default_rng(3)
    model = WholeModel(damped(limb_named, "reference_joint_tendon", damping))
    drives = model.drives(np.array([[0.95, 0.9]]))
    rates, checked = model.right_hand_side(pieces(drives), 1.0), 0
    for _ in range(40):
        state = np.array([rng.uniform(-0.3, 0.8), rng.normal(), *rng.uniform(0.0300, 0.0306, 2)])
        slopes = model.slopes(state, np.array([0.95, 0.9]))
        for j in (2, 3):
            change = np.zeros(4)
            # Small beside the stretch, large beside the rounding of a force over the damping.
            change[j] = 1e-8
            ahead, behind = rates(0.0, state + change), rates(0.0, state - change)
            middle = rates(0.0, state)
            by_difference = (ahead[j] - behind[j]) / 2e-8
            bend = abs(ahead[j] - 2.0 * middle[j] + behind[j]) / 1e-8
            if bend < 1e-3 * abs(by_difference):
                checked += 1
                assert slopes[j, j] == pytest.approx(by_difference, rel=5e-3)
    assert checked > 40


@pytest.mark.parametrize(
    ("name", "damping", "suited"),
    [
        ("seated_knee", 660.0, "explicit"),
        ("seated_knee", 1.0, "implicit"),
        ("reference_joint_tendon", 1e-2, "implicit"),
    ],
)
def test_the_method_suits_tendons_that_pull(name, damping, suited, limb_named):
    """Also if all are slack at the start, where their dampers have nothing to do."""
    assert WholeModel(damped(limb_named, name, damping)).suited_method == suited


def test_the_method_changes_on_the_way(limb_named, monkeypatch):
    """If the start has not told that the limb is stiff."""
    limb = damped(limb_named, "seated_knee", 1e-4)
    given = bursts(4, 0.6)
    wanted = WholeModel(limb).simulate(given, RATE, observe=False)
    monkeypatch.setattr(WholeModel, "suited_method", "explicit")
    found = WholeModel(limb).simulate(given, RATE, observe=False)
    assert sum(found.steps) < 30_000
    np.testing.assert_allclose(found.angle, wanted.angle, rtol=0, atol=1e-6)


@pytest.mark.parametrize("damping", [1.0, 1e-4])
def test_the_nodes_follow(damping, limb_named):
    """Ticks against the whole model: the error is small, and falls with the square of the tick."""
    limb = damped(limb_named, "seated_knee", damping)

    def error(rate: float) -> float:
        time = np.arange(round(0.5 * rate) + 1)[:, np.newaxis] / rate
        given = 0.5 + 0.4 * np.sin(2 * np.pi * time + np.arange(4))
        whole = WholeModel(limb).simulate(given, rate, observe=False)
        assert np.ptp(whole.angle) > 0.1
        return float(np.abs(run(limb, given, rate)[0] - whole.angle).max())

    coarse, fine = error(1000.0), error(2000.0)
    assert coarse < 2e-4
    assert fine < coarse / 3


SAMPLES = st.lists(st.floats(0.0, 1.0).filter(lambda x: x == 0.0 or x > 1e-9), min_size=3, max_size=12)


@given(SAMPLES)
def test_an_input_never_swings_below_zero(samples):
    """A negative force would feed energy in, and without damping nothing holds it."""
    column = np.array(samples)[:, np.newaxis]
    s = np.linspace(0.0, 1.0, 101)
    tables = [*pieces(column), *(bent(*column[k : k + 3])[0] for k in range(len(samples) - 2))]
    for c0, c1, c2, c3 in tables:
        assert (c0 + s * (c1 + s * (c2 + s * c3))).min() > -1e-15
