"""Level of the motor unit: from activation, fibre length and velocity to the force of the unit."""

from limb_nodes.levels.motor_unit import force_frequency, force_length, passive_force, recruitment
from limb_nodes.levels.motor_unit.fibre import EQUATIONS, PARAMETERS

__all__ = [
    "EQUATIONS",
    "PARAMETERS",
    "force_frequency",
    "force_length",
    "passive_force",
    "recruitment",
]
