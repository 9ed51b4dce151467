"""From the envelope to the force: filter and curve of the activation, twitch, force by length over the optimal one."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest

from limb_nodes.errors import UserError
from limb_nodes.levels.motor_unit.cheng_optimal_length import cheng_optimal_length
from limb_nodes.levels.motor_unit.twitch_tetanus import twitch_tetanus
from limb_nodes.levels.muscle import second_order
from limb_nodes.model import load_limb, with_values
from limb_nodes.solve.whole import WholeModel
from tests.solve.test_stepping import run

KNEE = (Path(__file__).parents[2] / "params" / "seated_knee.yaml").read_text()
RATE = 1000.0
VASTUS = 2


def knee(folder: Path, *changes: tuple[str, str]):
    """The seated knee with texts replaced, each of them there."""
    text = KNEE
    for pattern, other in changes:
        text, count = re.subn(pattern, other, text)
        assert count
    (folder / "limb.yaml").write_text(text)
    return load_limb(folder / "limb.yaml")


def dynamics(law: str) -> tuple[str, str]:
    return r"activation_dynamics: \{law: none\}", f"activation_dynamics: {{{law}}}"


# Force by length


@pytest.mark.parametrize(("length", "factor"), [(0.8, 0.83), (1.0, 1.0), (1.2, 0.75), (1.4, 0.34)])
def test_force_length_of_the_source(length, factor):
    """Slow fibres of Brown, Scott and Loeb 1996: omega 1.12, beta 2.3, rho 1.61."""
    assert cheng_optimal_length(2.7e-6 * length, 2.7e-6, 1.12, 2.3, 1.61) == pytest.approx(factor, abs=0.005)


# Force by frequency


def test_a_unit_begins_with_a_twitch():
    factors = [twitch_tetanus(f, 5.0, 15.0, 0.2, 1.5) for f in (0.0, 2.5, 5.0, 10.0, 15.0)]
    assert factors[:3] == pytest.approx([0.0, 0.1, 0.2])
    assert factors[3] == pytest.approx(0.2 + 0.8 * (1 - math.exp(-0.75)) / (1 - math.exp(-1.5)))
    assert factors[4] == pytest.approx(1.0)
    assert twitch_tetanus(10.0, 5.0, 15.0, 0.2, 0.0) == pytest.approx(0.6)


def shares(limb, activations: np.ndarray) -> np.ndarray:
    """The force of a muscle at activations over that at the full one, the joint held by its inertia."""
    held = with_values(limb, {"segments[0].inertia": 1e5, "segments[0].angle": math.pi / 3})
    model, forces = WholeModel(held), []
    for activation in (0.0, *activations, 1.0):
        given = np.zeros((601, len(limb.muscles)))
        given[:, VASTUS] = activation
        forces.append(model.simulate(given, RATE).muscle["muscle_force"][-1, VASTUS])
    return (np.array(forces[1:-1]) - forces[0]) / (forces[-1] - forces[0])


def test_a_share_of_activation_is_its_share_of_force(tmp_path):
    """Within 8 points of a straight line, where the report's laws are off by up to 20."""
    activations = np.linspace(0.1, 0.9, 9)
    sigmoid = r"force_frequency:\n      law: sigmoid[^\n]*\n(      [^\n]*\n)+"
    threshold = (r"activation_threshold: [.\d]+", "activation_threshold: 0.3")
    limb = knee(tmp_path, (sigmoid, "force_frequency: twitch_tetanus\n"), threshold)
    assert np.abs(shares(limb, activations) - activations).max() < 0.08
    (tmp_path / "report").mkdir()
    assert np.abs(shares(knee(tmp_path / "report"), activations) - activations).max() > 0.15


# Activation dynamics


def activation(limb, given: np.ndarray) -> np.ndarray:
    """The activation of the vastus [T]; no other muscle is excited."""
    excitation = np.zeros((len(given), len(limb.muscles)))
    excitation[:, VASTUS] = given
    return WholeModel(limb).simulate(excitation, RATE).muscle["activation"][:, VASTUS]


def test_a_step_and_a_twitch(tmp_path):
    limb = knee(tmp_path, dynamics("law: second_order, time_constant: 0.04"))
    time = np.arange(401) / RATE
    step = activation(limb, np.ones(401))
    np.testing.assert_allclose(step, 1.0 - (1.0 + time / 0.04) * np.exp(-time / 0.04), rtol=0, atol=1e-7)
    given = np.zeros(401)
    given[1] = 1.0
    twitch = activation(limb, given)
    assert time[np.argmax(twitch)] == pytest.approx(0.041, abs=1e-3)


@pytest.mark.parametrize("shape", [-3.0, -1.0, -1e-3, -1e-7, 0.0])
def test_the_exponential_curve(shape, tmp_path):
    limb = knee(tmp_path, dynamics(f"law: second_order, time_constant: 0.02, shape: {shape!r}"))
    found = [activation(limb, np.full(401, u))[-1] for u in (0.2, 0.5, 1.0)]
    wanted = [(math.exp(shape * u) - 1) / (math.exp(shape) - 1) if shape < -1e-6 else u for u in (0.2, 0.5, 1.0)]
    assert found == pytest.approx(wanted, abs=1e-6)


@pytest.mark.parametrize("shape", [0.0, 0.001, 0.06, 0.12])
@pytest.mark.parametrize("node", [0.2, 0.3, 0.6])
def test_the_logarithmic_curve(shape, node):
    """From 0 to 1 through the node, with one slope there, and straight without a shape."""
    at, height = second_order.node_excitation(node, shape), second_order.node_activation(node, shape)
    slope = second_order.node_slope(at, height)
    rate = second_order.curve_rate(at, height, slope)
    top = second_order.curve_height(at, height, rate)

    def curve(u: float) -> float:
        return second_order.logarithmic_curve(u, at, height, slope, rate, top)

    assert [curve(0.0), curve(at), curve(1.0)] == pytest.approx([0.0, height, 1.0], abs=1e-6)
    before, behind = (curve(at) - curve(at - 1e-5)) / 1e-5, (curve(at + 1e-5) - curve(at)) / 1e-5
    assert before == pytest.approx(behind, rel=1e-3)
    values = [curve(u) for u in np.linspace(0.0, 1.0, 101)]
    assert (np.diff(values) > 0.0).all()
    assert max(a - u for a, u in zip(values, np.linspace(0.0, 1.0, 101), strict=True)) <= 2.0 * shape + 1e-9


def test_nodes_follow(tmp_path):
    """By ticks as by the whole model; the force falls off in the time of the filter."""
    curve = dynamics("law: second_order_logarithmic, shape: 0.1")
    limb = knee(tmp_path, curve, (r"law: cheng\n", "law: cheng_optimal_length\n"))
    time = np.arange(801)[:, np.newaxis] / RATE
    given = 0.5 + 0.4 * np.sin(2 * np.pi * time + np.arange(4))
    given[500:] = 0.0
    whole = WholeModel(limb).simulate(given, RATE)
    assert np.ptp(whole.angle) > 0.1
    assert np.abs(run(limb, given, RATE)[0] - whole.angle).max() < 2e-4
    falling = whole.muscle["activation"][500:, VASTUS]
    assert 0.03 < np.argmax(falling < 0.1 * falling[0]) / RATE < 0.2


REFUSED = {
    "a shape that bends the other way": ("law: second_order, shape: 0.5", "shape is 0.5"),
    "a shape below the lowest": ("law: second_order, shape: -4", "shape is -4"),
    "a node too far off": ("law: second_order_logarithmic, shape: 0.2", "shape is 0.2"),
    "no time": ("law: second_order, time_constant: 0", "time_constant is 0"),
}


@pytest.mark.parametrize(("law", "said"), REFUSED.values(), ids=REFUSED)
def test_refused(law, said, tmp_path):
    with pytest.raises(UserError, match=rf"limb.yaml: muscles\[0\].activation_dynamics.{re.escape(said)}"):
        knee(tmp_path, dynamics(law))
