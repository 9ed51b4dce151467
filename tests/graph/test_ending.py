"""However a run ends, its bag can be read, and no process is left."""

from __future__ import annotations

import os
import signal
from pathlib import Path
from typing import Any

import pytest

from limb_nodes.bags.read import BagReader
from limb_nodes.bags.recover import recover
from limb_nodes.errors import UserError
from limb_nodes.nodes.activation_input import ActivationInput
from limb_nodes.nodes.limb_dynamics import LimbDynamics
from limb_nodes.nodes.muscle_stack import MuscleStack
from tests.graph.conftest import children_of

LONG = "600"
# Bytes on disk that hold over 100 ticks of every topic, however little they can be compressed; for a bag that is not
# closed, in which a topic may lack as many ticks as the limb may be ahead of the recorder.
ENOUGH, ENOUGH_UNCLOSED = 250_000, 700_000


def bytes_in(bag: Path) -> int:
    """What of a bag is on disk."""
    return sum(path.stat().st_size for path in bag.glob("*.mcap"))


def on_disk(bag: Path, child: Any, until: Any) -> None:
    """Wait until a part of the bag that a process writes is on disk."""
    until(lambda: bytes_in(bag) > ENOUGH or not child.running(), "a part of the bag on disk")
    assert child.running(), child.said


def alive(pid: int) -> bool:
    """Whether a process runs; one that has ended and waits to be collected does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def whole(bag: Path, bags) -> int:
    """Assert that a bag holds the first ticks of every topic without a gap; how many of the shortest topic."""
    found = bags.decoded(bag)
    for topic, columns in found.items():
        assert columns["stamp"].tolist() == [k * 1_000_000 for k in range(len(columns["stamp"]))], topic
    return min(len(columns["stamp"]) for columns in found.values())


@pytest.mark.parametrize(
    ("options", "number"),
    [([], signal.SIGINT), ([], signal.SIGTERM), ([], signal.SIGHUP), (["--processes"], signal.SIGINT)],
    ids=["Ctrl-C in one process", "terminated in one process", "hung up in one process", "Ctrl-C with processes"],
)
def test_an_interrupted_run_leaves_a_readable_bag(options, number, limb, processes, until, bags, tmp_path):
    out = tmp_path / "run"
    source = "flexor=0.9,extensor=0"
    child = processes.limb(
        "run", limb, "--activation", source, "--duration", LONG, "--rate", "1000", "--out", out, *options
    )
    on_disk(out, child, until)
    nodes = children_of(child.handle.pid)
    assert len(nodes) == (4 if options else 0)
    child.signal(number)
    assert (child.wait(), child.said) == (130, "")
    assert "interrupted" in child.printed
    assert whole(out, bags) > 100
    assert not [pid for pid in nodes if alive(pid)]


def test_interrupted_before_the_nodes_are_there(limb, processes, until, monkeypatch, tmp_path):
    """None finds the others, so that the recorder does not begin however late the signal comes."""
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF")
    out = tmp_path / "run"
    child = processes.limb(
        "run", limb, "--activation", "flexor=0.9,extensor=0", "--duration", LONG, "--out", out, "--processes"
    )
    nodes = until(lambda: len(found := children_of(child.handle.pid)) == 4 and found, "four children")
    child.signal(signal.SIGINT)
    assert (child.wait(), child.said) == (130, "")
    assert not [pid for pid in nodes if alive(pid)]
    assert "interrupted" in child.printed
    assert not out.exists()


def test_the_nodes_end_with_a_run_that_is_killed(limb, processes, until, bags, tmp_path):
    out = tmp_path / "run"
    source = "flexor=0.9,extensor=0"
    child = processes.limb("run", limb, "--activation", source, "--duration", LONG, "--out", out, "--processes")
    on_disk(out, child, until)
    nodes = children_of(child.handle.pid)
    assert len(nodes) == 4
    child.signal(signal.SIGKILL)
    child.wait()
    until(lambda: not [pid for pid in nodes if alive(pid)], "the nodes to end")
    assert whole(out, bags) > 100


def test_a_node_that_dies_ends_the_run(limb, processes, until, bags, tmp_path):
    out = tmp_path / "run"
    source = "flexor=0.9,extensor=0"
    child = processes.limb("run", limb, "--activation", source, "--duration", LONG, "--out", out, "--processes")
    on_disk(out, child, until)
    nodes = children_of(child.handle.pid)
    (muscle_stack,) = (pid for pid in nodes if b"nodes.muscle_stack" in Path(f"/proc/{pid}/cmdline").read_bytes())
    os.kill(muscle_stack, signal.SIGKILL)
    assert child.wait() == 1
    told = f"the node muscle_stack was ended by SIGKILL; {out} holds what was recorded until then"
    assert child.said == f"limb: error: {told}\n"
    assert not [pid for pid in nodes if alive(pid)]
    assert whole(out, bags) > 100


@pytest.fixture
def recorded(bench, limb, processes, until, tmp_path):
    """A recorder in a process of its own, with a part of a run on disk; the other nodes are in this process."""
    graph, out = bench(), tmp_path / "run"
    common = {"limb": limb, "rate": 1000.0}
    recorder = processes.node("recorder", out=out, **common)
    graph.add(ActivationInput, source="flexor=0.9,extensor=0", duration=300.0, **common)
    graph.add(MuscleStack, **common)
    graph.add(LimbDynamics, await_recorder=True, **common)
    graph.until(lambda: bytes_in(out) > ENOUGH_UNCLOSED or not recorder.running(), "a part of the bag on disk")
    return recorder, out


def test_an_interrupted_recorder_leaves_a_readable_bag(recorded, bags):
    recorder, out = recorded
    recorder.signal(signal.SIGINT)
    assert (recorder.wait(), recorder.said) == (0, "")
    assert whole(out, bags) > 100


def test_a_killed_recorder_leaves_what_can_be_recovered(recorded, bags, tmp_path):
    recorder, out = recorded
    recorder.signal(signal.SIGKILL)
    recorder.wait()
    with pytest.raises(UserError, match="limb recover"):
        BagReader(out)
    found = recover(out, tmp_path / "recovered")
    assert found.counts["/joint_states"] > 100
    assert whole(tmp_path / "recovered", bags) > 100
    with BagReader(tmp_path / "recovered") as bag:
        assert bag.run_info()["parameters"]["recorder"]["out"] == str(out)
