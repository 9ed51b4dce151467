"""The limbs that are solved, their input, and tight references."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.model import Limb, load_limb, with_values
from limb_nodes.model.load import build_limb
from limb_nodes.model.shipped import shipped
from limb_nodes.solve.whole import WholeModel

RATE = 1000.0
WANTED = 1e-6
TIGHT = 1e-12


@dataclass(frozen=True)
class Work:
    """A limb and how long it moves (s)."""

    name: str
    limb: Limb
    duration: float

    @cached_property
    def model(self) -> WholeModel:
        """The limb ready to be solved."""
        return WholeModel(self.limb)

    @cached_property
    def excitation(self) -> FloatArray:
        """Flexors follow a sine, extensors a cosine of 1 Hz, without their negative half-waves [T, muscles]."""
        time = np.arange(round(self.duration * RATE) + 1) / RATE
        waves = [
            np.sin(2.0 * np.pi * time) if muscle.role > 0.0 else np.cos(2.0 * np.pi * time)
            for muscle in self.limb.muscles
        ]
        return np.ascontiguousarray(np.clip(np.stack(waves, axis=1), 0.0, 1.0))

    @cached_property
    def references(self) -> tuple[FloatArray, float]:
        """Angles [T, n] by the explicit method at a tight tolerance, and how far the implicit one is from them."""
        solve = self.model.simulate
        one = solve(self.excitation, RATE, tolerance=TIGHT, method="explicit", observe=False).angle
        other = solve(self.excitation, RATE, tolerance=10.0 * TIGHT, method="implicit", observe=False).angle
        return one, float(np.abs(one - other).max())

    def error(self, angle: FloatArray) -> float:
        """Largest distance (rad) from the reference."""
        return float(np.abs(angle - self.references[0]).max())


def joint(duration: float) -> Work:
    """The reference joint with rigid tendons."""
    return Work("joint", load_limb(shipped("reference_joint.yaml")), duration)


def joint_tendon(duration: float) -> Work:
    """The reference joint with elastic tendons."""
    return Work("joint, tendons", load_limb(shipped("reference_joint_tendon.yaml")), duration)


def arm(duration: float) -> Work:
    """The arm: two joints with ranges, five muscles with elastic tendons."""
    return Work("arm", load_limb(shipped("arm.yaml")), duration)


def chain(joints: int, duration: float) -> Work:
    """Segments and muscles of the reference joint one behind the other, each joint with a range."""
    base = load_limb(shipped("reference_joint.yaml"))
    content = dict(base.content)
    [segment] = content["segments"]
    muscles = content["muscles"]
    content["segments"] = [
        {**segment, "name": f"segment{k}", "joint": f"joint{k}", "angle": 0.3, "range": [-0.5, 2.0]}
        for k in range(joints)
    ]
    content["muscles"] = [
        {**muscle, "name": f"{muscle['name']}{k}", "joint": f"joint{k}"} for k in range(joints) for muscle in muscles
    ]
    limb = build_limb(content, f"chain of {joints}", "")
    return Work(f"chain of {joints}", limb, duration)


def units(count: int, duration: float) -> Work:
    """The reference joint with tendons, `count` equal motor units in each muscle, recruited one by one."""
    base = load_limb(shipped("reference_joint_tendon.yaml"))
    changes: dict[str, Any] = {}
    for m, muscle in enumerate(base.muscles):
        [unit] = muscle.units
        place = f"muscles[{m}].units[0]"
        changes[f"{place}.count"] = count
        for name in ("parallel_sarcomeres", "maximum_passive_force", "pcsa"):
            changes[f"{place}.{name}"] = unit.values[name] / count
    return Work(f"{count} units", with_values(base, changes), duration)
