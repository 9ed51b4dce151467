"""kill -9 of each process of a run, at random times: nothing that was recorded is lost, and the run goes on."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from limb_nodes.bags.read import BagReader
from limb_nodes.bags.recover import recover
from limb_nodes.foundation.topics import NODES
from tests.faults.trial import Trial

KIND = "kill -9 of a process"
# Each node 20 times, half of the runs with --respawn, and the run's own process 20 times.
COUNT = 100
ROOT = Path(__file__).resolve().parents[2]
LIMB, WAVES = ROOT / "params/reference_joint_tendon.yaml", ROOT / "params/activation_sine_cosine.yaml"
SECONDS, RATE = 6.0, 1000.0
# The longest time from the first tick to the kill (s).
LATEST = 3.0
VICTIMS = (*NODES, "limb run")
TOPICS = ("activation", "joint_states", "joint_torque", "movement_pattern", "muscle_state")


def trials(count: int, seed: int) -> Iterator[Trial]:
    """Kill; the seed gives the times."""
    chance = random.Random(seed)
    with tempfile.TemporaryDirectory(prefix="limb_killed_") as place:
        folder = Path(place)
        # Of its own, so that no other run is in the way.
        environment = {**os.environ, "ROS_DOMAIN_ID": str(chance.randint(110, 200)), "ROS_LOG_DIR": str(folder / "log")}
        run(folder / "whole", environment).communicate()
        whole = values(folder / "whole")
        for number in range(count):
            victim, respawn = VICTIMS[number % len(VICTIMS)], number % 2 == 1
            after = chance.uniform(0.0, LATEST)
            yield trial(folder / f"run{number}", environment, whole, victim, after, respawn and victim in NODES)


def run(out: Path, environment: dict[str, str], *options: str) -> subprocess.Popen[str]:
    """A run in four processes."""
    arguments = [str(LIMB), "--activation", str(WAVES), "--duration", str(SECONDS), "--out", str(out), "--processes"]
    return subprocess.Popen(
        [sys.executable, "-m", "limb_nodes.cli", "run", *arguments, *options],
        cwd=ROOT, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, stdin=subprocess.DEVNULL, text=True,
    )  # fmt: skip


def values(bag: Path) -> dict[str, dict[str, Any]]:
    """The numbers of some topics."""
    with BagReader(bag) as reader:
        return {topic: reader.table(topic) for topic in TOPICS}


def trial(
    out: Path, environment: dict[str, str], whole: dict[str, Any], victim: str, after: float, respawn: bool
) -> Trial:
    """Kill one process of a run, some time (s) after its first ticks."""
    child = run(out, environment, *(["--respawn"] if respawn else []))
    while child.poll() is None and not any(path.stat().st_size > 20_000 for path in out.glob("*.mcap")):
        time.sleep(0.005)
    if not out.exists():
        raise RuntimeError(f"the run has not begun: {child.communicate()[1]}")
    time.sleep(after)
    begun, nodes = reached(out), children_of(child)
    try:
        os.kill(process(child, victim), signal.SIGKILL)
    except (OSError, StopIteration):  # the run was over
        child.communicate()
        return trial(out.with_name(f"{out.name}_again"), environment, whole, victim, after / 2, respawn)
    killed = time.monotonic()
    _, said = child.communicate()
    seconds = time.monotonic() - killed
    # Nodes whose parent was killed end by themselves, and close the bag before.
    while any(Path(f"/proc/{pid}").exists() for pid in nodes):
        time.sleep(0.01)
    closed = (out / "metadata.yaml").exists()
    if not closed:
        recover(out, out.with_name(f"{out.name}_recovered"))
    found = values(out if closed else out.with_name(f"{out.name}_recovered"))
    ticks = min(len(columns["stamp"]) for columns in found.values())
    same = all(
        np.array_equal(column[:ticks], whole[topic][name][:ticks])
        for topic, columns in found.items()
        for name, column in columns.items()
        if column.shape[:1] == columns["stamp"].shape
    )
    lasted = child.returncode == 0
    return Trial(
        f"{victim} after {after:.3f} s{' with --respawn' if respawn else ''}",
        lost=max(0, begun - ticks) / RATE,
        changed=not same or (respawn and (not lasted or ticks != round(SECONDS * RATE) + 1)),
        said=None if victim == "limb run" or not said else min(seconds, 5.0) if not respawn else None,
        traceback="Traceback" in said,
        hung=False,
    )


def process(child: subprocess.Popen[str], victim: str) -> int:
    """The process of a run, or of one of its nodes."""
    if victim not in NODES:
        return child.pid
    module = f"limb_nodes.nodes.{victim} ".encode()
    return next(pid for pid in children_of(child) if module in Path(f"/proc/{pid}/cmdline").read_bytes())


def children_of(child: subprocess.Popen[str]) -> list[int]:
    """The processes of the nodes of a run; none if it is over."""
    try:
        return [int(pid) for pid in Path(f"/proc/{child.pid}/task/{child.pid}/children").read_text().split()]
    except OSError:
        return []


def reached(out: Path) -> int:
    """How many ticks are on the disk."""
    from limb_nodes.exchange.recorded import RecordedRun

    return RecordedRun.read(str(out)).past().tick + 1
