"""The electromechanical delay: the same tick by tick and in arrays, in the graph and in the whole-model solve."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from limb_nodes import cli
from limb_nodes.errors import UserError
from limb_nodes.exchange.past import expected_topics, past_of
from limb_nodes.exchange.ticks import Ticks
from limb_nodes.model import load_limb, with_values
from limb_nodes.solve.bench import MuscleBench
from limb_nodes.solve.delay import DelayLine, delayed
from limb_nodes.solve.ensemble import Ensemble
from limb_nodes.solve.whole import WholeModel
from tests.exchange.parts import cut, run_parts

PARAMS = Path(__file__).resolve().parents[2] / "params"
RATE = 500.0
EVERY = expected_topics({"state_every": 1})
# A whole number of ticks, and none.
DELAYS = {"muscles[0].delay": 0.04, "muscles[1].delay": 0.0333}


@cache
def limb(name: str = "reference_joint_tendon"):
    return with_values(load_limb(PARAMS / f"{name}.yaml"), DELAYS)


def waves(count: int, rate: float = RATE) -> np.ndarray:
    time = np.arange(count)[:, np.newaxis] / rate
    return 0.9 + 0.1 * np.sin(9.0 * time + np.array([0.0, 1.0]))


@given(
    st.lists(st.floats(0.0, 12.0) | st.integers(0, 12).map(float), min_size=1, max_size=3),
    st.integers(1, 40),
    st.integers(0, 39),
)
def test_tick_by_tick_and_in_arrays(delays, count, asked):
    """To the last bit; also if a tick is asked for again when the next is there, and from what is remembered."""
    rng = np.random.default_rng(count)
    samples, line = rng.random((count, len(delays))), DelayLine(np.array(delays))
    whole = delayed(samples, delays, 0, count)
    for tick in range(count):
        np.testing.assert_array_equal(line.reach(tick, samples[tick]), whole[tick])
        if tick:
            np.testing.assert_array_equal(line.reach(tick - 1, samples[tick - 1]), whole[tick - 1])
        if tick == asked:
            other = DelayLine(np.array(delays))
            other.remember(line.remembered)
            line = other
    start = min(asked, count - 1)
    np.testing.assert_array_equal(delayed(samples, delays, start, count), whole[start:])
    for muscle, delay in enumerate(delays):
        ticks = np.arange(count)
        np.testing.assert_allclose(whole[:, muscle], np.interp(ticks - delay, ticks, samples[:, muscle]), atol=1e-12)


def test_a_tick_that_is_lost_leaves_what_was():
    line = DelayLine(np.array([2.0]))
    found = [line.reach(tick, np.array([float(tick)]))[0] for tick in (0, 1, 4, 5, 6, 20, 21, 22)]
    assert found == [0.0, 0.0, 1.0, 1.0, 4.0, 6.0, 6.0, 20.0]


def test_the_whole_model_gets_the_input_later():
    given, plain = waves(301), load_limb(PARAMS / "reference_joint_tendon.yaml")
    found = WholeModel(limb()).simulate(given, RATE)
    shifted = delayed(given, [20.0, 16.65], 0, 301)
    wanted = WholeModel(plain).simulate(shifted, RATE)
    np.testing.assert_array_equal(found.angle, wanted.angle)
    np.testing.assert_array_equal(found.muscle["activation"], shifted)
    np.testing.assert_array_equal(found.excitation, given)
    parts = list(WholeModel(limb()).simulate_in_parts(given, RATE))
    np.testing.assert_array_equal(np.concatenate([part.angle for part in parts]), found.angle)


def test_the_nodes_get_it_as_late():
    given = waves(301)
    sent, dynamics = run_parts(limb(), given, Ticks(RATE))
    whole = WholeModel(limb()).simulate(given, RATE)
    assert np.abs(dynamics.stepper.angle - whole.angle[-1]).max() < 1e-4
    assert np.ptp(whole.angle) > 0.1
    # Not those of a limb without delays.
    plain = WholeModel(load_limb(PARAMS / "reference_joint_tendon.yaml")).simulate(given, RATE)
    assert np.abs(plain.angle[-1] - whole.angle[-1]).max() > 1e-3
    assert {topic for topic, _ in sent} >= {"activation", "muscle_checkpoint"}


@pytest.mark.parametrize("tick", [0, 1, 5, 255, 256, 257, 280, 299])
def test_a_run_with_delays_goes_on_where_it_was_cut_short(tick):
    given, ticks = waves(301), Ticks(RATE)
    whole, _ = run_parts(limb(), given, ticks)
    past = past_of(cut(whole, tick), EVERY, ticks.nanoseconds)
    rest, _ = run_parts(limb(), given, ticks, past)
    for topic in EVERY:
        recorded, after, wanted = (
            [data for one, data in some if one == topic] for some in (cut(whole, tick), rest, whole)
        )
        assert recorded[: past.counts[topic]] + after == wanted, topic


def test_ensembles_may_change_it():
    given = waves(201)
    samples = [{"muscles[0].delay": 0.0}, {"muscles[0].delay": 0.1}, {"muscles[1].delay": 0.05}]
    found = list(Ensemble(limb(), given, RATE).solve(samples))
    for sample, (_, solution) in zip(samples, found, strict=True):
        wanted = WholeModel(with_values(limb(), sample)).simulate(given, RATE)
        np.testing.assert_allclose(solution.angle, wanted.angle, rtol=0, atol=1e-9)


def test_the_bench_waits_as_long():
    bench = MuscleBench(limb("reference_joint"), "flexor")
    time = np.arange(401) / 1000.0
    force = bench.run(time, np.full(401, 0.1134), np.where(time < 0.1, 0.0, 1.0)).force
    assert force[139] < 0.01 * force[141]
    assert force[141] == pytest.approx(force[-1])


REFUSED = {
    "negative": (-0.01, "delay is -0.01; a number >= 0 and <= 1 in s is needed"),
    "above a second": (1.5, "delay is 1.5"),
    "no number": ("soon", "delay is 'soon'"),
}


@pytest.mark.parametrize(("delay", "said"), REFUSED.values(), ids=REFUSED)
def test_refused(delay, said):
    with pytest.raises(UserError) as caught:
        with_values(load_limb(PARAMS / "reference_joint.yaml"), {"muscles[1].delay": delay})
    assert f"muscles[1].{said}" in str(caught.value)


def test_an_input_that_is_shorter(tmp_path, capsys):
    file = tmp_path / "limb.yaml"
    text = (PARAMS / "reference_joint.yaml").read_text()
    assert text.count("  - name: flexor\n") == 1
    file.write_text(text.replace("  - name: flexor\n", "  - name: flexor\n    delay: 0.3\n"))
    given = ["--activation", "flexor=0.9,extensor=0", "--duration", "0.2"]
    for command in (["simulate", str(file), *given], ["run", str(file), *given, "--out", str(tmp_path / "out")]):
        assert cli.main(command) == 2
        said = capsys.readouterr().err
        assert "muscles[0].delay is 0.3 s; the input lasts 0.2 s, and less than that is needed" in said
        assert said.count("\n") == 1
    with pytest.raises(UserError, match=r"muscles\[0\].delay is 0.3 s"):
        Ensemble(load_limb(file), waves(11), 100.0)
