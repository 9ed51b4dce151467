"""A process that writes a bag is killed at a random time, within its first second too: what it loses."""

from __future__ import annotations

import mmap
import random
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from limb_nodes.bags.read import BagReader
from limb_nodes.bags.recover import recover
from tests.faults.trial import Trial

KIND = "kill -9 of a writer of bags"
COUNT = 100
LONGEST = 2.0
# Writes until it is killed, in real time; tells in shared memory what it has handed over, and how far its clock is.
WRITER = """
import mmap, struct, sys, time
from limb_nodes.bags.types import make_message
from limb_nodes.bags.write import BagWriter
from limb_nodes.foundation.topics import TOPIC_TYPES

with open(sys.argv[2], "r+b") as file:
    told = mmap.mmap(file.fileno(), 16)
kind = TOPIC_TYPES["activation"]
bag = BagWriter(sys.argv[1], {"seed": 7, "period_ns": 1_000_000})
bag.expect({"activation": kind})
begun = time.monotonic()
count = 0
while True:
    while count * 1e-3 <= time.monotonic() - begun:
        stamp = count * 1_000_000
        bag.write("activation", stamp, make_message(kind, stamp, tick=count, name=["a"], activation=[count * 1e-6]))
        count += 1
    told[:] = struct.pack("<dq", time.monotonic() - begun, count)
    time.sleep(1e-3)
"""


def trial(folder: Path, wait: float) -> Trial:
    """Kill a writer after so long a time (s), and compare what is recovered with what it had handed over."""
    shared = folder / "told"
    shared.write_bytes(bytes(16))
    with shared.open("r+b") as file, mmap.mmap(file.fileno(), 16) as told:
        with subprocess.Popen([sys.executable, "-c", WRITER, str(folder / "run"), str(shared)]) as child:
            try:
                # From the first message on.
                while struct.unpack("<dq", told[:])[1] == 0 and child.poll() is None:
                    time.sleep(1e-3)
                time.sleep(wait)
            finally:
                child.kill()
        count = struct.unpack("<dq", told[:])[1]
    recover(folder / "run", folder / "out")
    with BagReader(folder / "out") as bag:
        described = bag.run_info() == {"seed": 7, "period_ns": 1_000_000}
        table = bag.table("activation") if bag.has("activation") else {"tick": [], "activation": []}
    ticks = list(table["tick"])
    changed = not described or ticks != list(range(len(ticks))) or any(
        value[0] != tick * 1e-6 for tick, value in zip(ticks, table["activation"], strict=True)
    )  # fmt: skip
    return Trial(
        f"killed {wait:.3f} s behind the first message", lost=max(0, count - len(ticks)) * 1e-3, changed=changed
    )


def trials(count: int, seed: int) -> Iterator[Trial]:
    """Writers that are killed at random times, half of them within their first half second."""
    draw = random.Random(seed)
    for number in range(count):
        with tempfile.TemporaryDirectory(prefix="limb_killed_") as folder:
            yield trial(Path(folder), draw.uniform(0.0, 0.5 if number % 2 else LONGEST))
