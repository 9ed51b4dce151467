"""What is written many at a time is what rosbags writes one by one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from rosbags.interfaces import Connection

from limb_nodes.bags.storage import Storage
from limb_nodes.bags.types import limb_typestore
from limb_nodes.foundation.topics import TOPIC_TYPES

TOPICS = ("activation", "joint_torque")


def messages(count: int, size: int, connections: list[Connection]) -> list[tuple[Connection, int, bytes]]:
    """Messages of arbitrary bytes, out of order in time, on topics in turn."""
    random = np.random.default_rng(1)
    stamps = random.integers(0, 10**12, count).tolist()
    return [(connections[k % len(connections)], stamps[k], random.bytes(1 + k % size)) for k in range(count)]


@pytest.mark.parametrize("compressed", [True, False])
@pytest.mark.parametrize(("count", "size"), [(0, 1), (1, 1), (50, 30), (5000, 1500)], ids=str)
def test_the_bytes_are_those_of_the_library(compressed: bool, count: int, size: int, tmp_path: Path) -> None:
    files = {}
    for name in ("single", "many"):
        bag = Storage(tmp_path / name / "bag", compressed=compressed)
        connections = [
            bag.add_connection(f"/{topic}", TOPIC_TYPES[topic], typestore=limb_typestore()) for topic in TOPICS
        ]
        given = messages(count, size, connections)
        if name == "many":
            bag.write_all(given)
        else:
            for message in given:
                bag.write(*message)
        bag.close()
        files[name] = [(tmp_path / name / "bag" / file).read_bytes() for file in ("bag.mcap", "metadata.yaml")]
    assert files["many"] == files["single"]


def test_what_is_flushed_is_on_the_disk(tmp_path: Path) -> None:
    bag = Storage(tmp_path / "bag", compressed=False)
    connection = bag.add_connection("/activation", TOPIC_TYPES["activation"], typestore=limb_typestore())
    bag.write_all([(connection, 1, b"as it is")])
    assert b"as it is" not in (tmp_path / "bag" / "bag.mcap").read_bytes()
    bag.flush()
    assert b"as it is" in (tmp_path / "bag" / "bag.mcap").read_bytes()
    bag.close()
