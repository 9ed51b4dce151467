"""Impacts within ticks: the limb asks the muscles for the torque behind each, and the run is the whole model's."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from limb_nodes.exchange.movement import LimbPart
from limb_nodes.exchange.muscles import MusclePart
from limb_nodes.exchange.past import Past, expected_topics, past_of
from limb_nodes.exchange.ticks import Ticks
from limb_nodes.model import parse_limb
from limb_nodes.solve.whole import WholeModel
from tests.exchange.parts import IDENTITY, cut, run_parts
from tests.independent.random_limb import RandomLimb

SECONDS = 0.6
EVERY = expected_topics({})
# With several impacts each: 5, 4, 5, 3, 5 and, from 100 on, 6 joints.
SEEDS = (0, 5, 7, 6, 13, 109)


def random_limb(seed: int) -> RandomLimb:
    return RandomLimb(seed, joints=6 if seed >= 100 else 0)


@cache
def limb_of(seed: int):
    return parse_limb(random_limb(seed).yaml(), "random.yaml")


def run(seed: int, rate: float, past: Past | None = None):
    return run_parts(limb_of(seed), random_limb(seed).excitation(rate, SECONDS), Ticks(rate), past)


@cache
def undisturbed(seed: int, rate: float):
    return run(seed, rate)


def angles(sent, dynamics) -> np.ndarray:
    return np.array(
        [dynamics.values("movement_pattern", data, "angle") for topic, data in sent if topic == "movement_pattern"]
    )


@pytest.mark.parametrize(("rate", "tolerance"), [(1000.0, 5e-4), (200.0, 5e-3)])
@pytest.mark.parametrize("seed", SEEDS)
def test_the_movement_is_that_of_the_whole_model(seed, rate, tolerance):
    sent, dynamics = undisturbed(seed, rate)
    assert dynamics.impacts > 0
    asked, answered = ([data for topic, data in sent if topic == one] for one in ("limb_impact", "impact_torque"))
    assert len(asked) == len(answered) == dynamics.impacts
    whole = WholeModel(limb_of(seed)).simulate(random_limb(seed).excitation(rate, SECONDS), rate, observe=False)
    assert np.abs(angles(sent, dynamics) - whole.angle).max() < tolerance / 10


def test_an_impact_tells_when_and_how_it_jolts_the_joints():
    sent, dynamics = undisturbed(0, 200.0)
    form = dynamics.forms["limb_impact"]
    limb, before = limb_of(0), -1.0
    for number, data in enumerate(data for topic, data in sent if topic == "limb_impact"):
        assert form.number(data, "tick") == number
        time = float(form.values(data, "time"))
        assert 0.0 <= time < 1.0 / 200.0
        now = form.number(data, "of_tick") / 200.0 + time
        assert now >= before
        before = now
        angle, old, new = (form.values(data, name) for name in ("angle", "velocity_before", "velocity_after"))
        assert np.abs(new - old).max() > 1e-2
        on_end = [
            segment.joint_range is not None and min(abs(one - end) for end in segment.joint_range) < 1e-9
            for segment, one in zip(limb.segments, angle, strict=True)
        ]
        stopped = [where and was != 0.0 and now_ == 0.0 for where, was, now_ in zip(on_end, old, new, strict=True)]
        assert any(stopped)


@pytest.mark.parametrize("seed", SEEDS[:3])
def test_a_run_goes_on_behind_impacts(seed):
    """Cut at each tick near an impact, and at some others: the rest is the same to the last bit."""
    rate = 1000.0
    whole, dynamics = undisturbed(seed, rate)
    form = dynamics.forms["limb_impact"]
    near = {form.number(data, "of_tick") for topic, data in whole if topic == "limb_impact"}
    cuts = {tick + shift for tick in near for shift in (-1, 0, 1, 2, 3)} | {1, 128, 129, 300, 599}
    fell_back = 0
    for tick in sorted(one for one in cuts if 0 < one <= 600):
        recorded = cut(whole, tick)
        past = past_of(recorded, EVERY, Ticks(rate).nanoseconds)
        fell_back += past.tick < tick - 1
        assert past.impacts <= dynamics.impacts
        rest, _ = run(seed, rate, past)
        for topic in EVERY:
            first = [data for one, data in recorded if one == topic][: past.counts[topic]]
            second = [data for one, data in rest if one == topic]
            assert [data for one, data in whole if one == topic] == first + second, (tick, topic)
    assert fell_back


def test_what_is_asked_twice_is_answered_once():
    """A limb that is started anew asks again; the muscles have answered, and their answer is kept by the transport."""
    whole, _ = undisturbed(5, 1000.0)
    common = {"limb": limb_of(5), "ticks": Ticks(1000.0), "identity": IDENTITY}
    muscles = MusclePart(**common)
    answers: list[bytes] = []
    muscles.outgoing["impact_torque"].send = answers.append
    for topic, data in whole:
        if topic in muscles.streams:
            muscles.receive(topic, data)
            muscles.receive(topic, data)
    assert answers == [data for topic, data in whole if topic == "impact_torque"]
    assert muscles.conflicts == muscles.bad_input == 0


def test_without_ends_of_ranges_nothing_is_asked():
    text = random_limb(5).yaml()
    free = "\n".join(line.split(", range:")[0] + "}" if ", range:" in line else line for line in text.splitlines())
    assert free != text
    limb = parse_limb(free, "free.yaml")
    part = LimbPart(limb=limb, ticks=Ticks(1000.0), identity=IDENTITY)
    assert not part.stepper.model.limited
