"""A thousand samples of the reference joint beside mujoco.rollout on as many threads."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.model import with_values
from limb_nodes.solve.ensemble import Ensemble, cores
from tests.benchmarks import works
from tests.benchmarks.peers import mujoco_limb
from tests.benchmarks.solving import PRODUCT, loosest, missing, product
from tests.benchmarks.table import Bar, Row
from tests.benchmarks.timing import alternate, median, ratio, timed
from tests.benchmarks.works import RATE, Work

OUTPUTS = 100


def samples(count: int) -> dict[str, FloatArray]:
    """Starts, masses and moment arms."""
    random = np.random.default_rng(1)
    return {
        "segments[0].angle": random.uniform(0.2, 0.8, count),
        "segments[0].mass": random.uniform(1.0, 1.5, count),
        "muscles[0].path.moment_arm": random.uniform(0.019, 0.023, count),
    }


def ensemble(rounds: int, duration: float, count: int = 1000) -> Iterator[Row]:
    """Samples of the reference joint."""
    work = works.joint(duration)
    given = samples(count)
    tolerance, _ = loosest(work, partial(product, work), range(6, 12))
    times = np.linspace(0.0, duration, OUTPUTS + 1)

    many = Ensemble(work.limb, work.excitation, RATE, tolerance=tolerance)

    def solved(threads: int) -> list[object]:
        return [result for _, result in many.solve(given, times=times, threads=threads)]

    threads = cores()
    engines = {f"{PRODUCT}, {n} threads": partial(timed, partial(solved, n)) for n in sorted({1, 2, threads})}
    ours = f"{PRODUCT}, {threads} threads"
    name = f"mujoco.rollout, {threads} threads"
    why = missing("mujoco")
    if not why:
        peer = mujoco_limb.MujocoLimb(work.limb, work.excitation)
        engines[name] = partial(timed, partial(peer.ensemble, given["segments[0].angle"], threads))
    found = alternate(engines, max(1, rounds // 3))
    error = worst(work, given, tolerance)
    for engine, spent in found.items():
        middle, over = median(spent), ratio(spent, found[ours])
        bars = []
        if engine == name:
            bars.append(Bar(f"{name} takes longer, x", over.wall, 5.0))
        if engine == f"{PRODUCT}, 2 threads":
            gain = ratio(found[f"{PRODUCT}, 1 threads"], spent)
            bars.append(Bar("two threads over one", gain.wall, 1.8))
        yield Row(
            f"{count} samples",
            engine,
            error if engine != name else peer.error(),
            middle.wall,
            middle.cpu,
            count * duration / middle.wall,
            times=(over.wall, over.cpu),
            note=f"tolerance {tolerance:g}; starts, masses, moment arms" if engine != name else "starts alone",
            bars=tuple(bars),
        )
    if why:
        yield Row(f"{count} samples", name, missing=why)


def worst(work: Work, given: dict[str, FloatArray], tolerance: float) -> float:
    """Largest error (rad) of some samples."""
    errors = []
    for row in range(0, len(given["segments[0].angle"]), max(1, len(given["segments[0].angle"]) // 3)):
        values = {place: float(column[row]) for place, column in given.items()}
        own = Work("", with_values(work.limb, values), work.duration)
        errors.append(own.error(product(own, tolerance)))
    return max(errors)
