"""What all tests share: the order of their files, and a ROS domain for each process, so that none hears the others.

ROS domains of one machine have Fast DDS's ports in shared memory in common. While many processes start there at once it
may lose one (its issue 6117), so the tests go by UDP; some take what a user has.
"""

from __future__ import annotations

import os

import pytest

# Files that take minutes: they come first, so that no process is left with one of them when the others are done.
LONG = ("docs/test_blocks.py", "graph/test_ending.py", "graph/test_lockstep.py")

os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
os.environ["ROS_DOMAIN_ID"] = str(os.getpid() % 101 + 1)
os.environ["FASTDDS_BUILTIN_TRANSPORTS"] = "UDPv4"


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the longest files first."""
    items.sort(key=lambda item: not item.path.as_posix().endswith(LONG))
