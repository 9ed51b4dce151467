"""Tissue of joints: its laws by hand; limbs with it against MuJoCo and energy, and between both ways to run."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path

import mujoco
import numpy as np
import pytest

from limb_nodes.errors import UserError
from limb_nodes.levels.joint.exponential_tissue import exponential
from limb_nodes.levels.joint.linear_tissue import linear
from limb_nodes.levels.joint.soft_stop import lower_stop, upper_stop
from limb_nodes.model import load_limb, parse_limb
from limb_nodes.solve.stepping import LimbStepper, MuscleStepper
from limb_nodes.solve.whole import WholeModel

PARAMS = Path(__file__).resolve().parents[2] / "params"
CHAIN = """
name: pendulum
gravity: [0.0, -9.81]
base_angle: -1.5707963267948966
segments:
  - {{name: one, joint: hip, mass: 2.0, length: 0.4, com_distance: 0.2, inertia: 0.03, angle: 0.5, velocity: 1.0{one}}}
  - {{name: two, joint: knee, mass: 1.0, length: 0.3, com_distance: 0.15, inertia: 0.01, angle: -0.3{two}}}
"""


def chain(one: str = "", two: str = ""):
    given = {"one": f", tissue: [{one}]" if one else "", "two": f", tissue: [{two}]" if two else ""}
    return parse_limb(CHAIN.format(**given), "chain.yaml")


def test_linear_by_hand():
    assert linear(0.5, 2.0, 10.0, 0.3, 0.2) == pytest.approx(-10.0 * 0.3 - 0.6)
    assert linear(0.2, 0.0, 10.0, 0.3, 0.2) == 0.0


def test_exponential_by_hand():
    """1 N m against each end at its angle; e times as much 1/growth beyond."""
    values = 1.0, 20.0, -1.0, 5.0, 0.0
    assert exponential(1.0, 0.0, *values) == pytest.approx(-1.0, abs=1e-4)
    assert exponential(1.05, 0.0, *values) == pytest.approx(-math.e, abs=1e-4)
    assert exponential(-1.2, 0.0, *values) == pytest.approx(math.e)
    assert exponential(-1.0, 3.0, 1.0, 20.0, -1.0, 5.0, 0.4) == pytest.approx(1.0 - 1.2)


def test_soft_stops_push_and_never_pull():
    assert upper_stop(0.34, 0.0, 0.3, 100.0, 0.5) == pytest.approx(-100.0 * 0.008)
    assert upper_stop(0.34, 1.0, 0.3, 100.0, 0.5) == pytest.approx(-0.8 * 1.5)
    assert upper_stop(0.34, -5.0, 0.3, 100.0, 0.5) == 0.0
    assert upper_stop(0.29, 9.0, 0.3, 100.0, 0.5) == 0.0
    for depth in (0.01, 0.1):
        for speed in (-1.0, 0.0, 2.0):
            mirrored = -upper_stop(0.3 + depth, speed, 0.3, 100.0, 0.5)
            assert lower_stop(-0.3 - depth, -speed, -0.3, 100.0, 0.5) == pytest.approx(mirrored)


def test_accelerations_are_those_of_mujoco():
    limb = chain(
        "{law: linear, stiffness: 7.0, damping: 0.4, rest_angle: 0.2}",
        "{law: linear, stiffness: 3.0, rest_angle: -0.1}, {law: linear, stiffness: 2.0, damping: 0.2, rest_angle: 0.4}",
    )
    found = WholeModel(limb).simulate(np.zeros((101, 0)), 100.0, tolerance=1e-10)
    # Two springs side by side are one: their stiffnesses add up, and their rest angles, weighted with them.
    model = mujoco.MjModel.from_xml_string("""
        <mujoco><option gravity="9.81 0 0"/><compiler autolimits="false"/><worldbody><body>
          <joint type="hinge" axis="0 0 1" stiffness="7" damping="0.4" springref="0.2"/>
          <inertial pos="0.2 0 0" mass="2" diaginertia="0.03 0.03 0.03"/>
          <body pos="0.4 0 0">
            <joint type="hinge" axis="0 0 1" stiffness="5" damping="0.2" springref="0.1"/>
            <inertial pos="0.15 0 0" mass="1" diaginertia="0.01 0.01 0.01"/>
          </body></body></worldbody></mujoco>""")
    model.qpos_spring[:] = [0.2, 0.1]
    data = mujoco.MjData(model)
    for row in range(0, 101, 5):
        data.qpos[:], data.qvel[:] = found.angle[row], found.velocity[row]
        mujoco.mj_forward(model, data)
        np.testing.assert_allclose(found.acceleration[row], data.qacc, rtol=1e-10, atol=1e-9)


def energy(limb, found) -> np.ndarray:
    """Kinetic and potential energy of the chain of two segments over time."""
    first, second = limb.segments
    turned, speed = limb.base_angle + np.cumsum(found.angle, axis=1), np.cumsum(found.velocity, axis=1)
    along, across = np.exp(1j * turned), 1j * np.exp(1j * turned)
    places = [first.com_distance * along[:, 0], first.length * along[:, 0] + second.com_distance * along[:, 1]]
    moves = [
        first.com_distance * across[:, 0] * speed[:, 0],
        first.length * across[:, 0] * speed[:, 0] + second.com_distance * across[:, 1] * speed[:, 1],
    ]
    total = 0.5 * first.inertia * speed[:, 0] ** 2 + 0.5 * second.inertia * speed[:, 1] ** 2
    for segment, place, move in zip(limb.segments, places, moves, strict=True):
        total = total + segment.mass * (0.5 * np.abs(move) ** 2 + 9.81 * place.imag)
    return total


EXPONENTIAL = "{law: exponential, upper_angle: 0.3, upper_growth: 9.0, lower_angle: -0.4, lower_growth: 6.0}"
STOPS = "{law: upper_stop, stop_angle: 0.4, stiffness: 300.0, damping: 0.0}"


def test_without_damping_energy_goes_into_the_tissue_and_back():
    limb = chain(EXPONENTIAL, STOPS)
    found = WholeModel(limb).simulate(np.zeros((3001, 0)), 1000.0, tolerance=1e-10)
    hip, depth = found.angle[:, 0], np.maximum(0.0, found.angle[:, 1] - 0.4)
    assert depth.max() > 0.02
    stored = np.exp(9.0 * (hip - 0.3)) / 9.0 + np.exp(6.0 * (-0.4 - hip)) / 6.0 + 300.0 * depth**2.5 / 2.5
    total = energy(limb, found) + stored
    assert np.ptp(stored) > 0.3
    assert np.abs(total - total[0]).max() < 1e-6 * np.ptp(stored)


@pytest.mark.parametrize("damped", ["0.5", "3.0"])
def test_a_damped_stop_takes_energy(damped):
    limb = chain(two=STOPS.replace("damping: 0.0", f"damping: {damped}"))
    found = WholeModel(limb).simulate(np.zeros((3001, 0)), 1000.0, tolerance=1e-9)
    depth = np.maximum(0.0, found.angle[:, 1] - 0.4)
    total = energy(limb, found) + 300.0 * depth**2.5 / 2.5
    assert total[-1] < total[0] - 0.05
    assert np.diff(total).max() < 1e-7


def test_explicit_and_implicit_agree():
    limb = chain(EXPONENTIAL, "{law: linear, stiffness: 4.0, damping: 0.3}")
    inputs = np.zeros((1001, 0))
    one, other = (
        WholeModel(limb).simulate(inputs, 1000.0, method=method, tolerance=1e-9) for method in ("explicit", "implicit")
    )
    np.testing.assert_allclose(one.angle, other.angle, atol=1e-7)


TISSUE = """    tissue:
      - {law: linear, stiffness: 2.0, damping: 0.5, rest_angle: 1.0}
      - {law: lower_stop, stop_angle: 1.3, stiffness: 200.0}
"""


@pytest.fixture(scope="module")
def knee(tmp_path_factory):
    text = (PARAMS / "seated_knee.yaml").read_text()
    place = "    velocity: 0.0                       # rad/s; at rest\n"
    assert place in text
    file = tmp_path_factory.mktemp("tissue") / "knee.yaml"
    file.write_text(text.replace(place, place + TISSUE))
    return load_limb(file)


def test_the_graph_s_steps_are_the_whole_model(knee):
    """Tissue is in the chain's equations of both, and not in the torque that muscle_stack sends."""
    rate = 1000.0
    time = np.arange(1501) / rate
    given = np.stack([0.12 + 0.1 * np.sin(3.0 * time)] * 2 + [0.05 + 0.05 * np.cos(2.0 * time)] * 2, axis=1)
    whole = WholeModel(knee).simulate(given, rate)
    assert whole.angle.min() < 1.29
    muscles, limb = MuscleStepper(knee), LimbStepper(knee)
    angles = [limb.angle[0]]
    for now, then in pairwise(given):
        drives = muscles.drive(now), muscles.drive(then)
        before = limb.angle.copy(), limb.velocity.copy()
        limb.step(muscles.torque(*before, *drives, 1.0 / rate), 1.0 / rate)
        muscles.advance(before, (limb.angle.copy(), limb.velocity.copy()), *drives, 1.0 / rate)
        angles.append(limb.angle[0])
    np.testing.assert_allclose(angles, whole.angle[:, 0], atol=2e-5)
    rest = MuscleStepper(knee).torque(np.array([1.3]), np.zeros(1), drives[0], drives[0], 1e-3)
    bare = MuscleStepper(load_limb(PARAMS / "seated_knee.yaml"))
    np.testing.assert_array_equal(
        rest, bare.torque(np.array([1.3]), np.zeros(1), bare.drive(given[-2]), bare.drive(given[-2]), 1e-3)
    )


@pytest.mark.parametrize(
    ("tissue", "said"),
    [
        ("{law: linear}", r"segments\[0\].tissue\[0\].stiffness is missing"),
        ("{law: linear, stiffness: -1.0}", r"tissue\[0\].stiffness is -1"),
        ("{law: linear, stiffness: 1.0, damping: -0.1}", r"tissue\[0\].damping is -0.1"),
        ("{law: linear, stiffness: 0.0}", "passive_moment is 0 at every joint_angle from -1 to 1 rad"),
        (
            "{law: linear, stiffness: 1.0}, {law: upper_stop, stop_angle: 1.2, stiffness: 100.0}",
            r"tissue\[1\].law is 'upper_stop': passive_moment is 0 at every joint_angle from -1 to 1 rad",
        ),
        ("{law: lower_stop, stop_angle: -1.0, stiffness: 100.0}", "it never acts"),
        ("{law: rubber}", r"tissue\[0\].law is 'rubber'; allowed: exponential, linear, lower_stop, upper_stop"),
        ("{law: linear, stiffness: 1.0, stiff: 2.0}", "stiff"),
        ("3", r"segments\[0\].tissue\[0\]"),
    ],
)
def test_bad_tissue_is_refused_with_its_place(tissue, said):
    text = CHAIN.format(one=f", range: [-1.0, 1.0], tissue: [{tissue}]", two="")
    with pytest.raises(UserError, match=said):
        parse_limb(text, "chain.yaml")


@pytest.mark.parametrize(
    ("moment", "said"),
    [
        ("0.1 * joint_velocity - joint_angle", "it feeds energy in; what the velocity adds must act against it"),
        ("-joint_angle * joint_velocity", "it feeds energy in"),
        ("1.0 / joint_angle", "joint_angle|finite|division"),
        ("0.0 * joint_angle * joint_velocity", "it never acts"),
        ("-joint_angle - 0.2 * joint_velocity", ""),
    ],
)
def test_a_law_of_the_user_s_own_must_not_feed_energy_in(moment, said, tmp_path, monkeypatch):
    (tmp_path / "mine.py").write_text(f'''
from limb_nodes.levels import equation, law


@law("tissue", source="mine")
@equation("mine", "passive_moment")
def tissue(joint_angle: float, joint_velocity: float) -> float:
    """Moment (N m)."""
    return {moment}
''')
    file = tmp_path / "limb.yaml"
    file.write_text(CHAIN.format(one=", range: [-1.0, 1.0], tissue: [{law: 'mine.py:tissue'}]", two=""))
    if not said:
        assert load_limb(file, allow_laws=True).segments[0].tissue[0].law.name == "tissue"
        return
    with pytest.raises(UserError, match=said):
        load_limb(file, allow_laws=True)
