"""Schedules of faults, a few of the many of `python -m tests.faults schedules`."""

from __future__ import annotations

import pytest

from limb_nodes.exchange.part import Part
from limb_nodes.exchange.ticks import Ticks
from limb_nodes.model import parse_limb
from tests.faults import schedules
from tests.faults.simulated import RESPAWN, Fault, Run, Schedule, Setting
from tests.independent.random_limb import RandomLimb


def test_a_few_schedules_do_no_harm():
    bad = [trial for trial in schedules.trials(150, 1) if not trial.good]
    assert bad == []


def test_a_few_schedules_with_impacts_within_ticks_do_no_harm(monkeypatch):
    """Twelve impacts in 30 ticks: the exchange behind them is lost, late, doubled, forged, or its nodes killed."""
    other = RandomLimb(0)
    excitation = other.excitation(50.0, 0.6)[: schedules.FINAL + 1]
    given = Setting(parse_limb(other.yaml(), "random.yaml"), excitation, ticks=Ticks(50.0))
    monkeypatch.setattr(schedules, "setting", lambda: given)
    schedules.undisturbed.cache_clear()
    calm = Run(given, Schedule(seed=0)).go()
    assert max(getattr(process.part, "impacts", 0) for process in calm.everyone) == 12
    bad = [trial for trial in schedules.trials(60, 1) if not trial.good]
    schedules.undisturbed.cache_clear()
    assert bad == []


def test_a_schedule_is_replayed_by_its_seed():
    for seed in 7, 41, 93:
        first, again = (Run(schedules.setting(), schedules.drawn(seed)).go() for _ in range(2))
        assert first.words == again.words
        assert schedules.judged(first) == schedules.judged(again)
        assert [schedules.recorded(bag) for bag in first.bags] == [schedules.recorded(bag) for bag in again.bags]


@pytest.mark.parametrize("node", ["activation_input", "muscle_stack", "limb_dynamics", "recorder"])
@pytest.mark.parametrize("at", [5, 60, 200])
def test_a_killed_node_that_is_started_anew_changes_nothing(node, at):
    schedule = Schedule(seed=at, faults=(Fault("kill", node, at, seconds=0.5),), mode=RESPAWN, limit=30.0, lag=16)
    run = Run(schedules.setting(), schedule).go()
    assert len(run.everyone) > 4
    whole = schedules.undisturbed(schedule.lag)
    found = schedules.recorded(run.bags[-1])
    assert {key: data for key, data in found.items() if "checkpoint" not in key[0]} == {
        key: data for key, data in whole.items() if "checkpoint" not in key[0]
    }


def test_a_part_that_takes_what_is_not_of_its_run_is_noticed(monkeypatch):
    strangers = tuple(Fault("stranger", "activation", at, what="another identity") for at in range(50, 250, 20))
    schedule = Schedule(seed=1, faults=strangers)
    trial = schedules.judged(Run(schedules.setting(), schedule).go())
    monkeypatch.setattr(Part, "owns", lambda self, topic, data: True)
    run = Run(schedules.setting(), schedule).go()
    assert trial.good
    assert sum(process.part.conflicts for process in run.everyone) > 0
