"""Active force by fibre length (2.22). Report symbols: FL, omega, beta, rho."""

import math

from limb_nodes.foundation.parameter import Parameter
from limb_nodes.levels.contracts import law, register
from limb_nodes.levels.equation import equation


@register
@law(
    "force_length",
    Parameter(
        "omega",
        "1",
        "width of the characteristic",
        1.12,
        "report, 2.2.2 [3], slow; fast 0.75",
        minimum=0.05,
        maximum=10.0,
    ),
    Parameter(
        "beta",
        "1",
        "skewness of the characteristic",
        2.3,
        "report, 2.2.2 [3], slow; fast 1.55",
        minimum=0.1,
        maximum=10.0,
    ),
    Parameter(
        "rho",
        "1",
        "roundness of the characteristic",
        1.61,
        "report, 2.2.2 [3], slow; fast 2.21",
        minimum=1.0,
        maximum=10.0,
    ),
    source="Cheng, Brown and Loeb, J Neurosci Methods 101 (2000) 117",
)
@equation("2.22", "force_length_factor")
def cheng(fibre_length_norm: float, omega: float, beta: float, rho: float) -> float:
    """Force-length factor (1): a skewed bell with its top at the optimal length."""
    return math.exp(-(abs((fibre_length_norm**beta - 1.0) / omega) ** rho))


@register
@law("force_length", source="report, 3.3.1: muscles of constant force")
@equation("constant", "force_length_factor")
def constant(fibre_length_norm: float) -> float:
    """Force-length factor (1) that is 1 at every length."""
    return 1.0
