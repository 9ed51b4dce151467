"""The whole-model solve beside its peers."""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.solve.pieces import pieces
from tests.benchmarks import works
from tests.benchmarks.peers import mujoco_limb, opensim_arm, plain_python, scipy_lsoda, sundials_cvode
from tests.benchmarks.table import Bar, Row
from tests.benchmarks.timing import Spent, alternate, median, ratio, timed
from tests.benchmarks.works import RATE, WANTED, Work

PRODUCT = "limb_nodes"
Solve = Callable[[float], FloatArray]


def missing(module: str) -> str:
    """Why a peer cannot be measured, "" where it can."""
    return "" if importlib.util.find_spec(module) else f"{module} is not installed"


def loosest(work: Work, solve: Solve, exponents: range) -> tuple[float, float]:
    """The loosest tolerance of some powers of ten, and those half-way, with the wanted error, and its error; else
    the best found.
    """
    found = []
    for exponent in range(2 * exponents.start, 2 * exponents.stop - 1):
        tolerance = 10.0 ** (-0.5 * exponent)
        error = work.error(solve(tolerance))
        if error <= WANTED:
            return tolerance, error
        found.append((error, tolerance))
    error, tolerance = min(found)
    return tolerance, error


def product(work: Work, tolerance: float) -> FloatArray:
    """Angles by the product."""
    return work.model.simulate(work.excitation, RATE, tolerance=tolerance, observe=False).angle


def cvode(work: Work, method: str) -> Solve:
    """Angles by CVODE, the input prepared beforehand."""
    model = work.model
    inputs = pieces(model.drives(work.excitation))
    times = np.arange(len(work.excitation)) / RATE
    n = model.layout.joints
    return lambda tolerance: sundials_cvode.solve(model, inputs, 1.0 / RATE, times, tolerance, method)[:, :n]


def lsoda(work: Work) -> Solve:
    """Angles by LSODA with plain Python, the input prepared beforehand."""
    model = work.model
    inputs = pieces(model.drives(work.excitation))
    rates = plain_python.right_hand_side(inputs, 1.0 / RATE)
    apart = plain_python.largest_difference(model, rates, inputs, 1.0 / RATE)
    if apart > 1e-9:
        raise RuntimeError(f"the plain equations are not those of the program: {apart:.1e}")
    times = np.arange(len(work.excitation)) / RATE
    start = model.initial_state()
    return lambda tolerance: scipy_lsoda.solve(rates, start, times, tolerance)[:, :1]


def compare(
    work: Work,
    peers: dict[str, Solve],
    bars: dict[str, float],
    rounds: int,
    mujoco: bool = True,
    absent: dict[str, str] | None = None,
) -> list[Row]:
    """Rows of the product and its peers at one work, each as loose as the wanted error allows.

    bars: least ratio of a peer's time to the product's, by name.
    """
    engines: dict[str, Callable[[], Any]] = {}
    errors: dict[str, float] = {}
    notes: dict[str, str] = {}
    tolerances: dict[str, float] = {}
    apart = work.references[1]
    solves: dict[str, tuple[Solve, range]] = {PRODUCT: (partial(product, work), range(6, 12))}
    solves.update({name: (solve, range(5, 13)) for name, solve in peers.items()})
    for name, (solve, exponents) in solves.items():
        tolerance, errors[name] = loosest(work, solve, exponents)
        engines[name] = partial(solve, tolerance)
        notes[name] = f"tolerance {tolerance:.2g}"
        tolerances[name] = tolerance
    steps = work.model.simulate(work.excitation, RATE, tolerance=tolerances[PRODUCT], observe=False).steps
    notes[PRODUCT] += f", {steps[0]} steps, reference certain to {apart:.0e}"
    default = f"{PRODUCT}, default"
    engines[default] = partial(product, work, 1e-9)
    errors[default] = work.error(product(work, 1e-9))
    notes[default] = "tolerance 1e-09"
    absent = dict(absent or {})
    if mujoco:
        absent.update({mujoco_limb.NAME: missing("mujoco")} if missing("mujoco") else {})
        if not missing("mujoco"):
            limb = mujoco_limb.MujocoLimb(work.limb, work.excitation)
            engines[mujoco_limb.NAME] = limb.solve
            errors[mujoco_limb.NAME] = limb.error()
            notes[mujoco_limb.NAME] = "rollout; error against its own RK4 at 0.1 ms"
    found = alternate({name: partial(timed, engine) for name, engine in engines.items()}, rounds)
    rows = []
    for name, spent in found.items():
        middle, times = median(spent), ratio(spent, found[PRODUCT])
        shown = (Bar(f"{name} takes longer, x", times.wall, bars[name]),) if name in bars else ()
        if name == PRODUCT:
            shown = (Bar("error, rad", errors[name], max(WANTED, 3.0 * apart), at_least=False),)
        rows.append(
            Row(
                work.name,
                name,
                errors[name],
                middle.wall,
                middle.cpu,
                work.duration / middle.wall,
                times=(times.wall, times.cpu),
                note=notes[name],
                bars=shown,
            )
        )
    return [*rows, *(Row(work.name, name, missing=why) for name, why in absent.items())]


def joint(rounds: int, duration: float) -> Iterator[Row]:
    """The reference joint with rigid tendons."""
    work = works.joint(duration)
    peers = {scipy_lsoda.NAME: lsoda(work)}
    absent = missing("sksundae")
    if not absent:
        peers[sundials_cvode.NAME] = cvode(work, "Adams")
    bars = {mujoco_limb.NAME: 5.0, scipy_lsoda.NAME: 20.0, sundials_cvode.NAME: 8.0}
    yield from compare(work, peers, bars, rounds, absent={sundials_cvode.NAME: absent} if absent else {})


def tendon(rounds: int, duration: float) -> Iterator[Row]:
    """The reference joint with elastic tendons."""
    work = works.joint_tendon(duration)
    absent = missing("sksundae")
    peers = {} if absent else {sundials_cvode.NAME: cvode(work, "BDF")}
    lacking = {sundials_cvode.NAME: absent} if absent else {}
    yield from compare(work, peers, {sundials_cvode.NAME: 5.0}, rounds, absent=lacking)


def arm(rounds: int, duration: float) -> Iterator[Row]:
    """The arm with elastic tendons."""
    work = works.arm(duration)
    rows = compare(work, {}, {mujoco_limb.NAME: 1.0}, rounds)
    yield from rows
    why = missing("opensim")
    if why:
        yield Row(work.name, opensim_arm.NAME, missing=why)
        return
    yield opensim_row(work, next(row for row in rows if row.engine == PRODUCT), rounds)


def opensim_row(work: Work, ours: Row, rounds: int) -> Row:
    """OpenSim in a process of its own, alternated with the product."""
    given = opensim_arm.description(work.limb, work.duration)

    def run(accuracy: float | None) -> dict[str, Any]:
        request = json.dumps({"arm": given, "accuracy": accuracy})
        command = [sys.executable, str(Path(opensim_arm.__file__))]
        done = subprocess.run(command, input=request, capture_output=True, text=True, check=True)
        answer: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
        return answer

    def spent() -> Spent:
        answer = run(None)
        return Spent(answer["wall"], answer["cpu"])

    tolerance = float(ours.note.split()[1].rstrip(","))
    found = alternate(
        {opensim_arm.NAME: spent, PRODUCT: partial(timed, partial(product, work, tolerance))}, max(3, rounds // 3)
    )
    tight, loose = run(1e-9)["angles"], run(None)["angles"]
    error = max(abs(a - b) for a, b in zip(tight, loose, strict=True))
    times = ratio(found[opensim_arm.NAME], found[PRODUCT])
    middle = median(found[opensim_arm.NAME])
    return Row(
        work.name,
        opensim_arm.NAME,
        error,
        middle.wall,
        middle.cpu,
        work.duration / middle.wall,
        times=(times.wall, times.cpu),
        note="default accuracy; error at the end, against its own 1e-9",
        bars=(Bar(f"{opensim_arm.NAME} takes longer, x", times.wall, 100.0),),
    )


def chains(rounds: int, duration: float) -> Iterator[Row]:
    """Chains of growing length."""
    cost: dict[int, float] = {}
    for joints in (1, 2, 4, 8):
        work = works.chain(joints, duration)
        rows = compare(work, {}, {}, rounds)
        steps = work.model.simulate(work.excitation, RATE, tolerance=1e-9, observe=False).steps
        default = next(row for row in rows if row.engine == f"{PRODUCT}, default")
        cost[joints] = default.cpu / sum(steps)
        if joints > 2:
            yield from rows
    for joints in (4, 8):
        growth = cost[joints] / cost[joints // 2]
        yield Row(
            f"chain of {joints}",
            "cost of a step",
            wall=cost[joints],
            cpu=cost[joints],
            speed=1.0 / cost[joints],
            unit="steps",
            note=f"x {growth:.2f} from {joints // 2} joints",
            bars=(Bar(f"cost of a step over that of {joints // 2} joints", growth, 4.0, at_least=False),),
        )


def many_units(rounds: int, duration: float) -> Iterator[Row]:
    """Motor units without number."""
    counts = (2, 20, 200)
    made = {count: works.units(count, duration) for count in counts}
    chosen = {count: loosest(work, partial(product, work), range(6, 12)) for count, work in made.items()}
    found = alternate(
        {str(c): partial(timed, partial(product, work, chosen[c][0])) for c, work in made.items()}, rounds
    )
    for count, work in made.items():
        spent = found[str(count)]
        middle, times = median(spent), ratio(spent, found["2"])
        bars = (Bar("time over that of 2 units", times.wall, 1.5, at_least=False),) if count == 200 else ()
        tolerance, error = chosen[count]
        note = f"tolerance {tolerance:g}; x: over 2 units"
        yield Row(
            work.name,
            PRODUCT,
            error,
            middle.wall,
            middle.cpu,
            work.duration / middle.wall,
            times=(times.wall, times.cpu),
            note=note,
            bars=bars,
        )
