"""`python -m tests.soak`: a long run in four processes; memory, files, speed and bag in a table.

Status 1 if ticks are missing, or if a process has more memory or more files open at the end than once it was warm.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from limb_nodes.foundation.text_table import aligned
from limb_nodes.foundation.topics import NODES
from limb_nodes.nodes.session import run_in_processes
from limb_nodes.nodes.settings import Outcome, RunSettings, checked

PARAMS = Path(__file__).resolve().parents[1] / "params"
ROWS = 12
# The part of a run after which its processes are warm.
WARM = 0.25
# What a warm process may gain (MB): pages of the allocator come and go.
GAIN = 8.0
MEGABYTE = 1e6


@dataclass(frozen=True)
class Look:
    """What is seen at a time: memory (MB) and open files of each process by name, the bag (MB).

    pause: the longest time (s) without a tick since the look before.
    """

    tick: int
    wall: float
    pause: float
    memory: dict[str, float]
    files: dict[str, int]
    bag: float


class Watcher:
    """Looks at a run from time to time; handed to it as its progress."""

    def __init__(self, bag: Path, ticks: int) -> None:
        self.looks: list[Look] = []
        self._bag, self._every = bag, max(1, ticks // ROWS)
        self._newest, self._since, self._pause = -1, time.monotonic(), 0.0

    def __call__(self, tick: int) -> None:
        """Look if it is time to."""
        now = time.monotonic()
        if self._newest >= 0:
            self._pause = max(self._pause, now - self._since)
        if tick > self._newest:
            self._newest, self._since = tick, now
        if tick >= self._every * (len(self.looks) + 1):
            self.looks.append(look(tick, self._pause, self._bag))
            self._pause = 0.0


def look(tick: int, pause: float, bag: Path) -> Look:
    """Look at this process and at the nodes that it has started."""
    processes = {"limb run": Path("/proc/self"), **nodes()}
    return Look(
        tick,
        time.monotonic(),
        pause,
        {name: memory(place) for name, place in processes.items()},
        {name: len(list((place / "fd").iterdir())) for name, place in processes.items()},
        sum(file.stat().st_size for file in bag.iterdir()) / MEGABYTE,
    )


def nodes() -> dict[str, Path]:
    """The nodes that this process has started, by name, with their places in /proc."""
    children = Path("/proc/self/task").glob("*/children")
    places = [Path("/proc", number) for file in children for number in file.read_text().split()]
    commands = {place: (place / "cmdline").read_text() for place in places}
    return {name: place for name in NODES for place, line in commands.items() if f"limb_nodes.nodes.{name}" in line}


def memory(place: Path) -> float:
    """The resident memory (MB) of a process."""
    (line,) = [line for line in (place / "status").read_text().splitlines() if line.startswith("VmRSS:")]
    return int(line.split()[1]) * 1024 / MEGABYTE


def table(looks: list[Look], rate: float) -> list[str]:
    """The looks, a row each; ticks per second and the longest pause are since the one before."""
    names = list(looks[0].memory)
    rows = [("s", "ticks/s", "pause s", "bag MB", *(f"{name} MB, files" for name in names))]
    for before, now in zip([None, *looks], looks, strict=False):
        speed = "-" if before is None else f"{(now.tick - before.tick) / (now.wall - before.wall):.0f}"
        sizes = (f"{now.memory[name]:.1f}, {now.files[name]}" for name in names)
        rows.append((f"{now.tick / rate:.0f}", speed, f"{now.pause:.2f}", f"{now.bag:.0f}", *sizes))
    return aligned(rows, "r" * len(rows[0]))


def faults(looks: list[Look], outcome: Outcome, ticks: int) -> list[str]:
    """What is not as it should be, in words."""
    found = []
    if outcome.ticks < ticks or outcome.missing:
        found.append(f"{ticks - outcome.ticks} ticks and {outcome.missing} messages of others are missing")
    found += [f"{name} was not found among the processes" for name in NODES if name not in looks[0].memory]
    warm, last = looks[int(WARM * len(looks))], looks[-1]
    for name, before in warm.memory.items():
        if last.memory[name] > before + GAIN:
            found.append(f"{name} has grown from {before:.1f} to {last.memory[name]:.1f} MB")
        if last.files[name] > warm.files[name]:
            found.append(f"{name} has {last.files[name]} files open, {warm.files[name]} before")
    return found


def main() -> int:
    """Run; the exit status."""
    parser = argparse.ArgumentParser(prog="python -m tests.soak", description=__doc__)
    parser.add_argument("--duration", type=float, default=3600.0, metavar="S", help="simulated s (default 3600)")
    parser.add_argument("--rate", type=float, default=1000.0, metavar="HZ", help="ticks per second (default 1000)")
    parser.add_argument("--limb", default=str(PARAMS / "reference_joint_tendon.yaml"), metavar="LIMB.yaml")
    parser.add_argument("--activation", default=str(PARAMS / "activation_sine_cosine.yaml"), metavar="SOURCE")
    parser.add_argument("--folder", metavar="DIR", help="where the bag is kept meanwhile (default: temporary)")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="limb_soak_", dir=given.folder) as folder:
        bag = Path(folder) / "bag"
        settings = RunSettings(given.limb, given.activation, given.rate, given.duration, str(bag))
        ready, final = checked(settings)
        assert final is not None
        watcher = Watcher(bag, final)
        outcome = run_in_processes(ready, watcher)
    if not watcher.looks:
        print("the run was over before it could be looked at; a longer one is needed")
        return 1
    print("\n".join(table(watcher.looks, given.rate)))
    speed = outcome.ticks / max(outcome.seconds, 1e-9)
    print(f"{outcome.ticks} ticks in {outcome.seconds:.0f} s, {speed:.0f} ticks/s, {outcome.missing} missing")
    found = faults(watcher.looks, outcome, final + 1)
    print("\n".join(found) or "nothing grows, nothing is missing")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
