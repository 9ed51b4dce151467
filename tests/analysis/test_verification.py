"""The cases of the report's section 3.3: what they expect, that the model shows it, and that a wrong limb does not."""

from __future__ import annotations

import json
import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from limb_nodes.analysis.trajectory import Trajectory
from limb_nodes.analysis.verification import CASES, balanced_angle, frequency, highest_turn, lowest_turn, measure
from limb_nodes.cli import main
from limb_nodes.commands.verify import write_limb
from limb_nodes.errors import UserError
from limb_nodes.model import load_limb
from limb_nodes.model.shipped import params_folder, shipped
from tests.independent.reference_joint import (
    ABOUT_JOINT,
    ARM,
    COM,
    GRAVITY,
    MASS,
    START,
    WEIGHT,
    equilibrium,
    pendulum,
    rates,
)

TIGHT = {"method": "DOP853", "rtol": 1e-11, "atol": 1e-12}


def pushed(force: float, gravity: float, until: float, event: Callable[..., float] | None = None):
    """The limb under a constant muscle force (N, negative in the extensor)."""

    def free(_, state):
        return [state[1], (force * ARM - MASS * gravity * COM * math.sin(state[0])) / ABOUT_JOINT]

    return solve_ivp(free, (0.0, until), [START, 0.0], events=event, **TIGHT)


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


def first_turn(tendons: bool) -> float:
    """Angle (rad) at which the limb that falls turns first, its flexor held at 0.9."""
    start = [START, -2.0, *([0.05, 0.05] if tendons else [])]
    falling = rates(lambda _: (0.9, 0.0), tendons)
    solution = solve_ivp(falling, (0.0, 0.5), start, events=lambda _, state: state[1], rtol=1e-8, atol=1e-10)
    return float(solution.y_events[0][0][0])


def expected() -> dict[tuple[str, str], float]:
    """What every case must show, but for what is zero and what is set (turn at 30 degrees, limits, thresholds)."""
    (stiff, _), (lax, (flexor, extensor)) = (equilibrium((0.9, 0.0), tendons) for tendons in (False, True))
    firing = (math.pi - 2 * math.asin(0.8)) / (2 * math.pi)
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
        ("3.10", "angle where it turns first (rad)"): first_turn(tendons=False),
        ("3.10", "angle at the end (rad)"): stiff,
        ("3.10", "torque at the end (N m)"): WEIGHT * math.sin(stiff),
        ("3.11", "flexor tendon at the end (m)"): flexor,
        ("3.11", "extensor tendon at the end (m)"): extensor,
        ("3.11", "angle where it turns first (rad)"): first_turn(tendons=True),
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
    for finding in measure(case, "graph", None):
        assert not finding.passed
        assert finding.plain()["found"] is None


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--case", "3.12"], "--case is '3.12'; one of 3.2, 3.3"),
        (["--whole", "--graph"], "not allowed with"),
        (["--limbs", "nowhere"], "nowhere/reference_joint.yaml: no such file"),
        (["--figures", __file__], "cannot be written"),
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
    trajectory = Trajectory(
        time=time,
        angle=middle + 0.5 * swing,
        velocity=-0.5 * rate * np.sin(rate * time + 0.1)[:, np.newaxis],
        acceleration=-0.5 * rate**2 * swing,
        torque=swing,
        activation=np.empty((len(time), 0)),
    )
    assert frequency(trajectory) == pytest.approx(1.2345, rel=1e-5)
    assert lowest_turn(trajectory) == pytest.approx(-0.2, abs=1e-7)
    assert highest_turn(trajectory) == pytest.approx(0.8, abs=1e-7)
    assert balanced_angle(trajectory) == pytest.approx(middle, abs=1e-6)
