"""The service `reset`: the nodes that a person has started begin the run anew, by themselves."""

from __future__ import annotations

import signal

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from limb_msgs.msg import MovementPattern
from std_srvs.srv import Trigger

from limb_nodes.bags.folder import next_free
from limb_nodes.nodes.qos import LIVE

NODES = ("activation_input", "muscle_stack", "limb_dynamics", "recorder")
RESETS = 3


@pytest.mark.parametrize("mode", ["lockstep", "realtime"])
def test_all_nodes_begin_the_run_anew_and_the_recorder_another_bag(mode, limb, waves, processes, bags, bench, tmp_path):
    graph = bench()
    given = {
        "activation_input": {"source": waves, "duration": 3600.0},
        "limb_dynamics": {"await_recorder": True},
        "recorder": {"out": tmp_path / "run"},
    }
    common = {"limb": limb, "rate": 200.0, "mode": mode}
    started = {name: processes.node(name, **common, **given.get(name, {})) for name in NODES}
    heard = graph.listen(MovementPattern, "movement_pattern", LIVE)
    told = graph.listen(DiagnosticArray, "/diagnostics", LIVE)
    reset = graph.probe.create_client(Trigger, "reset")
    runs: list[str] = []
    for number in range(RESETS + 1):
        graph.until(lambda: heard and heard[-1].run not in runs and heard[-1].tick > 100, f"run {number}")
        runs.append(heard[-1].run)
        if number == RESETS:
            break
        graph.until(reset.service_is_ready, "the service")
        answer = reset.call_async(Trigger.Request())
        graph.until(answer.done, "its answer")
        assert answer.result().success
        following = answer.result().message.split()[2]
        graph.until(lambda following=following: heard[-1].run == following, "the run that was named")
    assert all(child.running() for child in started.values())
    # What the former run had still to say is no stranger's.
    values = [(value.key, value.value) for array in told for status in array.status for value in status.values]
    assert {value for key, value in values if key in ("foreign", "bad_input")} == {"0"}
    for name in "limb_dynamics", "recorder", "muscle_stack", "activation_input":
        started[name].signal(signal.SIGTERM)
        assert started[name].wait() == 0, started[name].said
        # In real time a busy machine misses deadlines, and says so.
        assert mode == "realtime" or started[name].said == ""
    folders = [tmp_path / "run", *(tmp_path / f"run_reset{number + 1}" for number in range(RESETS))]
    tables = [bags.decoded(folder, ("movement_pattern",))["movement_pattern"] for folder in folders]
    assert [str(table["run"]) for table in tables] == runs
    least = min(len(table["tick"]) for table in tables)
    for table in tables:
        assert table["tick"].tolist() == list(range(len(table["tick"])))
        assert mode == "realtime" or (table["angle"][:least] == tables[0]["angle"][:least]).all()
    assert least > 101


def test_resets_that_follow_each_other_leave_no_node_behind(limb, waves, processes, bench, tmp_path):
    graph = bench()
    started = {
        "activation_input": {"source": waves, "duration": 3600.0},
        "muscle_stack": {},
        "limb_dynamics": {"await_recorder": True},
        "recorder": {"out": tmp_path / "run"},
    }
    for name, given in started.items():
        processes.node(name, limb=limb, rate=200.0, **given)
    heard = graph.listen(MovementPattern, "movement_pattern", LIVE)
    reset = graph.probe.create_client(Trigger, "reset")
    graph.until(lambda: heard and heard[-1].tick > 0, "the first run")
    named: list[str] = []
    while len(set(named)) < 6:
        graph.until(reset.service_is_ready, "the service")
        answer, at = reset.call_async(Trigger.Request()), heard[-1]
        # limb_dynamics may be between two runs, and the question or its answer lost; a run must go on.
        graph.until(
            lambda answer=answer, at=at: answer.done() or heard[-1].run != at.run or heard[-1].tick > at.tick + 2000,
            "an answer, another run or more ticks",
        )
        if not answer.done():
            continue
        if answer.result().success:
            named.append(answer.result().message.split()[2])
    graph.until(lambda: heard[-1].run == named[-1] and heard[-1].tick > 100, "the last run")


def test_nothing_begins_anew_before_the_first_tick(limb, processes, bench):
    graph = bench()
    alone = processes.node("limb_dynamics", limb=limb)
    reset = graph.probe.create_client(Trigger, "reset")
    graph.until(reset.service_is_ready, "the service")
    answer = reset.call_async(Trigger.Request())
    graph.until(answer.done, "its answer")
    assert not answer.result().success
    assert "has not made its first tick" in answer.result().message
    assert alone.running()


def test_what_follows_has_a_name_of_its_own(tmp_path):
    (tmp_path / "run_reset2").mkdir()
    assert next_free(tmp_path / "run").name == "run_reset1"
    assert next_free(tmp_path / "run_reset1").name == "run_reset1"
    (tmp_path / "run_reset1").mkdir()
    assert next_free(tmp_path / "run_reset2").name == "run_reset3"
