"""Active force by fibre length as the report's source [3] has it: over the optimal length.

2.22 puts 2.20's normalised length, 0 to 2, in the place of the source's l/l_opt, which makes the bell much narrower.
Symbols of the paper: FL force_length_factor, L length over the optimal length, omega, beta, rho.
"""

import math

from limb_nodes.levels.contracts import register
from limb_nodes.levels.equation import Law, equation
from limb_nodes.levels.motor_unit.force_length import cheng


@equation("2.22 over l_opt", "force_length_factor")
def force_length_factor(
    sarcomere_length: float, optimal_sarcomere_length: float, omega: float, beta: float, rho: float
) -> float:
    """Force-length factor (1): a skewed bell with its top at the optimal length."""
    relative = max(0.0, sarcomere_length / optimal_sarcomere_length)
    return math.exp(-(abs((relative**beta - 1.0) / omega) ** rho))


cheng_optimal_length = register(
    Law(
        "force_length",
        "cheng_optimal_length",
        (force_length_factor,),
        cheng.parameters,
        source="Cheng, Brown and Loeb, J Neurosci Methods 101 (2000) 117; Brown, Scott and Loeb, "
        "J Muscle Res Cell Motil 17 (1996) 221",
    )
)
