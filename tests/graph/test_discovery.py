"""The nodes of `limb` stay on their own machine unless the environment says otherwise."""

from __future__ import annotations

import signal
from pathlib import Path

import pytest

RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"


def children(pid: int) -> list[int]:
    """The processes that a process has started."""
    return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def ranges(pid: int) -> list[str]:
    """The discovery range in the environment of each node that a process has started, once they are that."""
    found = []
    for child in children(pid):
        if b"limb_nodes.nodes." in Path(f"/proc/{child}/cmdline").read_bytes():
            given = dict(pair.split("=", 1) for pair in Path(f"/proc/{child}/environ").read_text().split("\0") if pair)
            found.append(given[RANGE])
    return found


@pytest.mark.parametrize(("given", "expected"), [(None, "LOCALHOST"), ("", "LOCALHOST"), ("OFF", "OFF")])
def test_the_range_is_this_machine_unless_it_is_given(
    given, expected, limb, processes, until, tmp_path, monkeypatch
) -> None:
    monkeypatch.delenv(RANGE)
    if given is not None:
        monkeypatch.setenv(RANGE, given)
    out = tmp_path / "bag"
    run = processes.limb("run", limb, "--mode", "realtime", "--processes", "--out", out)
    found = until(lambda: len(found := ranges(run.handle.pid)) == 4 and found, "four nodes")
    run.signal(signal.SIGINT)
    run.wait()
    assert found == [expected] * 4
