"""The characteristics of a limb's laws as curves, in SI units: what `limb curves` draws.

Laws that are the same with the same values share a curve, whose label names where they are.
"""

from __future__ import annotations

from limb_nodes.analysis.curves import motor_units, muscles
from limb_nodes.analysis.curves.characteristic import Axis, Characteristic, Curve
from limb_nodes.model import Limb

__all__ = ["Axis", "Characteristic", "Curve", "characteristics"]


def characteristics(limb: Limb) -> list[Characteristic]:
    """Every characteristic of a limb's laws; those without a curve are left out."""
    every = [
        motor_units.force_velocity(limb),
        motor_units.force_length(limb),
        motor_units.force_frequency(limb),
        motor_units.passive_force(limb),
        motor_units.recruitment(limb),
        muscles.activation_dynamics(limb),
        muscles.tendon(limb),
        muscles.paths(limb),
        muscles.moment_arms(limb),
        muscles.pennation(limb),
    ]
    return [one for one in every if one.curves]
