"""Level of the muscle, with its sub-levels tendon and aponeurosis."""

from limb_nodes.levels.muscle import (
    activation_dynamics,
    aponeurosis,
    constant_thickness,
    first_order,
    geometric_path,
    path,
    second_order,
    tendon,
    toe_region,
)
from limb_nodes.levels.muscle.whole import EQUATIONS, muscle_equations

__all__ = [
    "EQUATIONS",
    "activation_dynamics",
    "aponeurosis",
    "constant_thickness",
    "first_order",
    "geometric_path",
    "muscle_equations",
    "path",
    "second_order",
    "tendon",
    "toe_region",
]
