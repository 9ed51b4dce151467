"""Passive force that grows exponentially, of the Hill-type literature.

Symbols of the paper: F_PE passive_force_factor, k_PE shape, epsilon_0 the strain of the longest
length, 0.6 there; the report's longest length (2.2) is a strain of 0.593.
"""

import math

from limb_nodes.foundation.parameter import Parameter
from limb_nodes.levels.contracts import law, register
from limb_nodes.levels.equation import equation


@register
@law(
    "passive_force",
    Parameter(
        "slack_length",
        "1",
        "normalised fibre length above which the passive force grows",
        1.0,
        "Thelen 2003: the optimal length",
        minimum=0.0,
        below=2.0,
    ),
    Parameter("shape", "1", "steepness of the exponential, k_PE", 5.0, "Thelen 2003", minimum=0.01, maximum=50.0),
    source="Thelen, J Biomech Eng 125 (2003) 70",
)
@equation("Thelen 3", "passive_force_factor")
def exponential(fibre_length_norm: float, slack_length: float, shape: float) -> float:
    """Passive force factor (1): an exponential from 0 at slack to 1 at the longest length."""
    stretch = max(0.0, fibre_length_norm - slack_length) / (2.0 - slack_length)
    return math.expm1(shape * stretch) / math.expm1(shape)
