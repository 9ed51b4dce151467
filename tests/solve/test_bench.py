"""A muscle on the bench against hand calculations and a second model of it."""

import json
import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from limb_nodes.cli import main
from limb_nodes.errors import UserError
from limb_nodes.model import load_limb, with_values
from limb_nodes.signals.length_course import read_length_course
from limb_nodes.solve.bench import Course, MuscleBench, isokinetic, isometric, ramp
from tests.independent.reference_joint import (
    DAMPING,
    FASTEST,
    OPTIMAL,
    SERIES,
    STRONGEST,
    fibre_force,
    force_on_tendon,
    settled_tendon,
    tension,
)

PARAMS = Path(__file__).parents[2] / "params"
RIGID, ELASTIC = PARAMS / "reference_joint.yaml", PARAMS / "reference_joint_tendon.yaml"


@pytest.fixture(scope="module")
def rigid():
    return MuscleBench(load_limb(RIGID), "flexor")


@pytest.fixture(scope="module")
def elastic():
    return MuscleBench(load_limb(ELASTIC), "flexor")


def steady(bench: MuscleBench, length: float) -> float:
    """Force of the held, fully excited muscle."""
    return float(bench.run(np.array([0.0, 0.1]), np.full(2, length), 1.0, initial="steady").force[-1])


class TestIsometric:
    @pytest.mark.parametrize("part", [0.6, 0.8, 1.0, 1.2, 1.5])
    def test_plateau(self, rigid, part):
        """F_max FL, and the passive force where the fibre is long."""
        length = part * OPTIMAL
        assert steady(rigid, length) == pytest.approx(fibre_force(length, 0.0, 1.0), rel=1e-12)

    def test_optimum(self, rigid):
        """Nothing but N_p F_S_max: 97.778 N."""
        assert steady(rigid, OPTIMAL) == pytest.approx(97.7778, rel=1e-5)

    @pytest.mark.parametrize("part", [0.8, 1.0, 1.2])
    def test_with_tendon(self, elastic, part):
        """Force of the fibre = force of the tendon, 1e5 N/m beyond 0.03 m."""
        length = part * OPTIMAL + 0.03
        assert steady(elastic, length) == pytest.approx(tension(settled_tendon(length, 1.0)), rel=1e-9)

    def test_settles_at_what_steady_gives(self, elastic):
        """Switched on at rest, the muscle ends where the steady start begins: 200 ms is the slowest time constant."""
        record = elastic.run(np.linspace(0.0, 3.0, 301), np.full(301, 0.14), 1.0)
        assert record.tendon_length[0] == 0.03
        assert np.all(np.diff(record.force[1:]) > -1e-9)
        assert record.force[-1] == pytest.approx(steady(elastic, 0.14), rel=1e-6)
        assert record.work == 0.0

    def test_no_excitation_no_force(self, elastic):
        record = elastic.run(np.array([0.0, 0.5]), np.full(2, 0.14), 0.0)
        assert record.force == pytest.approx(0.0, abs=1e-12)
        assert not record.frequency.any()

    def test_passive_rest_stretches_the_tendon(self, elastic):
        """Pulled beyond the slack of its passive force, the resting muscle hangs in its tendon."""
        record = elastic.run(np.array([0.0, 0.5]), np.full(2, 1.4 * OPTIMAL + 0.03), 0.0)
        assert record.force[0] > 5.0
        assert record.force[0] == pytest.approx(1e5 * (record.tendon_length[0] - 0.03), rel=1e-6)
        assert record.force == pytest.approx(np.full(2, record.force[0]), rel=1e-6)


class TestIsokinetic:
    @pytest.mark.parametrize("relative", [0.05, 0.2, 0.5, 0.9, -0.1, -0.5])
    def test_force_is_that_of_the_law(self, rigid, relative):
        """At the optimum, while passing it at a speed: 2.12."""
        speed = relative * FASTEST * SERIES
        first, last = OPTIMAL + 0.05 * speed, OPTIMAL - 0.05 * speed
        course = isokinetic(first, last, abs(speed))
        time = course.times(1000.0, 0.1)
        length, rate = course.at(time)
        record = rigid.run(time, length, 1.0, rate)
        middle = int(np.abs(time - 0.05).argmin())
        assert record.fibre_length[middle] == pytest.approx(OPTIMAL, rel=1e-12)
        assert record.muscle["fibre_velocity"][middle] == pytest.approx(speed, rel=1e-9)
        assert record.force[middle] == pytest.approx(fibre_force(OPTIMAL, speed, 1.0), rel=1e-9)
        # 0.1 V_max leaves 0.669, as the model's page has it; 0.5 leaves 0.1274.
        known = {0.5: 0.1274, -0.1: 1.152}
        if relative in known:
            assert record.force[middle] / STRONGEST == pytest.approx(known[relative], abs=5e-5)

    def test_a_muscle_cannot_push(self, rigid):
        """Faster than 1.0 V_max it goes slack."""
        speed = 1.3 * FASTEST * SERIES
        course = isokinetic(OPTIMAL, OPTIMAL - 0.02, speed)
        time = course.times(1000.0, 0.02 / speed)
        record = rigid.run(time, *(course.at(time)[0], 1.0))
        assert not record.force[:-1].any()


class TestRamp:
    def second_model(self, lengths, times: np.ndarray, start: float) -> np.ndarray:
        """Force of fibre and Voigt tendon in series, by scipy; the piecewise motion one piece at a time."""

        def force(time: float, tendon: float, slope: float, at: float, begin: float) -> float:
            return force_on_tendon(begin + slope * (time - at), -slope, 1.0, tendon)

        def rate(time: float, tendon: float, *piece: float) -> float:
            return (force(time, tendon, *piece) - tension(tendon)) / DAMPING

        forces, tendon = [], start
        for (at, begin), (until, end) in pairwise(lengths):
            slope = (end - begin) / (until - at)
            wanted = times[(times >= at) & ((times < until) | (until == lengths[-1][0]))]
            solved = solve_ivp(
                lambda t, y, slope=slope, at=at, begin=begin: [rate(t, y[0], slope, at, begin)],
                (at, until),
                [tendon],
                method="DOP853",
                rtol=1e-10,
                atol=1e-13,
                dense_output=True,
            )
            forces += [force(time, solved.sol(time)[0], slope, at, begin) for time in wanted]
            tendon = solved.y[0, -1]
        return np.array(forces)

    def test_against_a_second_model(self, elastic):
        knots = [(0.0, 0.146), (0.1, 0.146), (0.3, 0.138), (0.35, 0.142), (0.5, 0.142)]
        time = np.linspace(0.0, 0.5, 101)
        length = np.interp(time, *np.array(knots).T)
        record = elastic.run(time, length, 1.0, initial="file")
        expected = self.second_model(knots, time, 0.03)
        assert np.abs(record.force - expected).max() < 1e-6 * STRONGEST
        assert expected.min() < 20.0
        assert expected.max() > 100.0

    def test_curved_and_straight_pieces_meet(self, elastic):
        """A sine along its own slopes, and along many straight pieces."""
        fine = np.linspace(0.0, 0.4, 4001)
        coarse = fine[::100]

        def length(t):
            return 0.142 + 0.002 * np.sin(20.0 * t)

        curved = elastic.run(coarse, length(coarse), 0.95, 0.04 * np.cos(20.0 * coarse))
        straight = elastic.run(fine, length(fine), 0.95)
        assert np.abs(curved.tendon_length - straight.tendon_length[::100]).max() < 1e-7
        energy = np.trapezoid(curved.force * curved.muscle["muscle_tendon_velocity"], coarse)
        assert curved.work == pytest.approx(energy, abs=0.03 * np.abs(curved.force).max() * 0.002)


class TestInitialStates:
    def test_by_name(self, elastic):
        record = elastic.run(np.array([0.0, 1e-3]), np.full(2, 0.142), 1.0, initial={"tendon_length": 0.0305})
        assert record.internal[0].tolist() == [0.0305]
        assert elastic.state_names == ("tendon_length",)

    @pytest.mark.parametrize("initial", [{"nerve": 1.0}, "asleep"])
    def test_refuses(self, elastic, initial):
        with pytest.raises(UserError, match="allowed"):
            elastic.run(np.array([0.0, 1e-3]), np.full(2, 0.142), 1.0, initial=initial)


def test_numbers_are_taken_over(elastic):
    """`adopt` gives what a new bench gives, and refuses another structure."""
    limb = load_limb(ELASTIC)
    changed = with_values(limb, {"muscles[0].tendon.stiffness": 5e4})
    bench = MuscleBench(limb, "flexor")
    before = steady(bench, 0.145)
    bench.adopt(changed)
    assert steady(bench, 0.145) == steady(MuscleBench(changed, "flexor"), 0.145) != before
    with pytest.raises(ValueError, match="other laws"):
        bench.adopt(load_limb(RIGID))


def test_optimal_length(rigid, elastic):
    assert rigid.optimal_length() == pytest.approx(OPTIMAL, rel=1e-9)
    assert elastic.optimal_length() == pytest.approx(OPTIMAL + 0.03, rel=1e-9)


@pytest.mark.parametrize(
    ("time", "length", "excitation"),
    [
        ([0.0], [0.14], 1.0),
        ([0.0, 0.0], [0.14, 0.14], 1.0),
        ([0.0, 1.0], [0.14, -0.14], 1.0),
        ([0.0, 1.0], [0.14, math.nan], 1.0),
        ([0.0, 1.0], [0.14, 0.14], 1.2),
    ],
)
def test_refuses_what_cannot_be_followed(rigid, time, length, excitation):
    with pytest.raises(UserError, match="flexor"):
        rigid.run(np.array(time), np.array(length), excitation)


class TestCourses:
    def test_shapes(self):
        assert isometric(0.1).at(np.array([0.0, 5.0]))[0].tolist() == [0.1, 0.1]
        assert ramp(0.1, 0.2, 1.0, 2.0).at(np.array([0.5, 1.5, 3.0]))[0] == pytest.approx([0.1, 0.15, 0.2])
        assert isokinetic(0.2, 0.1, 0.05, 1.0).time.tolist() == [1.0, 3.0]

    def test_corners_are_sampled(self):
        time = ramp(0.1, 0.2, 0.0333, 0.2).times(10.0, 0.5)
        assert time == pytest.approx([0.0, 0.0333, 0.1, 0.2, 0.3, 0.4, 0.5])
        assert np.diff(time).min() > 1e-3

    def test_smooth(self):
        course = Course(np.array([0.0, 1.0, 2.0]), np.array([0.1, 0.2, 0.1]), smooth=True)
        length, rate = course.at(np.linspace(-0.5, 2.5, 61))
        assert length.max() == pytest.approx(0.2)
        assert rate[[0, -1]].tolist() == [0.0, 0.0]


class TestCommand:
    def test_summary_and_files(self, capsys, tmp_path):
        picture, table = tmp_path / "bench.png", tmp_path / "bench.csv"
        given = ["muscle", str(ELASTIC), "flexor", "--isokinetic", "0.145", "0.14", "0.05", "0.05"]
        assert main([*given, "-o", str(picture), "--csv", str(table)]) == 0
        shown = capsys.readouterr().out
        for expected in ("force", "fibre length", "tendon length", "frequency of unit", str(picture)):
            assert expected in shown
        assert picture.read_bytes()[:4] == b"\x89PNG"
        rows = np.genfromtxt(table, delimiter=",", names=True, deletechars="")
        assert rows["time_[s]"][-1] == pytest.approx(0.15)
        assert rows["muscle_tendon_length_[m]"][[0, -1]] == pytest.approx([0.145, 0.14])
        assert rows["muscle_force_[N]"].min() > 5.0

    def test_json(self, capsys):
        assert main(["muscle", str(RIGID), "flexor", "--duration", "0.1", "--json"]) == 0
        found = json.loads(capsys.readouterr().out)
        assert found["muscle"]["muscle_force"]["last"] == pytest.approx(97.7778, rel=1e-5)
        assert found["units"]["unit"]["stimulation_frequency"]["highest"] == pytest.approx(15.0)

    def test_lengths_from_a_file(self, capsys, tmp_path):
        file = tmp_path / "lengths.csv"
        file.write_text("time [s],length [mm]\n1.0,113\n1.1,114\n1.2,113\n")
        time, length = read_length_course(file)
        assert time == pytest.approx([0.0, 0.1, 0.2])
        assert length == pytest.approx([0.113, 0.114, 0.113])
        assert main(["muscle", str(RIGID), "flexor", "--lengths", str(file), "--json"]) == 0
        found = json.loads(capsys.readouterr().out)
        assert found["duration"] == pytest.approx(0.2)
        assert found["muscle"]["muscle_tendon_length"]["highest"] == pytest.approx(0.114)

    @pytest.mark.parametrize(
        ("given", "said"),
        [
            (["--isometric", "0"], "isometric"),
            (["--ramp", "0.1", "0.2", "1", "0.5"], "end"),
            (["--isokinetic", "0.1", "0.1", "0.05", "0"], "different"),
            (["--isokinetic", "0.1", "0.2", "-1", "0"], "speed"),
            (["--activation", "1.5"], "[0, 1]"),
            (["--activation", "flexor=0.5,flexor=1"], "twice"),
            (["--rate", "0"], "rate"),
            (["--duration", "-1"], "duration"),
            (["--lengths", "nowhere.csv"], "nowhere.csv"),
            (["--straight"], "--lengths"),
            (["-o", "picture.txt"], ".png"),
            (["--csv", "nowhere/table.csv"], "nowhere"),
        ],
    )
    def test_refuses_in_one_line(self, capsys, given, said):
        assert main(["muscle", str(RIGID), "flexor", *given]) == 2
        error = capsys.readouterr().err
        assert error.startswith("limb: error: ")
        assert error.count("\n") == 1
        assert said in error

    def test_refuses_an_unknown_muscle(self, capsys):
        assert main(["muscle", str(RIGID), "triceps"]) == 2
        assert "flexor, extensor" in capsys.readouterr().err

    @pytest.mark.parametrize(
        ("text", "said"),
        [
            ("time,load\n0,1\n1,1\n", "length"),
            ("length\n1\n1\n", "time"),
            ("time,length [m]\n0,0.1\n0,0.1\n", "line 3"),
            ("time,length [m]\n0,0.1\n1,-0.1\n", "line 3"),
            ("time,length [deg]\n0,0.1\n1,0.1\n", "deg"),
            ("time,length\n0,0.1\n", "2"),
        ],
    )
    def test_refuses_files(self, tmp_path, text, said):
        file = tmp_path / "lengths.csv"
        file.write_text(text)
        with pytest.raises(UserError, match=said):
            read_length_course(file)
