"""One characteristic: a diagram with its axes and curves."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from limb_nodes.foundation.arrays import FloatArray


@dataclass(frozen=True)
class Axis:
    """What an axis shows, and its SI unit."""

    label: str
    unit: str


@dataclass(frozen=True)
class Curve:
    """x, y: SI units [points]. key: what it belongs to, for its colour.

    label: in the legend, "" for a further curve of the same. style: 0 for a law's own curve, 1 and
    more for its variants.
    """

    label: str
    x: FloatArray
    y: FloatArray
    key: str
    style: int = 0


@dataclass
class Characteristic:
    """A diagram. figure: of the report. laws: names of those that are drawn. note: what else a reader should know.

    owners: what the curves belong to, "units" or "muscles". zero: whether the y axis starts at zero.
    """

    name: str
    title: str
    x: Axis
    y: Axis
    figure: str = ""
    owners: str = "units"
    zero: bool = True
    curves: list[Curve] = field(default_factory=list)
    laws: list[str] = field(default_factory=list)
    note: str = ""

    def add(self, curve: Curve) -> None:
        """Append a curve; one that cannot be told from an earlier one joins it in the legend."""
        for index, old in enumerate(self.curves):
            if old.label and curve.label and same_curve(old, curve):
                self.curves[index] = replace(old, label=f"{old.label}, {curve.label}")
                return
        self.curves.append(curve)


def same_curve(one: Curve, other: Curve) -> bool:
    """Whether two curves cannot be told apart."""
    return (
        one.x.shape == other.x.shape
        and np.allclose(one.x, other.x, rtol=1e-4)
        and np.allclose(one.y, other.y, rtol=1e-4, equal_nan=True)
    )
