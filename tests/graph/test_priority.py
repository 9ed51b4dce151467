"""Real-time priority on request, where it is allowed."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest

# As a user who may not have it.
REFUSED = """
import os, resource
from limb_nodes.edge import guarded
from limb_nodes.nodes.priority import take_priority
resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0))
if os.getuid() == 0:
    os.setuid(65534)
raise SystemExit(guarded(lambda: take_priority("muscle_stack", 10)))
"""


def policies(pid: int) -> set[int]:
    return {os.sched_getscheduler(int(thread.name)) for thread in Path(f"/proc/{pid}/task").iterdir()}


def test_all_threads_of_the_node_have_it(limb, processes, until):
    child = processes.node("muscle_stack", limb=limb, priority=10)
    until(lambda: not child.running() or policies(child.handle.pid) == {os.SCHED_FIFO}, "the priority")
    if not child.running():
        assert "is 10, and this user is allowed" in child.said
        pytest.skip("this user may have no real-time priority")
    child.signal(signal.SIGTERM)
    assert (child.wait(), child.said) == (0, "")


def test_who_may_not_have_it_is_told_in_a_line(processes):
    child = processes.start("-c", REFUSED)
    assert child.wait() == 2
    assert child.said.count("\n") == 1
    assert "muscle_stack: the parameter priority is 10, and this user is allowed 0" in child.said
