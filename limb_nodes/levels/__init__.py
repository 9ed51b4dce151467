"""The physics, one place per level of the report, as small pure functions of scalars.

Importing this package registers every law that comes with it.
"""

from limb_nodes.foundation.parameter import Parameter
from limb_nodes.levels import joint, limb, motor_unit, muscle, sarcomere
from limb_nodes.levels.contracts import CONTRACTS, MUSCLE_PROCESSES, REGISTRY, UNIT_PROCESSES, Contract, law, register
from limb_nodes.levels.equation import Equation, Law, State, equation, equation_of

__all__ = [
    "CONTRACTS",
    "MUSCLE_PROCESSES",
    "REGISTRY",
    "UNIT_PROCESSES",
    "Contract",
    "Equation",
    "Law",
    "Parameter",
    "State",
    "equation",
    "equation_of",
    "joint",
    "law",
    "limb",
    "motor_unit",
    "muscle",
    "register",
    "sarcomere",
]
