"""The cases of the report's section 3.3: what they expect, that the model shows it, and that a wrong limb does not."""

from __future__ import annotations

import json
import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.special import ellipk

from limb_nodes.analysis.course import Course
from limb_nodes.analysis.verification import CASES, balanced_angle, examine, frequency, highest_turn, lowest_turn
from limb_nodes.cli import main
from limb_nodes.commands.verify import write_limb
from limb_nodes.errors import UserError
from limb_nodes.model import load_limb
from limb_nodes.model.shipped import params_folder, shipped

# The reference limb, written down again: what is verified must not deliver what it is compared with.
MASS, LENGTH, CENTRE, GRAVITY = 1.25, 0.35, 0.175, 9.81
INERTIA = 0.0127604 + MASS * CENTRE**2
ARM, PROXIMAL, DISTAL = 0.0215, 0.10, 0.03
START = math.radians(30)
WEIGHT = MASS * GRAVITY * CENTRE
SERIES, PARALLEL = 42000, 1e14
SHORTEST, OPTIMAL, LONGEST = 0.9 * 1.6e-6, 2 * 1.35e-6, 1.6e-6 + 2 * 1.35e-6
ISOMETRIC = 11e-9 / 45e-9 * 4e-12
FASTEST = 11e-9 * 230.0 * 3e-3 / (230.0 / 0.76e6 + 3e-3)
STIFFNESS, DAMPING, SLACK = 1e5, 1e4, 0.03
TIGHT = {"method": "DOP853", "rtol": 1e-11, "atol": 1e-12}


def pendulum(gravity: float, load: float = 0.0) -> float:
    """Frequency (Hz) of the limb as a pendulum from 30 degrees, load (N) at its tip."""
    small = math.sqrt((MASS * gravity * CENTRE + load * LENGTH) / INERTIA)
    return small / (4.0 * float(ellipk(math.sin(START / 2) ** 2)))


def pushed(force: float, gravity: float, until: float, event: Callable[..., float] | None = None):
    """The limb under a constant muscle force (N, negative in the extensor)."""

    def rates(_, state):
        return [state[1], (force * ARM - MASS * gravity * CENTRE * math.sin(state[0])) / INERTIA]

    return solve_ivp(rates, (0.0, until), [START, 0.0], events=event, **TIGHT)


def lower_turn(force: float) -> float:
    """Angle (rad) at which the limb turns below, by energy."""

    def potential(angle: float) -> float:
        return -WEIGHT * math.cos(angle) - force * ARM * angle

    middle = math.asin(force * ARM / WEIGHT)
    return brentq(lambda angle: potential(angle) - potential(START), -1.5, middle, xtol=1e-14)


def swings(force: float) -> float:
    """Frequency (Hz) under a constant muscle force (N): every second turn begins a period."""
    turns = pushed(force, GRAVITY, 3.0, lambda _, state: state[1]).t_events[0]
    return 1.0 / (turns[3] - turns[1])


def arrives(force: float, limit: float) -> float:
    """Time (s) at which the limb passes an angle."""
    return float(pushed(force, 1.1, 1.0, lambda _, state: state[0] - limit).t_events[0][0])


def line(angle: float, role: float) -> float:
    """Muscle-tendon length (m)."""
    return sum(math.sqrt(ARM**2 + d**2 - role * 2 * ARM * d * math.sin(angle / 2)) for d in (PROXIMAL, DISTAL))


def line_velocity(angle: float, velocity: float, role: float) -> float:
    """Shortening velocity (m/s) of the muscle-tendon unit."""
    step = 1e-5
    return -velocity * (line(angle + step, role) - line(angle - step, role)) / (2 * step)


def fibre(length: float, velocity: float, activation: float) -> float:
    """Force (N) of the one motor unit."""
    sarcomere = length / SERIES
    short = max(0.0, (sarcomere - SHORTEST) / (OPTIMAL - SHORTEST))
    norm = short if sarcomere < OPTIMAL else 1.0 + (sarcomere - OPTIMAL) / (LONGEST - OPTIMAL)
    passive = 30.0 * max(0.0, (norm - 1.2) / 0.8) ** 2
    if activation < 0.8:
        return passive
    low, high, here = (1.0 / (1.0 + math.exp((0.5 - x) / 0.15)) for x in (0.0, 1.0, (activation - 0.8) / 0.2))
    factor = math.exp(-(abs((norm**2.3 - 1.0) / 1.12) ** 1.61)) * (here - low) / (high - low)
    return ISOMETRIC * PARALLEL * factor * by_velocity(velocity / SERIES) + passive


def by_velocity(velocity: float) -> float:
    """Relative force of a sarcomere."""
    norm, debye = velocity / (1.15 * FASTEST), 3.0 / 11.0
    if norm > 1e-3:
        back = 1.0 / math.expm1(0.15 / norm)
        return (1.0 - math.exp(-0.15 / norm)) * (1.0 - debye * (norm / 0.15 - back) - norm)
    if norm > 0.0:
        return 1.0 - debye * norm / 0.15 - norm
    return 1.0 - 0.4 * norm / (0.4 / (1.0 + debye / 0.15) - norm)


def pull(angle: float, velocity: float, tendon: float, role: float, activation: float) -> tuple[float, float]:
    """Force (N) of a muscle with a tendon of some length (m), and the velocity (m/s) of that tendon."""
    strain, speed = STIFFNESS * max(0.0, tendon - SLACK), line_velocity(angle, velocity, role)

    def excess(force: float) -> float:
        return fibre(line(angle, role) - tendon, speed + (force - strain) / DAMPING, activation) - force

    force = brentq(excess, -1e-6, 1e4, xtol=1e-12) if excess(0.0) > 0.0 else 0.0
    return force, (force - strain) / DAMPING


def rates_without_tendons(_, state):
    angle, velocity = state
    forces = [
        max(0.0, fibre(line(angle, role), line_velocity(angle, velocity, role), activation))
        for role, activation in ((1.0, 0.9), (-1.0, 0.0))
    ]
    return [velocity, (ARM * (forces[0] - forces[1]) - WEIGHT * math.sin(angle)) / INERTIA]


def rates_with_tendons(_, state):
    angle, velocity, flexor, extensor = state
    (up, flexor_rate), (down, extensor_rate) = (
        pull(angle, velocity, flexor, 1.0, 0.9),
        pull(*state[:2], extensor, -1, 0),
    )
    return [velocity, (ARM * (up - down) - WEIGHT * math.sin(angle)) / INERTIA, flexor_rate, extensor_rate]


def first_turn(rates: Callable[..., list[float]], start: list[float]) -> float:
    """Angle (rad) at which the limb that falls turns first."""
    solution = solve_ivp(rates, (0.0, 0.5), start, events=lambda _, state: state[1], rtol=1e-8, atol=1e-10)
    return float(solution.y_events[0][0][0])


def settled_without_tendons() -> float:
    """Angle (rad) at which muscles and weight balance."""
    return brentq(lambda angle: rates_without_tendons(0.0, [angle, 0.0])[1], 0.0, 1.0, xtol=1e-14)


def settled_tendon(angle: float, role: float, activation: float) -> float:
    """Length (m) at which a tendon bears what its muscle pulls."""

    def excess(tendon: float) -> float:
        return fibre(line(angle, role) - tendon, 0.0, activation) - STIFFNESS * (tendon - SLACK)

    return brentq(excess, SLACK, 0.05, xtol=1e-15) if excess(SLACK) > 0.0 else SLACK


def settled_with_tendons() -> float:
    """The same angle with tendons."""

    def torque(angle: float) -> float:
        stretch = settled_tendon(angle, 1.0, 0.9) - settled_tendon(angle, -1.0, 0.0)
        return ARM * STIFFNESS * stretch - WEIGHT * math.sin(angle)

    return brentq(torque, 0.0, 1.0, xtol=1e-14)


def expected() -> dict[tuple[str, str], float]:
    """What every case must show, but for what is zero and what is set (turn at 30 degrees, limits, thresholds)."""
    angle, lax = settled_without_tendons(), settled_with_tendons()
    firing = (math.pi - 2 * math.asin(0.8)) / (2 * math.pi)
    falling = [START, -2.0]
    up, down = pushed(50.0, 1.1, 2.0).y[:, -1], pushed(-50.0, 1.1, 2.0).y[:, -1]
    return {
        ("3.2", "frequency (Hz)"): pendulum(1.1),
        ("3.3", "frequency (Hz)"): pendulum(9.81),
        ("3.4", "frequency (Hz)"): pendulum(9.81, 200.0),
        **{(name, "lowest angle (rad)"): -START for name in ("3.2", "3.3", "3.4")},
        ("3.5", "equilibrium (rad)"): math.asin(10 * ARM / WEIGHT),
        ("3.5", "frequency (Hz)"): swings(10.0),
        ("3.5", "lowest angle (rad)"): lower_turn(10.0),
        ("3.6", "angle after 2 s (rad)"): up[0],
        ("3.6", "velocity after 2 s (rad/s)"): up[1],
        ("3.6-range", "first instant at the limit (s)"): arrives(50.0, 1.5),
        ("3.7", "equilibrium (rad)"): -math.asin(10 * ARM / WEIGHT),
        ("3.7", "frequency (Hz)"): swings(-10.0),
        ("3.7", "lowest angle (rad)"): lower_turn(-10.0),
        ("3.8", "angle after 2 s (rad)"): down[0],
        ("3.8", "velocity after 2 s (rad/s)"): down[1],
        ("3.8-range", "first instant at the limit (s)"): arrives(-50.0, -1.5),
        ("3.9", "share of time flexor fires (1)"): firing,
        ("3.9", "share of time extensor fires (1)"): firing,
        ("3.10", "angle where it turns first (rad)"): first_turn(rates_without_tendons, falling),
        ("3.10", "angle at the end (rad)"): angle,
        ("3.10", "torque at the end (N m)"): WEIGHT * math.sin(angle),
        ("3.11", "flexor tendon at the end (m)"): settled_tendon(lax, 1.0, 0.9),
        ("3.11", "extensor tendon at the end (m)"): settled_tendon(lax, -1.0, 0.0),
        ("3.11", "angle where it turns first (rad)"): first_turn(rates_with_tendons, [*falling, 0.05, 0.05]),
        ("3.11", "angle at the end (rad)"): lax,
        ("3.11", "torque at the end (N m)"): WEIGHT * math.sin(lax),
    }


SET = {
    "highest angle (rad)": math.pi / 6,
    "lowest frequency of firing (Hz)": 5.0,
    "highest frequency of firing (Hz)": 15.0,
    "flexor tendon at the start (m)": 0.05,
    "extensor tendon at the start (m)": 0.05,
}


def test_expected_numbers_follow_from_mechanics():
    derived = expected()
    for case in CASES:
        limit = {"3.6-range": 1.5, "3.8-range": -1.5}.get(case.name)
        for quantity in case.quantities:
            key = case.name, quantity.name
            if quantity.expected == 0.0:
                assert key not in derived
            elif quantity.name in SET:
                assert quantity.expected == SET[quantity.name]
            elif limit is not None and "angle" in quantity.name:
                assert quantity.expected == limit
            else:
                assert quantity.expected == pytest.approx(derived.pop(key), abs=2e-7), key
    assert not derived


def test_tolerances_are_those_asked_for():
    for case in CASES:
        for quantity in case.quantities:
            if quantity.name == "frequency (Hz)":
                assert quantity.tolerance == pytest.approx(0.005 * quantity.expected)
            elif "(m)" in quantity.name or "(rad)" in quantity.name or "(N m)" in quantity.name:
                assert quantity.tolerance <= 1e-4


def test_all_cases_pass_by_the_whole_model_solve(capsys):
    assert main(["verify", "--whole", "--json"]) == 0
    findings = json.loads(capsys.readouterr().out)
    assert len(findings) == sum(len(case.quantities) for case in CASES)
    for finding in findings:
        assert list(finding) == ["case", "quantity", "expected", "found", "tolerance", "passed", "solver"]
        assert finding["passed"] is True
        assert finding["solver"] == "whole"
        assert abs(finding["found"] - finding["expected"]) <= finding["tolerance"]
    assert {finding["case"] for finding in findings} == {case.name for case in CASES}


def test_quick_cases_pass_by_the_graph_and_are_drawn(capfd, tmp_path, monkeypatch):
    pytest.importorskip("rclpy")
    monkeypatch.setenv("ROS_LOG_DIR", str(tmp_path / "log"))
    cases = ["--case", "3.4", "--case", "3.6-range"]
    assert main(["verify", "--graph", *cases, "--figures", str(tmp_path / "figures")]) == 0
    shown = capfd.readouterr().out
    assert "7 of 7 passed" in shown
    assert "whole" not in shown
    pictures = sorted(path.name for path in (tmp_path / "figures").iterdir())
    assert pictures == ["figure_3_4.png", "figure_3_6_range.png"]
    assert all(path.read_bytes().startswith(b"\x89PNG") for path in (tmp_path / "figures").iterdir())


@pytest.mark.parametrize(
    ("case", "right", "wrong", "failing"),
    [
        ("3.3", "com_distance: 0.175", "com_distance: 0.165", {"frequency (Hz)"}),
        ("3.5", "moment_arm: 0.0215", "moment_arm: 0.0216", {"equilibrium (rad)", "lowest angle (rad)"}),
        ("3.9", "activation_threshold: 0.8", "activation_threshold: 0.79", {"instants of wrong firing (1)"}),
    ],
)
def test_a_wrong_limb_fails(capsys, tmp_path, case, right, wrong, failing):
    for name in ("reference_joint.yaml", "reference_joint_tendon.yaml"):
        text = shipped(name).read_text(encoding="utf-8")
        assert right in text
        (tmp_path / name).write_text(text.replace(right, wrong), encoding="utf-8")
    assert main(["verify", "--whole", "--case", case, "--limbs", str(tmp_path), "--json"]) == 1
    failed = {finding["quantity"] for finding in json.loads(capsys.readouterr().out) if not finding["passed"]}
    assert failed >= failing
    assert main(["verify", "--whole", "--case", case, "--limbs", str(tmp_path)]) == 1
    assert "FAILED (whole)" in capsys.readouterr().out


def test_a_case_that_cannot_be_solved_fails_without_a_number():
    case = CASES[0]
    for finding in examine(case, "graph", None):
        assert not finding.passed
        assert finding.plain()["found"] is None


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--case", "3.12"], "--case is '3.12'; allowed: 3.2, 3.3"),
        (["--whole", "--graph"], "not allowed with"),
        (["--limbs", "nowhere"], "nowhere/reference_joint.yaml: no such file"),
        (["--figures", __file__], "cannot be made"),
    ],
)
def test_impossible_wishes_end_with_one_line(capsys, arguments, said):
    try:
        status = main(["verify", "--whole", *arguments])
    except SystemExit as end:
        status = end.code
    told = capsys.readouterr()
    assert status == 2
    assert told.out == ""
    assert told.err.startswith("limb: error: ")
    assert said in told.err
    assert told.err.count("\n") == 1


def test_another_limb_is_refused(tmp_path):
    text = (params_folder() / "arm.yaml").read_text(encoding="utf-8")
    (tmp_path / "reference_joint.yaml").write_text(text, encoding="utf-8")
    with pytest.raises(UserError, match="one segment and the muscles flexor, extensor"):
        CASES[0].build(tmp_path)


def test_the_limb_that_the_graph_gets_is_the_changed_one(tmp_path):
    for index, case in enumerate(CASES):
        limb, path = case.build(), tmp_path / f"{index}.yaml"
        write_limb(limb, path)
        assert load_limb(path) == limb


def test_a_swing_between_samples_is_measured():
    time = np.arange(0.0, 5.0, 1e-3)
    rate, middle = 2 * math.pi * 1.2345, 0.3
    swing = np.cos(rate * time + 0.1)[:, np.newaxis]
    course = Course(
        time=time,
        angle=middle + 0.5 * swing,
        velocity=-0.5 * rate * np.sin(rate * time + 0.1)[:, np.newaxis],
        acceleration=-0.5 * rate**2 * swing,
        torque=swing,
        activation=np.empty((len(time), 0)),
    )
    assert frequency(course) == pytest.approx(1.2345, rel=1e-5)
    assert lowest_turn(course) == pytest.approx(-0.2, abs=1e-7)
    assert highest_turn(course) == pytest.approx(0.8, abs=1e-7)
    assert balanced_angle(course) == pytest.approx(middle, abs=1e-6)
