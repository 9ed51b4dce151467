"""Muscles over several joints: their paths by hand, against MuJoCo and by energy, in the whole model and by ticks."""

from __future__ import annotations

import math
import warnings
from itertools import pairwise
from pathlib import Path

import mujoco
import numpy as np
import pytest
from numpy.polynomial import polynomial
from scipy.integrate import simpson

from limb_nodes.errors import UserError
from limb_nodes.foundation.yaml_text import yaml_text
from limb_nodes.model import load_limb, parse_limb
from limb_nodes.model.load import with_values
from limb_nodes.model.path_remarks import LimbWarning, unequal_work
from limb_nodes.solve.held import slope_rows
from limb_nodes.solve.pieces import pieces
from limb_nodes.solve.stepping import LimbStepper, MuscleStepper
from limb_nodes.solve.variants import Variants
from limb_nodes.solve.whole import WholeModel

LEG = Path(__file__).with_name("two_joint_leg.yaml")
RATE = 1000.0


@pytest.fixture(scope="module")
def leg():
    return load_limb(LEG)


@pytest.fixture(scope="module")
def excitation():
    """Ten waves between 0.05 and 0.6, each with its own frequency and phase."""
    time = np.arange(1001) / RATE
    phase = np.arange(10)
    return 0.325 + 0.275 * np.sin(2 * np.pi * np.outer(time, 0.5 + 0.1 * phase) + phase)


@pytest.fixture(scope="module")
def found(leg, excitation):
    return WholeModel(leg).simulate(excitation, RATE)


def muscle_of(limb, name: str):
    return limb.muscles[limb.muscle_names.index(name)]


def torque_of(limb, found, name: str, joint: str) -> np.ndarray:
    """What one muscle does on one joint [T]."""
    wanted = limb.muscle_names.index(name), limb.joint_names.index(joint)
    return found.muscle["muscle_torque"][:, limb.crossings.index(wanted)]


def test_a_leg_has_six_muscles_over_two_joints(leg, found):
    assert sum(len(muscle.joints) == 2 for muscle in leg.muscles) == 6
    assert len(leg.muscles) == 10
    assert np.ptp(found.angle, axis=0).min() > 0.05


def test_linear_by_hand(leg, found):
    """Hamstrings: 0.44 m at hip 0.3 and knee -0.5, arms of -6 and -3.5 cm."""
    place = leg.muscle_names.index("hamstrings")
    hip, knee = found.angle[:, 0], found.angle[:, 1]
    length = 0.44 + 0.06 * (hip - 0.3) + 0.035 * (knee + 0.5)
    np.testing.assert_allclose(found.muscle["muscle_tendon_length"][:, place], length, rtol=1e-13)
    speed = -0.06 * found.velocity[:, 0] - 0.035 * found.velocity[:, 1]
    np.testing.assert_allclose(found.muscle["muscle_tendon_velocity"][:, place], speed, rtol=1e-12, atol=1e-15)
    force = found.muscle["muscle_force"][:, place]
    for joint, arm in (("hip", -0.06), ("knee", -0.035)):
        np.testing.assert_allclose(torque_of(leg, found, "hamstrings", joint), arm * force, rtol=1e-12)


def test_polynomial_against_numpy(leg, found):
    place = leg.muscle_names.index("sartorius")
    terms = {(0, 0): 0.52, (1, 0): -0.04, (0, 1): 0.015, (2, 0): 0.004, (1, 1): -0.003, (1, 2): 0.002}
    table = np.zeros((3, 3))
    for powers, value in terms.items():
        table[powers] = value
    at = found.angle[:, 0], found.angle[:, 1]
    np.testing.assert_allclose(
        found.muscle["muscle_tendon_length"][:, place], polynomial.polyval2d(*at, table), rtol=1e-13
    )
    force = found.muscle["muscle_force"][:, place]
    for axis, joint in enumerate(("hip", "knee")):
        arm = -polynomial.polyval2d(*at, polynomial.polyder(table, axis=axis))
        np.testing.assert_allclose(torque_of(leg, found, "sartorius", joint), arm * force, rtol=1e-10, atol=1e-12)


def test_straight_lines_by_hand(leg, found):
    """The rectus femoris from points in the plane: x down and y forward at zero angles."""
    place = leg.muscle_names.index("rectus_femoris")
    for row in range(0, 1001, 100):
        hip, knee, _ = found.angle[row]
        thigh, shank = np.exp(1j * hip), np.exp(1j * (hip + knee))
        points = [-0.04 + 0.05j, (0.41 + 0.05j) * thigh, 0.4288 * thigh + (0.07 + 0.04j) * shank]
        length = sum(abs(end - start) for start, end in pairwise(points))
        assert found.muscle["muscle_tendon_length"][row, place] == pytest.approx(length, rel=1e-13)


BODY = """
<body pos="{start} 0 0"><joint name="{joint}" type="hinge" axis="0 0 1" stiffness="20" damping="{damping}"/>
<inertial pos="{com} 0 0" mass="{mass}" diaginertia="{inertia} {inertia} {inertia}"/>{sites}{inner}</body>
"""
DAMPING = {"hip": 1.0, "knee": 0.5, "ankle": 0.3}
NO_TENDON = ("sartorius", "vasti", "gastrocnemius")


def in_mujoco(limb) -> mujoco.MjModel:
    """The limb with tendons of MuJoCo's own kinds: fixed for constant arms, spatial for straight lines."""
    sites: dict[str, str] = {}
    tendons = actuators = inner = ""
    for muscle, given in zip(limb.muscles, limb.content["muscles"], strict=True):
        path = given["path"]
        if path["law"] == "linear":
            parts = [f'<joint joint="{joint}" coef="{-arm}"/>' for joint, arm in path["moment_arms"].items()]
            tendons += f'<fixed name="{muscle.name}">{"".join(parts)}</fixed>'
        else:
            parts = []
            for number, point in enumerate(path["points"]):
                x, y = point["at"]
                name = f"{muscle.name}{number}"
                sites[point["segment"]] = sites.get(point["segment"], "") + f'<site name="{name}" pos="{x} {y} 0"/>'
                parts.append(f'<site site="{name}"/>')
            tendons += f'<spatial name="{muscle.name}">{"".join(parts)}</spatial>'
        actuators += f'<motor tendon="{muscle.name}"/>'
    for segment in reversed(limb.segments):
        before = limb.segments.index(segment) - 1
        inner = BODY.format(
            start=limb.segments[before].length if before >= 0 else 0.0, joint=segment.joint, com=segment.com_distance,
            damping=DAMPING[segment.joint], mass=segment.mass, inertia=segment.inertia,
            sites=sites.get(segment.name, ""), inner=inner,
        )  # fmt: skip
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><option gravity="9.81 0 0"/><compiler autolimits="false"/><worldbody>{sites.get("base", "")}{inner}'
        f"</worldbody><tendon>{tendons}</tendon><actuator>{actuators}</actuator></mujoco>"
    )
    model.qpos_spring[:] = [0.3, -0.6, 1.5]
    return model


def test_accelerations_are_those_of_mujoco_under_the_same_forces(leg, excitation):
    kept = [muscle for muscle in leg.content["muscles"] if muscle["name"] not in NO_TENDON]
    limb = with_values(leg, {"muscles": kept})
    found = WholeModel(limb).simulate(excitation[:, : len(kept)], RATE)
    model = in_mujoco(limb)
    data = mujoco.MjData(model)
    lengths = found.muscle["muscle_tendon_length"]
    straight = [
        number for number, muscle in enumerate(limb.muscles) if muscle.laws["path"].law.name == "straight_lines"
    ]
    for row in range(0, 1001, 50):
        data.qpos[:], data.qvel[:] = found.angle[row], found.velocity[row]
        data.ctrl[:] = -found.muscle["muscle_force"][row]
        mujoco.mj_forward(model, data)
        np.testing.assert_allclose(found.acceleration[row], data.qacc, rtol=1e-10, atol=1e-8)
        np.testing.assert_allclose(lengths[row, straight], data.ten_length[straight], rtol=1e-12)
        np.testing.assert_allclose(
            -found.muscle["muscle_tendon_velocity"][row], data.ten_velocity, rtol=1e-10, atol=1e-12
        )


def test_joints_get_the_work_that_muscles_do(leg, found):
    """The power on all joints is that of the force along the muscle-tendon unit."""
    power = np.zeros((len(found.time), len(leg.muscles)))
    for crossing, (muscle, joint) in enumerate(leg.crossings):
        power[:, muscle] += found.muscle["muscle_torque"][:, crossing] * found.velocity[:, joint]
    wanted = found.muscle["muscle_force"] * found.muscle["muscle_tendon_velocity"]
    np.testing.assert_allclose(power, wanted, rtol=1e-9, atol=1e-9)
    assert np.abs(power).max() > 5.0


def test_slopes_couple_the_joints(leg, found, excitation):
    """The slopes of the torques against differences, and the whole Jacobian of the rates as well."""
    muscles = MuscleStepper(leg)
    n = muscles.joints
    off_diagonal = 0.0
    for row in (100, 500, 900):
        muscles.internal[:] = found.internal[row]
        drive = muscles.drive(excitation[row])

        def torque(angle, velocity, drive=drive):
            return muscles.torque(angle, velocity, drive, drive, 1e-3)

        state = found.angle[row], found.velocity[row]
        slopes = slope_rows(torque(*state))
        for which in range(2):
            for k in range(n):
                step = 1e-5 * np.eye(n)[k]
                ends = [
                    torque(*(state[i] + sign * step if i == which else state[i] for i in range(2)))[0]
                    for sign in (1, -1)
                ]
                np.testing.assert_allclose(slopes[which][:, k], (ends[0] - ends[1]) / 2e-5, rtol=1e-5, atol=1e-4)
        off_diagonal = max(off_diagonal, *(np.abs(part - np.diag(np.diag(part))).max() for part in slopes))
    assert off_diagonal > 1.0
    model = WholeModel(leg)
    state = np.concatenate([found.angle[500], found.velocity[500], found.internal[500]])
    exact = model.slopes(state, excitation[500])
    rates = model.right_hand_side(pieces(model.drives(excitation[500][np.newaxis])), 1.0)
    for k in range(state.size):
        step = 1e-6 * model.state_scale[k] * np.eye(state.size)[k]
        difference = (rates(0.0, state + step) - rates(0.0, state - step)) / (2 * step[k])
        np.testing.assert_allclose(exact[:, k], difference, rtol=1e-4, atol=1e-6 * np.abs(exact).max())


@pytest.mark.parametrize(("rate", "tolerance"), [(1000.0, 2e-5), (200.0, 5e-4)])
def test_ticks_give_the_movement_of_the_whole_model(leg, found, excitation, rate, tolerance):
    every = round(RATE / rate)
    given = excitation[::every]
    wanted = WholeModel(leg).simulate(given, rate)
    muscles, chain = MuscleStepper(leg), LimbStepper(leg)
    period, earlier, worst = 1.0 / rate, None, 0.0
    for row in range(len(given) - 1):
        drive, following = muscles.drive(given[row]), muscles.drive(given[row + 1])
        before = chain.angle.copy(), chain.velocity.copy()
        chain.step(muscles.torque(*before, drive, following, period, earlier), period)
        muscles.advance(before, (chain.angle.copy(), chain.velocity.copy()), drive, following, period, earlier)
        earlier = drive
        worst = max(worst, np.abs(chain.angle - wanted.angle[row + 1]).max())
    assert worst <= tolerance


def test_explicit_and_implicit_agree(leg, found, excitation):
    implicit = WholeModel(leg).simulate(excitation, RATE, method="implicit", observe=False)
    assert np.abs(implicit.angle - found.angle).max() < 1e-6


LAW = '''
from limb_nodes.levels import Parameter, law
import math


def half(x):
    return 0.5 * x


@law("path", Parameter("slack", "m", "length at zero", above=0.0))
def curved(hip_angle, knee_angle, slack):
    """Over hip and knee, longer with both."""
    return slack + 0.03 * math.sin(hip_angle) + half(0.04 * knee_angle)
'''


def test_a_law_of_ones_own_gives_the_length_alone(leg, tmp_path, excitation):
    (tmp_path / "mine.py").write_text(LAW)
    content = dict(leg.content, muscles=[dict(leg.content["muscles"][3], path={"law": "mine:curved", "slack": 0.44})])
    file = tmp_path / "leg.yaml"
    file.write_text(yaml_text(content))
    limb = load_limb(file, allow_laws=True)
    found = WholeModel(limb).simulate(excitation[:200, :1], RATE)
    force = found.muscle["muscle_force"][:, 0]
    hip, knee = found.muscle["muscle_torque"].T
    np.testing.assert_allclose(hip, -0.03 * np.cos(found.angle[:, 0]) * force, rtol=1e-12)
    np.testing.assert_allclose(knee, -0.02 * force, rtol=1e-12)
    assert math.isclose(found.muscle["muscle_tendon_length"][0, 0], 0.44 + 0.03 * math.sin(0.3) - 0.012)


SAME_NAMES = """
from limb_nodes.levels import law
from other import scaled as theirs


def scaled(x):
    return 0.04 * x


@law("path")
def mixed(hip_angle, knee_angle):
    return 0.44 + scaled(hip_angle) * (1.0 + theirs(knee_angle))
"""


def test_helpers_of_a_law_may_have_one_name(leg, tmp_path, excitation, monkeypatch):
    (tmp_path / "other.py").write_text("def scaled(x):\n    return 0.03 * x * x\n")
    (tmp_path / "mine.py").write_text(SAME_NAMES)
    monkeypatch.syspath_prepend(tmp_path)
    muscle = dict(leg.content["muscles"][3], path={"law": "mine:mixed"})
    file = tmp_path / "leg.yaml"
    file.write_text(yaml_text(dict(leg.content, muscles=[muscle])))
    found = WholeModel(load_limb(file, allow_laws=True)).simulate(excitation[:50, :1], RATE)
    force = found.muscle["muscle_force"][:, 0]
    hip, knee = found.muscle["muscle_torque"].T
    at_hip, at_knee = found.angle[:, 0], found.angle[:, 1]
    np.testing.assert_allclose(hip, -0.04 * (1.0 + 0.03 * at_knee**2) * force, rtol=1e-12)
    np.testing.assert_allclose(knee, -0.04 * at_hip * 0.06 * at_knee * force, rtol=1e-12)


BAD = {
    "a joint twice": ({"joints": ["knee", "knee"]}, "muscles[0].joints[1] is 'knee' a second time"),
    "a gap": ({"joints": ["hip", "ankle"]}, "muscles[0].joints is ['hip', 'ankle'], without knee in between"),
    "no such joint": ({"joints": ["hip", "toe"]}, "muscles[0].joints[1] is 'toe'; allowed: hip, knee, ankle"),
    "joint and joints": ({"joint": "hip"}, "muscles[0].joint is there beside joints"),
    "no list": ({"joints": "hip"}, "muscles[0].joints is 'hip'; a list of joints is needed"),
    "a law for one joint": (
        {"path": {"law": "geometric_moment_arm", "moment_arm": 0.01, "proximal_distance": 0.1, "distal_distance": 0.1}},
        "muscles[0].path.law is 'geometric_moment_arm', a law for one joint; over hip, knee allowed: linear, ",
    ),
    "a law misspelt": (
        {"path": {"law": "polynom"}},
        "muscles[0].path.law is 'polynom'; allowed: constant_moment_arm, geometric_moment_arm, linear, polynomial, ",
    ),
    "an arm missing": (
        {"path": {"law": "linear", "length": 0.4, "moment_arms": {"hip": 0.1}}},
        "muscles[0].path.moment_arms.knee is missing; a number > -1 and < 1 in m is needed",
    ),
    "another joint's arm": (
        {"path": {"law": "linear", "length": 0.4, "moment_arms": {"hip": 0.1, "knee": 0.1, "ankle": 0.1}}},
        "muscles[0].path.moment_arms.ankle is not a key here; allowed: hip, knee",
    ),
    "negative length": (
        {"path": {"law": "linear", "length": 0.2, "moment_arms": {"hip": 0.3, "knee": 0.1}}},
        "muscles[0].path.law is 'linear': muscle_tendon_length is ",
    ),
    "a power without number": (
        {"path": {"law": "polynomial", "terms": [{"coefficient": 0.4}, {"coefficient": 0.1, "powers": {"hip": 1.5}}]}},
        "muscles[0].path.terms[1].powers.hip is 1.5; an integer >= 0 and <= 9 is needed",
    ),
    "a joint without power": (
        {"path": {"law": "polynomial", "terms": [{"coefficient": 0.4}, {"coefficient": 0.01, "powers": {"hip": 1}}]}},
        "muscles[0].path.terms have no power of knee",
    ),
    "a point on another segment": (
        {"path": {"law": "straight_lines", "points": [{"segment": "foot", "at": [0, 0]}]}},
        "muscles[0].path.points[0].segment is 'foot'; allowed: base, thigh, shank",
    ),
    "no point on the far end": (
        {"path": {"law": "straight_lines", "points": [{"segment": one, "at": [0.1, 0]} for one in ("base", "thigh")]}},
        "muscles[0].path.points has none on shank",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_refused_with_its_place(case, leg):
    change, wanted = BAD[case]
    muscle = {**leg.content["muscles"][3], **change}
    with pytest.raises(UserError) as told:
        with_values(leg, {"muscles": [muscle]})
    assert wanted in str(told.value)
    assert "\n" not in str(told.value)


def test_a_muscle_may_name_its_only_joint_either_way(leg):
    one = dict(leg.content["muscles"][6])
    limb = with_values(leg, {"muscles": [one]})
    del one["joint"]
    other = with_values(leg, {"muscles": [{**one, "joints": ["knee"]}]})
    assert limb.muscles[0].joints == other.muscles[0].joints == (1,)
    assert parse_limb(limb.text, "leg.yaml").muscles == limb.muscles


def test_a_moment_arm_that_changes_its_sign_is_warned_of(leg):
    powers = {0.4: {}, 0.01: {"knee": 2}, 0.02: {"hip": 1}}
    path = {"law": "polynomial", "terms": [{"coefficient": one, "powers": of} for one, of in powers.items()]}
    muscle = {**leg.content["muscles"][3], "path": path}
    wanted = r"muscles\[0\].path: the moment arm of hamstrings on knee changes its sign at .* rad"
    with pytest.warns(LimbWarning, match=wanted):
        with_values(leg, {"muscles": [muscle]})
    thigh, shank, foot = leg.content["segments"]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with_values(leg, {"muscles": [muscle], "segments": [thigh, {**shank, "range": [-2.0, -0.1]}, foot]})


def test_only_the_reports_path_does_other_work_than_its_torque(leg):
    assert unequal_work(leg) == ""
    told = unequal_work(load_limb(LEG.parents[2] / "params" / "seated_knee.yaml"))
    assert told == "RF, BF, VM, ST: shorten by 0.52 to 0.98 of their moment arm (constant_moment_arm)"


@pytest.mark.parametrize(
    "values",
    [
        {"muscles[3].path.moment_arms.hip": -0.05},
        {"muscles[4].path.terms[2].coefficient": 0.018, "muscles[2].path.points[1].at": [0.4, 0.06]},
        {"segments[0].length": 0.45},
        {"segments[0].length": 0.44, "muscles[3].path.moment_arms.knee": -0.03},
    ],
)
def test_numbers_of_paths_can_be_changed(leg, values, excitation):
    """Also the length of a segment, which the straight lines over it follow."""
    changed = Variants(leg).model(values)
    wanted = WholeModel(with_values(leg, values))
    rates = []
    for model in (changed, wanted):
        state = model.initial_state()
        rates.append(model.right_hand_side(pieces(model.drives(excitation[:1])), 1.0)(0.0, state))
    np.testing.assert_array_equal(*rates)
    unchanged = WholeModel(leg)
    same = unchanged.right_hand_side(pieces(unchanged.drives(excitation[:1])), 1.0)(0.0, unchanged.initial_state())
    assert np.abs(rates[0] - same).max() > 1e-3


STIFFNESS = {"hip": 20.0, "knee": 20.0, "ankle": 20.0}
REST = {"hip": 0.3, "knee": -0.6, "ankle": 1.5}


def energy(limb, angle: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    """Kinetic energy, that in gravity and in the springs of the joints (J) [T]: segments hang in the complex plane."""
    turned, speed = limb.base_angle + np.cumsum(angle, axis=1), np.cumsum(velocity, axis=1)
    along = np.exp(1j * turned)
    place = moves = np.zeros(len(angle), dtype=complex)
    total = np.zeros(len(angle))
    for k, segment in enumerate(limb.segments):
        com = place + segment.com_distance * along[:, k]
        com_moves = moves + segment.com_distance * 1j * along[:, k] * speed[:, k]
        total += segment.mass * (0.5 * np.abs(com_moves) ** 2 + 9.81 * com.imag)
        total += 0.5 * segment.inertia * speed[:, k] ** 2
        total += 0.5 * STIFFNESS[segment.joint] * (angle[:, k] - REST[segment.joint]) ** 2
        place, moves = place + segment.length * along[:, k], moves + segment.length * 1j * along[:, k] * speed[:, k]
    return total


def by_ticks(limb, excitation: np.ndarray, rate: float):
    """Angles and velocities [T, n] of a run by ticks, and the forces and velocities of its muscles [T, muscles]."""
    muscles, chain = MuscleStepper(limb), LimbStepper(limb)
    period, earlier = 1.0 / rate, None
    angle, velocity, force, shortening = [], [], [], []
    for row, following_row in zip(excitation, [*excitation[1:], excitation[-1]], strict=True):
        here = chain.angle.copy(), chain.velocity.copy()
        muscles.observe(*here, row)
        shown = muscles.shown
        values = *here, shown["muscle_force"], shown["muscle_tendon_velocity"]
        for seen, value in zip((angle, velocity, force, shortening), values, strict=True):
            seen.append(value.copy())
        drive, following = muscles.drive(row), muscles.drive(following_row)
        chain.step(muscles.torque(*here, drive, following, period, earlier), period)
        muscles.advance(here, (chain.angle.copy(), chain.velocity.copy()), drive, following, period, earlier)
        earlier = drive
    return tuple(map(np.array, (angle, velocity, force, shortening)))


@pytest.mark.parametrize("way", ["whole", "ticks"])
def test_the_work_of_muscles_is_the_change_of_energy(leg, way):
    rate = 4000.0
    time, phase = np.arange(4001) / rate, np.arange(10)
    excitation = 0.325 + 0.275 * np.sin(2 * np.pi * np.outer(time, 0.5 + 0.1 * phase) + phase)
    if way == "whole":
        found = WholeModel(leg).simulate(excitation, rate)
        angle, velocity = found.angle, found.velocity
        force, shortening = (found.muscle[name] for name in ("muscle_force", "muscle_tendon_velocity"))
    else:
        angle, velocity, force, shortening = by_ticks(leg, excitation, rate)
    damped = (np.array([DAMPING[name] for name in leg.joint_names]) * velocity**2).sum(axis=1)
    power = (force * shortening).sum(axis=1)
    work, lost = simpson(power, x=time), simpson(damped, x=time)
    stored = energy(leg, angle, velocity)
    exchanged = simpson(np.abs(force * shortening).sum(axis=1), x=time)
    assert exchanged > 1.0
    assert abs(stored[-1] - stored[0] + lost - work) < 1e-6 * exchanged
