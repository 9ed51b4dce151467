"""What all tests share: the order of their files, a ROS domain for each process, and hypothesis without a clock.

ROS domains of one machine have Fast DDS's ports in shared memory in common. While many processes start there at once it
may lose one (its issue 6117), so the tests go by UDP; some take what a user has.
"""

from __future__ import annotations

import fcntl
import os
import tempfile
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

# Files that take minutes: they come first, so that no process is left with one of them when the others are done.
LONG = (
    *("docs/test_blocks.py", "graph/test_ending.py", "graph/test_identity.py", "graph/test_lockstep.py"),
    *("graph/test_resuming.py", "graph/test_sources.py"),
)
DOMAINS = 101

# The same examples every time, however long one takes.
settings.register_profile("same", deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("same")


def reserved_domain() -> int:
    """A ROS domain that no other process of these tests on this machine gets while this one lives."""
    for step in range(DOMAINS):
        domain = (os.getpid() + step) % DOMAINS + 1
        try:
            lock = os.open(Path(tempfile.gettempdir(), f"limb_test_domain_{domain}"), os.O_CREAT | os.O_RDWR, 0o666)
        except OSError:  # another user's
            continue
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(lock)
            continue
        return domain
    raise RuntimeError(f"all ROS domains from 1 to {DOMAINS} are taken")


os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
os.environ["ROS_DOMAIN_ID"] = str(reserved_domain())
os.environ["FASTDDS_BUILTIN_TRANSPORTS"] = "UDPv4"


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the longest files first."""
    items.sort(key=lambda item: not item.path.as_posix().endswith(LONG))
