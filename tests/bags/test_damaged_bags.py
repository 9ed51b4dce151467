"""Bags that are damaged or wrong, and writers that are killed: a few of the trials of `python -m tests.faults`."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import pytest
from mcap.exceptions import McapError
from mcap.records import Message
from mcap.stream_reader import StreamReader

from limb_nodes.bags.read import BagReader
from limb_nodes.bags.recover import recover
from tests.faults import damaged_bags

# Writes one message, then waits until it is killed.
ONE_MESSAGE = """
import sys, time
from limb_nodes.bags.types import make_message
from limb_nodes.bags.write import BagWriter
from limb_nodes.foundation.topics import TOPIC_TYPES

kind = TOPIC_TYPES["activation"]
bag = BagWriter(sys.argv[1], {"seed": 7})
bag.expect({"joint_torque": TOPIC_TYPES["joint_torque"]})
print("described", flush=True)
sys.stdin.readline()
bag.write("activation", 5, make_message(kind, 5, tick=5, name=["a"], activation=[0.5]))
time.sleep(3600)
"""


@pytest.mark.parametrize("seed", range(4))
def test_damage_is_told_and_costs_what_is_damaged(seed: int) -> None:
    bad = [
        trial.what
        for trial in damaged_bags.trials(15, 100 + seed)
        if trial.traceback or trial.changed or trial.lost > 0.0
    ]
    assert bad == []


def stored(file: Path) -> int:
    """How many messages there are in a file that is being written."""
    with file.open("rb") as stream:
        count = 0
        try:
            for record in StreamReader(stream).records:
                count += isinstance(record, Message)
        except McapError:  # the end of what is there
            pass
    return count


def test_what_describes_a_bag_is_there_at_once_and_a_message_without_another_behind_it(tmp_path: Path) -> None:
    path = tmp_path / "run"
    command = [sys.executable, "-c", ONE_MESSAGE, str(path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as child:
        assert child.stdin is not None
        assert child.stdout is not None
        try:
            assert child.stdout.readline() == "described\n"
            # Of run_info that its making has brought to the disk.
            assert stored(path / "run.mcap") == 1
            print(file=child.stdin, flush=True)
            while stored(path / "run.mcap") < 2:
                assert child.poll() is None
                time.sleep(0.01)
        finally:
            child.kill()
    recover(path, tmp_path / "out")
    with BagReader(tmp_path / "out") as bag:
        assert bag.run_info() == {"seed": 7}
        assert bag.table("activation")["tick"].tolist() == [5]
