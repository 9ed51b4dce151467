"""Muscles that leave the range of their laws: each says so, in whatever pieces its movement is looked at."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from limb_nodes.errors import UserError
from limb_nodes.model import Limb, load_limb, with_values
from limb_nodes.solve.failure import SolveError
from limb_nodes.solve.ranges import Ranges
from limb_nodes.solve.whole import Movement, WholeModel
from tests.faults.trial import Trial

KIND = "lengths of muscles out of range"
COUNT = 200
PARAMS = Path(__file__).resolve().parents[2] / "params"
LIMBS = "reference_joint", "reference_joint_tendon", "pennate_leg"


def trials(count: int, seed: int) -> Iterator[Trial]:
    """Shipped limbs with other numbers of sarcomeres, other tendons and free joints, driven at random for 0.3 s."""
    limbs = [load_limb(PARAMS / f"{name}.yaml") for name in LIMBS]
    for number in range(count):
        rng = np.random.default_rng([seed, number])
        given = limbs[number % len(limbs)]
        values: dict[str, object] = {f"segments[{k}].range": None for k in range(len(given.segments))}
        for m, muscle in enumerate(given.muscles):
            factor = float(rng.uniform(0.4, 2.5))
            for u, unit in enumerate(muscle.units):
                series = unit.values["series_sarcomeres"] * factor
                values[f"muscles[{m}].units[{u}].series_sarcomeres"] = series
        what = f"{given.name}, seed {seed}, number {number}"
        try:
            limb = with_values(given, values)
            model = WholeModel(limb)
            excitation = np.repeat(rng.uniform(0.0, 1.0, (4, len(limb.muscles))), 76, axis=0)[:301]
            movement = model.simulate(excitation, 1000.0)
        except (UserError, SolveError):
            # Refused, or given up with a reason: nothing is out of range without a word.
            yield Trial(what)
            continue
        ranges = Ranges(model)
        rows = np.concatenate([movement.angle, movement.velocity, movement.internal], axis=1)
        for piece in np.split(rows, np.sort(rng.integers(0, len(rows), 5))):
            ranges.look(np.ascontiguousarray(piece))
        found = {(one.muscle, one.length): (one.share, one.lowest, one.highest) for one in ranges.outside()}
        yield Trial(what, changed=not same(found, expected(limb, movement)))


Found = dict[tuple[str, str], tuple[float, float, float]]


def same(one: Found, other: Found) -> bool:
    """Whether two findings agree, lengths to rounding."""
    return one.keys() == other.keys() and all(np.allclose(one[key], other[key], rtol=1e-12) for key in one)


def expected(limb: Limb, movement: Movement) -> Found:
    """What the outputs of a movement show, by the report's 2.1 to 2.3, 2.17 and 2.18."""
    found = {}
    for m, muscle in enumerate(limb.muscles):
        spans = [(0.0, np.inf)]
        for unit in muscle.units:
            filaments, series = unit.laws["sarcomere"].values, unit.values["series_sarcomeres"]
            myosin, actin = filaments["myosin_length"], filaments["actin_length"]
            spans.append((0.9 * myosin * series, (myosin + 2.0 * actin) * series))
        narrowest = max(low for low, _ in spans), min(high for _, high in spans)
        for name, (low, high) in {
            "muscle_tendon_length": spans[0],
            "muscle_length": spans[0],
            "tendon_length": spans[0],
            "aponeurosis_length": spans[0],
            "fibre_length": narrowest,
        }.items():
            length = movement.muscle[name][:, m]
            if (out := (length < low) | (length > high)).any():
                found[muscle.name, name] = (float(out.mean()), float(length.min()), float(length.max()))
    return found
