"""Huxley's equation on a grid against his closed form, the steady equation, and characteristics."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from limb_nodes.levels.sarcomere.huxley_distribution import huxley_distribution
from limb_nodes.model import load_limb
from limb_nodes.solve.whole import WholeModel
from tests.levels.test_alternatives import ALTERNATIVES, FROG, huxley_force, steady_force

# A velocity (1/s), at which bonds pass a reach in the time in which they are made and broken; the fastest is 4.
PHI = (FROG[0] + FROG[1]) / 2.0
DEFAULT = (43.3, 10.0, 209.0, 30.0)


class Bridges:
    """The law alone, its force over that in isometry. rates: f_1, g_1, g_2, g_3 (1/s)."""

    def __init__(self, rates: tuple[float, ...]) -> None:
        law = huxley_distribution
        given = dict(zip(("attachment", "detachment", "release", "overstretch"), rates, strict=True))
        self.known = {parameter.name: parameter.default for parameter in law.parameters} | given
        self.known["maximum_force"] = 1.0
        moving = {state.name for state in law.states} | {"sarcomere_velocity"}
        self.equations = []
        for one in law.equations:
            if moving.isdisjoint(one.uses):
                self.known[one.defines] = one.function(*(self.known[name] for name in one.uses))
            else:
                moving.add(one.defines)
                self.equations.append(one)
        self.states = law.states
        self.start = np.array([self.known[state.initial] for state in law.states])

    def at(self, bonds: np.ndarray, velocity: float) -> dict[str, float]:
        """All variables at shares of bonds [bins] and a velocity (1/s)."""
        found = dict(self.known)
        found |= zip((state.name for state in self.states), bonds, strict=True)
        found["sarcomere_velocity"] = 2.0 * self.known["reach"] * velocity
        for one in self.equations:
            found[one.defines] = one.function(*(found[name] for name in one.uses))
        return found

    def follow(self, velocity: Callable[[float], float], times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Force [T] and shares [T, bins] at times (s) from isometry on."""

        def slopes(t: float, bonds: np.ndarray) -> list[float]:
            found = self.at(bonds, velocity(t))
            return [found[state.rate] for state in self.states]

        solved = solve_ivp(slopes, (0.0, times[-1]), self.start, "RK23", times, rtol=1e-5, atol=1e-7, max_step=5e-3)
        shares = solved.y.T
        return np.array([self.at(bonds, 0.0)["sarcomere_force"] for bonds in shares]), shares


def made_and_broken(x: np.ndarray, rates: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray]:
    """f and g (1/s) at bond lengths x."""
    attachment, detachment, release, overstretch = rates
    within = (x > 0.0) & (x < 1.0)
    broken = np.where(x < 0.0, release, detachment * x + overstretch * np.maximum(0.0, x - 1.0))
    return np.where(within, attachment * x, 0.0), broken


def exact_force(velocity: Callable[[float], float], times: np.ndarray, rates: tuple[float, ...]) -> np.ndarray:
    """The force [T] over the isometric one by characteristics: each site on its own, as it is carried along."""
    start = np.arange(-8.0, 10.0, 2e-3) + 1e-3
    made, broken = made_and_broken(start, rates)
    isometric = made / (made + broken)
    bonds, moved, force = isometric.copy(), 0.0, []
    step = 4e-5
    passed, now = iter(times), 0.0
    wanted = next(passed)
    while True:
        if now >= wanted - 1e-9:
            force.append(np.sum(bonds * (start - moved)) / np.sum(isometric * start))
            wanted = next(passed, None)
            if wanted is None:
                return np.array(force)
        moved += step * velocity(now + 0.5 * step)
        now += step
        made, broken = made_and_broken(start - moved, rates)
        goal = made / (made + broken)
        bonds = goal + (bonds - goal) * np.exp(-(made + broken) * step)


@pytest.mark.parametrize("speed", [0.25, 1.0, 3.0])
def test_huxleys_own_curve(speed):
    force, _ = Bridges(FROG).follow(lambda _: speed * PHI, np.linspace(0.0, 0.3, 4))
    assert force[-1] == pytest.approx(huxley_force(speed), abs=0.004)


@pytest.mark.parametrize(("speed", "error"), [(-0.25, 0.02), (-1.0, 0.025), (-2.0, 0.03)])
def test_steady_lengthening(speed, error):
    """Against the steady equation along the bond length; Zahalak's moments are further off."""

    def slopes(x: float, y: np.ndarray) -> list[float]:
        made, broken = made_and_broken(np.array(x), DEFAULT)
        return [float(made - (made + broken) * y[0]) / (-speed * PHI), x * y[0]]

    below = solve_ivp(slopes, (1e-12, 1.0 - 1e-12), [0.0, 0.0], "LSODA", rtol=1e-9, atol=1e-12)
    beyond = solve_ivp(slopes, (1.0 + 1e-12, 15.0), below.y[:, -1], "LSODA", rtol=1e-9, atol=1e-12)
    isometric = 0.5 * DEFAULT[0] / (DEFAULT[0] + DEFAULT[1])
    wanted = float(beyond.y[1, -1]) / isometric
    force, _ = Bridges(DEFAULT).follow(lambda _: speed * PHI, np.linspace(0.0, 0.3, 4))
    assert force[-1] == pytest.approx(wanted, abs=error)
    assert abs(steady_force(speed * PHI, DEFAULT) - wanted) > 2.0 * abs(force[-1] - wanted)


COURSES = {
    "quick release": lambda t: 150.0 if t < 2e-3 else 0.0,
    "quick stretch": lambda t: -150.0 if t < 2e-3 else 0.0,
    "to and fro": lambda t: 60.0 * math.cos(2.0 * math.pi * 20.0 * t),
    "stretched, then shortened": lambda t: -20.0 if t < 0.04 else 40.0,
}


@pytest.mark.parametrize("velocity", COURSES.values(), ids=COURSES)
def test_movements(velocity):
    times = np.linspace(0.0, 0.08, 41)
    wanted = exact_force(velocity, times, DEFAULT)
    force, shares = Bridges(DEFAULT).follow(velocity, times)
    assert np.ptp(wanted) > 0.2
    assert np.abs(force - wanted).max() < 0.05
    assert shares.min() > -1e-4
    assert shares.max() < 1.0 + 1e-4


def test_a_limb_of_such_muscles(tmp_path):
    """It moves near the limb of Zahalak's moments, and not as that one."""
    text = ALTERNATIVES.read_text()
    assert text.count("bridges: {law: huxley}") == 1
    (tmp_path / "limb.yaml").write_text(text.replace("bridges: {law: huxley}", "bridges: {law: huxley_distribution}"))
    limb = load_limb(tmp_path / "limb.yaml")
    rate = 1000.0
    time = np.arange(401) / rate
    given = np.column_stack([0.5 + 0.4 * np.sin(6.0 * time), 0.5 + 0.4 * np.cos(6.0 * time)])
    whole = WholeModel(limb).simulate(given, rate, method="explicit", observe=False)
    assert np.ptp(whole.angle) > 0.1
    moments = WholeModel(load_limb(ALTERNATIVES)).simulate(given, rate, observe=False)
    assert 1e-4 < np.abs(moments.angle - whole.angle).max() < 0.1


@pytest.mark.parametrize("rates", [FROG, DEFAULT, (500.0, 20.0, 3000.0, 10.0), (5.0, 8.0, 6.0, 90.0)])
def test_isometry_stays(rates):
    bridges = Bridges(rates)
    found = bridges.at(bridges.start, 0.0)
    assert found["sarcomere_force"] == pytest.approx(1.0, rel=1e-12)
    assert max(abs(found[state.rate]) for state in bridges.states) < 1e-9
