"""Lengths of muscles out of the range that their laws are made for: looked at at every instant, told at the end.

Beyond their range the laws still give forces, which mean nothing: a fibre shorter than its shortest pulls as that one.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.levels.motor_unit import fibre
from limb_nodes.levels.sarcomere.lengths import sarcomere_lengths
from limb_nodes.model.limb import MotorUnit, Muscle
from limb_nodes.solve.outputs import LENGTHS

if TYPE_CHECKING:
    from limb_nodes.solve.whole import Movement, WholeModel

# What stands before the place of a length in the key under which it is told on `/diagnostics`.
OUT_OF_RANGE = "out of range: "
LEFT = "lengths of muscles have left their range"


class Outside(NamedTuple):
    """A length of a muscle that was out of its range.

    length: one of `LENGTHS`. share: of the instants at which it was. lowest, highest: over all instants (m).
    allowed: its range (m).
    """

    muscle: str
    length: str
    share: float
    lowest: float
    highest: float
    allowed: tuple[float, float]

    @property
    def told(self) -> str:
        """How far, and for how long, in words."""
        low, high = (1e3 * limit for limit in self.allowed)
        needed = f"{low:.4g} to {high:.4g} mm" if math.isfinite(high) else f"{low:.4g} mm or more"
        span = f"is {1e3 * self.lowest:.4g} to {1e3 * self.highest:.4g} mm"
        return f"{span}, out of its range of {needed} for {100.0 * self.share:.3g} % of the time"


class Ranges:
    """Looks at the lengths of all muscles of a model, piece by piece."""

    def __init__(self, model: WholeModel) -> None:
        self._model = model
        muscles = model.limb.muscles
        self._limits = np.array([limits(muscle) for muscle in muscles]).reshape(len(muscles), len(LENGTHS), 2)
        self._seen = np.tile([0.0, math.inf, -math.inf], (len(muscles), len(LENGTHS), 1))
        self._count = 0

    def look(self, states: FloatArray) -> bool:
        """Judge some instants; whether a length leaves its range for the first time.

        states: [T, 2 n + internal states], joint angles, joint velocities and internal states, in rows without gaps.
        """
        self._count += len(states)
        model = self._model
        return bool(model.program.look(states, model.layout.model.address, self._limits, self._seen))

    def look_at(self, movement: Movement) -> None:
        """Judge all instants of a movement, or of a part of one."""
        self.look(np.concatenate([movement.angle, movement.velocity, movement.internal], axis=1))

    def outside(self) -> list[Outside]:
        """The lengths that were out of their range."""
        muscles = self._model.limb.muscle_names
        return [
            Outside(muscles[m], LENGTHS[i], count / self._count, lowest, highest, tuple(self._limits[m, i].tolist()))
            for m, row in enumerate(self._seen.tolist())
            for i, (count, lowest, highest) in enumerate(row)
            if count
        ]

    def told(self) -> dict[str, str]:
        """The same in words, by MUSCLE.LENGTH."""
        return {f"{one.muscle}.{one.length}": one.told for one in self.outside()}


def limits(muscle: Muscle) -> FloatArray:
    """Lowest and highest value (m) of each of `LENGTHS` [lengths, 2].

    Fibres lie between their shortest and longest length (2.17, 2.18), those of all motor units; nothing is shorter
    than 0. A law that declares a narrower range of a length has it.
    """
    allowed = {name: [0.0, math.inf] for name in LENGTHS}
    for unit in muscle.units:
        narrow(allowed["fibre_length"], fibre_lengths(unit))
    for chosen in muscle.laws.values():
        for name in chosen.law.ranges.keys() & allowed.keys():
            narrow(allowed[name], chosen.law.ranges[name])
    return np.array([allowed[name] for name in LENGTHS])


def narrow(allowed: list[float], span: tuple[float, float]) -> None:
    """Leave of a range what another one has too."""
    allowed[:] = max(allowed[0], span[0]), min(allowed[1], span[1])


def fibre_lengths(unit: MotorUnit) -> tuple[float, float]:
    """Shortest and longest length (m) of a unit's fibres."""
    sarcomere = sarcomere_lengths(unit.laws["sarcomere"].values)
    series = unit.values["series_sarcomeres"]
    return (
        fibre.minimum_fibre_length(series, sarcomere["minimum_sarcomere_length"]),
        fibre.maximum_fibre_length(series, sarcomere["maximum_sarcomere_length"]),
    )
