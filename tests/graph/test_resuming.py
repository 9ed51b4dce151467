"""A run that was cut short goes on, and a node that was killed is started anew: the values are the undisturbed ones."""

from __future__ import annotations

import os
import signal
from pathlib import Path
from typing import Any

import pytest

from limb_nodes.bags.read import BagReader
from limb_nodes.exchange.recorded import RecordedRun
from limb_nodes.foundation.topics import NODES
from limb_nodes.nodes.children import holds_ticks
from tests.graph.conftest import children_of

SECONDS = "8"
# Bytes on disk that hold some hundred ticks of a run.
ENOUGH = 150_000


@pytest.fixture(scope="module")
def undisturbed(limb, waves, tmp_path_factory) -> Path:
    """A run in this process, of as many ticks."""
    from limb_nodes.nodes.session import run_in_one_process
    from limb_nodes.nodes.settings import RunSettings, checked
    from tests.graph.conftest import undisturbed

    out = tmp_path_factory.mktemp("undisturbed") / "run"
    ready, _ = checked(RunSettings(limb=limb, source=waves, rate=1000.0, duration=float(SECONDS), out=str(out)))
    with undisturbed():
        run_in_one_process(ready, lambda tick: None)
    return out


@pytest.fixture
def begun(limb, waves, processes, until, tmp_path):
    """Starts a run as a command, and waits until a part of it is on the disk."""

    def begin(*options: str) -> tuple[Any, Path]:
        out = tmp_path / "run"
        child = processes.limb("run", limb, "--activation", waves, "--duration", SECONDS, "--out", out, *options)
        until(lambda: size(out) > ENOUGH or not child.running(), "a part of the bag on disk")
        assert child.running(), child.said
        return child, out

    return begin


def size(bag: Path) -> int:
    """What of a bag is on disk."""
    return sum(path.stat().st_size for path in bag.glob("*.mcap"))


def node(run: Any, name: str) -> int:
    """The process of a node of a run."""
    module = f"limb_nodes.nodes.{name} ".encode()
    (pid,) = (pid for pid in children_of(run.handle.pid) if module in Path(f"/proc/{pid}/cmdline").read_bytes())
    return pid


def test_a_killed_run_goes_on_in_a_new_bag(begun, undisturbed, processes, bags, tmp_path):
    child, cut = begun()
    child.signal(signal.SIGKILL)
    child.wait()
    before = (cut / "run.mcap").read_bytes()
    again = processes.limb("run", "--resume", cut, "--out", tmp_path / "again", "--processes")
    assert again.wait() == 0, again.said
    assert "ticks      8001 at 1000 Hz (8 s)\nmissing    0\n" in again.printed
    assert bags.differences(undisturbed, tmp_path / "again") == []
    assert (cut / "run.mcap").read_bytes() == before
    once_more = processes.limb("run", "--resume", tmp_path / "again", "--out", tmp_path / "more")
    assert once_more.wait() == 2
    assert "is complete" in once_more.said


@pytest.mark.parametrize("names", [("muscle_stack",), ("limb_dynamics", "activation_input"), NODES], ids="+".join)
def test_killed_nodes_are_started_anew(names, begun, undisturbed, bags):
    child, out = begun("--processes", "--respawn", "--stall-limit", "300")
    for pid in [node(child, name) for name in names]:
        os.kill(pid, signal.SIGKILL)
    assert child.wait() == 0, child.said
    for name in names:
        assert f"limb: the node {name} was ended by SIGKILL; it goes on from what is recorded\n" in child.said
    assert bags.differences(undisturbed, out) == []
    assert [path.name for path in out.parent.iterdir() if path.name.startswith((out.name, "."))] == [out.name]
    with BagReader(out) as bag:
        assert bag.count("robot_description") == 1


def test_a_bag_tells_whether_a_run_could_go_on_from_it(undisturbed, tmp_path):
    """Also one that is being written, of which the process of the run has not heard a tick yet."""
    data = (undisturbed / f"{undisturbed.name}.mcap").read_bytes()
    for size, holds in (0, False), (100, False), (len(data) // 2, True), (len(data), True):
        bag = tmp_path / str(size)
        bag.mkdir()
        (bag / f"{bag.name}.mcap").write_bytes(data[:size])
        assert holds_ticks(bag) == holds
    assert not holds_ticks(tmp_path / "none")


def test_a_node_that_is_stopped_is_named_and_goes_on_with_the_run(begun, undisturbed, until, bags):
    child, out = begun("--processes", "--stall-limit", "300")
    pid = node(child, "muscle_stack")
    os.kill(pid, signal.SIGSTOP)
    until(lambda: f"limb: stopped by somebody: muscle_stack (process {pid}) for" in child.all_said, "who is stopped")
    assert "from muscle_stack since" in child.all_said
    os.kill(pid, signal.SIGCONT)
    assert child.wait() == 0, child.all_said
    assert bags.differences(undisturbed, out) == []


def test_a_run_that_stands_still_ends_in_order(begun, until):
    child, out = begun("--processes", "--stall-limit", "3")
    # What a stopped node has not delivered yet cannot be recorded, up to as many ticks as the limb may be ahead.
    until(lambda: RecordedRun.read(str(out)).past().complete > 100 or not child.running(), "100 ticks on disk")
    os.kill(node(child, "muscle_stack"), signal.SIGSTOP)
    assert child.wait() == 1
    assert "limb: error: " in child.all_said
    assert "has waited" in child.all_said
    assert f"{out} holds what was recorded until then" in child.all_said
    with BagReader(out) as bag:
        assert bag.count("joint_torque") > 100


@pytest.mark.parametrize(
    ("options", "parts"),
    [
        (["--resume", "absent"], ["absent", "no such bag"]),
        (["--resume", "."], [".mcap"]),
        (["--respawn"], ["--respawn", "--processes"]),
        (["--stall-limit", "0.5"], ["--stall-limit", "0.5", "1"]),
    ],
)
def test_what_cannot_be_done_is_refused(options, parts, limb, waves, processes, tmp_path):
    child = processes.limb("run", limb, "--activation", waves, "--duration", "1", "--out", tmp_path / "run", *options)
    assert child.wait() == 2
    (line,) = child.said.splitlines()
    for part in parts:
        assert part in line
    assert not (tmp_path / "run").exists()
