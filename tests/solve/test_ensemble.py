"""Many samples of a limb: the same numbers as one by one, whatever threads or cluster solve them."""

import math
import os
import threading
import time

import numpy as np
import pytest

from limb_nodes.errors import UserError
from limb_nodes.model import with_values
from limb_nodes.model.layout import build_layout
from limb_nodes.solve.ensemble import AHEAD, CHUNK, Ensemble, Solution
from limb_nodes.solve.variants import Variants
from limb_nodes.solve.whole import WholeModel

NAME = "reference_joint_tendon"
RATE = 200.0
TIME = np.arange(101) / RATE
EXCITATION = np.stack([np.clip(np.sin(7 * TIME), 0, 1), np.clip(np.cos(7 * TIME), 0, 1)], axis=1)
SAMPLES = [
    {"muscles[0].tendon.stiffness": 9e4},
    {"muscles[0].tendon.stiffness": 1.1e5, "segments[0].angle": 0.3},
    {"segments[0].velocity": 0.5, "segments[0].mass": 1.1},
    {"sarcomeres.psoas.power_stroke": 1e-8, "unit_kinds.slow.maximum_passive_force": 25.0},
    {"unit_kinds.slow.maximum_frequency": 16.0},
    {"muscles[1].units[0].force_frequency.width": 0.2, "tip_torque": 0.1},
    {"muscles[0].activation_threshold": 0.7, "gravity": [0.0, -1.6]},
    {"muscles[1].tendon.slack_length": 0.031},
]
# Another structure, so another program.
OTHER = {"muscles[0].units[0].count": 2, "muscles[0].units[0].name": "twin"}


def one_by_one(limb, values, tolerance=1e-9):
    """A sample solved the full way."""
    return WholeModel(with_values(limb, values)).simulate(EXCITATION, RATE, tolerance=tolerance)


@pytest.mark.parametrize("threads", [1, 3])
def test_samples_are_solved_as_one_by_one(threads, limb_named):
    limb = limb_named(NAME)
    found = list(Ensemble(limb, EXCITATION, RATE).solve(SAMPLES, threads=threads))
    assert [index for index, _ in found] == list(range(len(SAMPLES)))
    for (_, solution), values in zip(found, SAMPLES, strict=True):
        expected = one_by_one(limb, values)
        np.testing.assert_array_equal(solution.angle, expected.angle)
        np.testing.assert_array_equal(solution.velocity, expected.velocity)
        np.testing.assert_array_equal(solution.internal, expected.internal)
        np.testing.assert_array_equal(solution.time, expected.time)
        assert solution.steps == expected.steps
    assert len({solution.angle[-1, 0] for _, solution in found}) >= len(SAMPLES) - 1


@pytest.mark.parametrize("values", SAMPLES)
def test_a_variant_has_the_numbers_of_a_limb_that_is_built_anew(values, limb_named):
    limb = limb_named(NAME)
    variants = Variants(limb)
    for _ in range(2):
        model = variants.model(values)
        built = build_layout(with_values(limb, values))
        assert model.program is variants.base.program
        assert model.layout.model.tobytes() == built.model.tobytes()
        np.testing.assert_array_equal(model.layout.initial_states, built.initial_states)


def test_a_sample_may_have_another_structure(limb_named):
    limb = limb_named(NAME)
    variants = Variants(limb)
    model = variants.model(OTHER)
    assert model.layout.units == 3
    assert model.layout.model.tobytes() == build_layout(with_values(limb, OTHER)).model.tobytes()


def test_arrays_give_the_same_as_mappings(limb_named):
    limb = limb_named(NAME)
    angles, masses = np.linspace(0.2, 0.6, 5), np.linspace(1.0, 1.4, 5)
    columns = {"segments[0].angle": angles, "segments[0].mass": masses}
    rows = [{"segments[0].angle": a, "segments[0].mass": m} for a, m in zip(angles, masses, strict=True)]
    for (_, one), (_, two) in zip(
        Ensemble(limb, EXCITATION, RATE).solve(columns),
        Ensemble(limb, EXCITATION, RATE).solve(iter(rows)),
        strict=True,
    ):
        np.testing.assert_array_equal(one.angle, two.angle)
    with pytest.raises(UserError, match="differ in length"):
        list(Ensemble(limb, EXCITATION, RATE).solve({**columns, "segments[0].velocity": np.zeros(4)}))


def test_times_of_the_output(limb_named):
    limb = limb_named(NAME)
    whole = one_by_one(limb, {})
    for rows in ([0, 40, 100], [37, 90]):
        [(_, found)] = Ensemble(limb, EXCITATION, RATE).solve([{}], times=TIME[rows])
        np.testing.assert_allclose(found.time, TIME[rows])
        # Not on a sample of the input too, from the integrator's own interpolant.
        np.testing.assert_allclose(found.angle, whole.angle[rows], atol=1e-9)
        assert isinstance(found, Solution)


def test_a_function_of_the_movement(limb_named):
    limb = limb_named(NAME)
    samples = {"segments[0].angle": np.array([0.2, 0.4])}
    found = list(
        Ensemble(limb, EXCITATION, RATE).solve(samples, function=lambda m: float(m.muscle["muscle_force"].max()))
    )
    for (_, force), angle in zip(found, samples["segments[0].angle"], strict=True):
        assert force == one_by_one(limb, {"segments[0].angle": angle}).muscle["muscle_force"].max()


WRONG = [
    ({"muscles[0].tendon.stiffness": -1.0}, r"muscles\[0\].tendon.stiffness is -1.0; a number > 0"),
    ({"muscles[0].tendon.stiffness": math.nan}, r"stiffness is nan; a number"),
    ({"muscles[7].tendon.stiffness": 1e5}, r"muscles\[7\].tendon.stiffness is not a place"),
    ({"segments[0].angle": "up"}, r"angle is 'up'; a number"),
    ({"muscles[0].tendon.slack_length": 0.5}, r"slack_length is 0.5; a number < "),
    ({"sarcomeres.psoas.actin_length": 1e-7}, r"sarcomere"),
]


@pytest.mark.parametrize("ordered", [True, False])
def test_an_error_of_one_sample_is_its_result(ordered, limb_named):
    limb = limb_named(NAME)
    good = {"muscles[0].tendon.stiffness": 9e4, "segments[0].angle": 0.4}
    samples = [good, *(values for values, _ in WRONG), good]
    found = dict(Ensemble(limb, EXCITATION, RATE).solve(samples, ordered=ordered))
    assert sorted(found) == list(range(len(samples)))
    for (_, words), problem in zip(WRONG, (found[1 + k] for k in range(len(WRONG))), strict=True):
        assert isinstance(problem, UserError)
        with pytest.raises(UserError, match=words):
            raise problem
    np.testing.assert_array_equal(found[0].angle, found[len(samples) - 1].angle)


def test_an_error_of_a_function_is_a_result(limb_named):
    def picky(movement):
        if movement.angle[0, 0] > 0.3:
            raise ValueError("too far")
        return "near"

    samples = {"segments[0].angle": np.array([0.2, 0.4, 0.25])}
    found = [result for _, result in Ensemble(limb_named(NAME), EXCITATION, RATE).solve(samples, function=picky)]
    assert found[0] == found[2] == "near"
    assert isinstance(found[1], ValueError)


def test_the_range_of_a_joint_holds_for_its_start(limb_named):
    limb = limb_named(NAME, {"segments[0].range": [0.0, 1.0]})
    samples = {"segments[0].angle": np.array([0.9, 1.1])}
    (_, fine), (_, problem) = Ensemble(limb, EXCITATION, RATE).solve(samples)
    assert isinstance(fine, Solution)
    assert "a number within range" in str(problem)


def test_few_samples_are_under_way(limb_named):
    """An endless stream of samples is read only as far as results are taken."""
    read = threading.Semaphore(0)

    def endless():
        while True:
            read.release()
            yield {"segments[0].angle": 0.3}

    results = Ensemble(limb_named(NAME), EXCITATION, RATE).solve(endless(), threads=2)
    for _ in range(5):
        next(results)
    results.close()
    count = 0
    while read.acquire(blocking=False):
        count += 1
    assert count <= 5 + 2 * AHEAD


def test_what_no_sample_can_be_solved_with_is_refused_at_once(limb_named):
    limb = limb_named(NAME)
    for change, words in (
        ({"excitation": EXCITATION[:, :1]}, "excitation has the shape"),
        ({"rate": 0.0}, "rate is 0"),
        ({"method": "magic"}, "auto or explicit or implicit is needed"),
        ({"threads": 0}, "threads is 0"),
        ({"times": [0.2, 0.1]}, "times leave the input"),
        ({"times": [0.0, 9.0]}, "times leave the input"),
        ({"times": [0.1], "function": len}, "times is given, and function too"),
    ):
        given = {"excitation": EXCITATION, "rate": RATE, **change}
        asked = {name: given.pop(name) for name in ("threads", "times", "function") if name in given}
        with pytest.raises(UserError, match=words):
            Ensemble(limb, **given).solve([{}], **asked)


def test_numbers_that_units_share_reach_their_group(limb_named):
    limb = limb_named("arm")
    values = {"unit_kinds.slow.force_length.rho": 1.7}
    model = Variants(limb).model(values)
    assert model.layout.model.tobytes() == build_layout(with_values(limb, values)).model.tobytes()


@pytest.fixture(scope="module")
def cluster():
    """A Dask cluster of two processes on this machine."""
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(
            n_workers=2, processes=True, threads_per_worker=1, host="127.0.0.1", dashboard_address=None
        ) as local,
        distributed.Client(local) as client,
    ):
        yield client


@pytest.mark.parametrize("ordered", [True, False])
def test_a_cluster_gives_the_same(ordered, cluster, limb_named):
    limb = limb_named(NAME)
    samples = [*SAMPLES, WRONG[0][0], *({"segments[0].angle": 0.2 + 0.01 * k} for k in range(60))]
    here = dict(Ensemble(limb, EXCITATION, RATE).solve(samples))
    found = list(Ensemble(limb, EXCITATION, RATE).solve(samples, client=cluster, ordered=ordered))
    assert sorted(index for index, _ in found) == list(range(len(samples)))
    if ordered:
        assert [index for index, _ in found] == list(range(len(samples)))
    for index, solution in found:
        if isinstance(here[index], Solution):
            np.testing.assert_array_equal(solution.angle, here[index].angle)
        else:
            assert type(solution) is type(here[index])
            assert str(solution) == str(here[index])


def test_a_cluster_works_in_its_own_processes(cluster, limb_named, tmp_path):
    samples = {"segments[0].angle": np.linspace(0.2, 0.5, 6 * CHUNK)}

    # A function that travels by value: the tests are no module that a worker can import.
    def own(movement):
        """The process, once two have come so far: none can do the work of both."""
        (tmp_path / str(os.getpid())).touch()
        end = time.monotonic() + 300.0
        while len(list(tmp_path.iterdir())) < 2 and time.monotonic() < end:
            time.sleep(0.01)
        return os.getpid()

    results = Ensemble(limb_named(NAME), EXCITATION, RATE).solve(samples, client=cluster, function=own)
    processes = {process for _, process in results}
    assert len(processes) == 2
    assert os.getpid() not in processes
