"""Timing several things alternately, so that ratios hold on a machine that is shared."""

from __future__ import annotations

import resource
import statistics
import subprocess
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Spent:
    """Seconds on the wall clock and of processors."""

    wall: float
    cpu: float


def timed(work: Callable[[], object]) -> Spent:
    """What a call takes."""
    wall, cpu = time.perf_counter(), time.process_time()
    work()
    return Spent(time.perf_counter() - wall, time.process_time() - cpu)


def timed_process(command: Sequence[str], environment: Mapping[str, str]) -> Spent:
    """What a whole process takes, its start included; raises where it fails."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    wall = time.perf_counter()
    done = subprocess.run(command, env=dict(environment), capture_output=True, text=True, check=False)
    wall = time.perf_counter() - wall
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode != 0:
        raise RuntimeError(f"{' '.join(command)}: {(done.stderr or done.stdout).strip().splitlines()[-1:]}")
    return Spent(wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)


def alternate(things: Mapping[str, Callable[[], Spent]], rounds: int) -> dict[str, list[Spent]]:
    """A B C A B C ...: what each takes in each round."""
    found: dict[str, list[Spent]] = {name: [] for name in things}
    for _ in range(rounds):
        for name, thing in things.items():
            found[name].append(thing())
    return found


def median(spent: Sequence[Spent]) -> Spent:
    """Medians over rounds."""
    return Spent(statistics.median(s.wall for s in spent), statistics.median(s.cpu for s in spent))


def ratio(spent: Sequence[Spent], base: Sequence[Spent]) -> Spent:
    """Medians over rounds of what one takes over what the other takes in the same round."""
    pairs = list(zip(spent, base, strict=True))
    # The clock of processors is coarse: never divide by nothing.
    return Spent(
        statistics.median(one.wall / max(other.wall, 1e-9) for one, other in pairs),
        statistics.median(one.cpu / max(other.cpu, 1e-9) for one, other in pairs),
    )
