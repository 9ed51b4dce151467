"""A run that goes on from what is recorded has the values of an undisturbed one, to the last bit."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from limb_nodes.errors import UserError
from limb_nodes.exchange.movement import LimbPart
from limb_nodes.exchange.past import Past, expected_topics, past_of
from limb_nodes.exchange.recorded import RecordedRun, join_parts
from limb_nodes.exchange.stream import CHECKPOINT
from limb_nodes.exchange.ticks import Ticks
from limb_nodes.model import load_limb
from limb_nodes.model.limb import Limb
from tests.exchange.parts import IDENTITY, Message, cut, run_parts

ROOT = Path(__file__).resolve().parents[2]
LIMBS = [*sorted((ROOT / "params").glob("*_joint*.yaml")), ROOT / "params/pennate_leg.yaml"]
ALTERNATIVES = ROOT / "tests/levels/alternatives.yaml"
TWO_JOINTS = ROOT / "tests/levels/two_joint_leg.yaml"
TICKS = Ticks(500.0)
FINAL = 3 * CHECKPOINT
EVERY = expected_topics({"state_every": 3})
# Ticks at which a run is cut short: the first, before, at and behind a checkpoint, between two, before the last.
CUTS = [0, 1, CHECKPOINT - 1, CHECKPOINT, CHECKPOINT + 1, 2 * CHECKPOINT + 50, FINAL - 1]


def run(limb: Limb, past: Past | None = None) -> list[Message]:
    """The messages of a run, or of what follows a past."""
    phase = 0.03 * np.arange(FINAL + 1)[:, np.newaxis] + np.arange(len(limb.muscles))
    return run_parts(limb, 0.5 + 0.5 * np.sin(phase), TICKS, past, state_every=3)[0]


def by_topic(messages: list[Message]) -> dict[str, list[bytes]]:
    return {topic: [data for one, data in messages if one == topic] for topic in EVERY}


@cache
def undisturbed(file: Path) -> tuple[Limb, list[Message]]:
    limb = load_limb(file)
    return limb, run(limb)


@pytest.mark.parametrize("file", [*LIMBS, ALTERNATIVES, TWO_JOINTS], ids=lambda path: path.stem)
def test_a_run_goes_on_where_it_was_cut_short(file):
    limb, whole = undisturbed(file)
    for tick in CUTS:
        recorded = cut(whole, tick)
        past = past_of(recorded, EVERY, TICKS.nanoseconds)
        struck = [data for topic, data in recorded if topic == "limb_impact"]
        # Behind a tick with an impact within, only from the next checkpoint on.
        assert past.tick == tick - 1 or len(struck) > past.impacts
        assert len(past.messages["joint_torque"]) <= 2 * CHECKPOINT
        rest = by_topic(run(limb, past))
        for topic, messages in by_topic(whole).items():
            assert messages == by_topic(recorded)[topic][: past.counts[topic]] + rest[topic], (tick, topic)


def test_what_is_behind_a_gap_is_not_used():
    _, whole = undisturbed(LIMBS[0])
    torques = [k for k, (topic, _) in enumerate(whole) if topic == "joint_torque"]
    lacking = [message for k, message in enumerate(whole) if k != torques[200]]
    past = past_of(lacking, EVERY, TICKS.nanoseconds)
    assert (past.tick, past.counts["joint_torque"], past.counts["muscle_state"]) == (199, 200, 67)
    assert past.muscles is not None
    assert past.muscles[0] == CHECKPOINT


def test_what_another_version_has_recorded_is_refused_in_words():
    """One whose movement patterns did not tell the impacts."""
    limb, whole = undisturbed(LIMBS[0])
    part = LimbPart(limb=limb, ticks=TICKS, identity=IDENTITY)
    start = part.forms["movement_pattern"].numbers["impacts"][0]
    recorded = [
        (topic, data[:start] + data[start + 8 :] if topic == "movement_pattern" else data)
        for topic, data in cut(whole, 40)
    ]
    past = past_of(recorded, EVERY, TICKS.nanoseconds)
    with pytest.raises(
        UserError, match=r"the recorded movement_pattern .*; a bag that was recorded by this version is"
    ):
        part.take_up(past)


def test_nothing_recorded_is_the_start():
    limb, whole = undisturbed(LIMBS[0])
    past = past_of([], EVERY, TICKS.nanoseconds)
    assert (past.tick, past.muscles, past.limb) == (-1, None, None)
    assert by_topic(run(limb, past)) == by_topic(whole)


def test_a_bag_without_parts_stays_as_it_is(tmp_path):
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "run.mcap").write_bytes(b"whatever")
    join_parts(str(tmp_path / "run"))
    assert (tmp_path / "run" / "run.mcap").read_bytes() == b"whatever"


@pytest.mark.parametrize("content", [None, b"", b"whatever", b"\x89MCAP0\r\n"], ids=str)
def test_what_is_no_bag_of_a_run_is_refused(content, tmp_path):
    folder = tmp_path / "run"
    if content is not None:
        folder.mkdir()
        (folder / "run.mcap").write_bytes(content)
    with pytest.raises(UserError, match=str(folder)):
        RecordedRun.read(str(folder))
