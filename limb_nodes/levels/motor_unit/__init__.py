"""Level of the motor unit: from activation, fibre length and velocity to the force of the unit."""

from limb_nodes.levels.motor_unit import (
    activation_frequency,
    cheng_optimal_length,
    exponential_passive_force,
    force_frequency,
    force_length,
    fuglevand,
    gordon_huxley_julian,
    passive_force,
    recruitment,
    twitch_tetanus,
)
from limb_nodes.levels.motor_unit.fibre import EQUATIONS, PARAMETERS

__all__ = [
    "EQUATIONS",
    "PARAMETERS",
    "activation_frequency",
    "cheng_optimal_length",
    "exponential_passive_force",
    "force_frequency",
    "force_length",
    "fuglevand",
    "gordon_huxley_julian",
    "passive_force",
    "recruitment",
    "twitch_tetanus",
]
