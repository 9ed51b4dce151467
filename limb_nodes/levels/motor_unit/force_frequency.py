"""Active force by stimulation frequency (2.23). Report symbols: FF, f_th threshold, k_tan width."""

import math

from limb_nodes.foundation.parameter import Parameter
from limb_nodes.levels.contracts import law, register
from limb_nodes.levels.equation import equation


@register
@law(
    "force_frequency",
    Parameter(
        "threshold",
        "1",
        "normalised frequency at the centre of the sigmoid",
        0.5,
        "depends on the muscle",
        minimum=-2.0,
        maximum=3.0,
    ),
    Parameter(
        "width",
        "1",
        "width of the sigmoid",
        0.15,
        "depends on the muscle",
        minimum=0.01,
        maximum=100.0,
    ),
    source="report, 2.23",
)
@equation("2.23", "force_frequency_factor")
def sigmoid(frequency_norm: float, threshold: float, width: float) -> float:
    """Force-frequency factor (1): a sigmoid that runs from (0, 0) to (1, 1)."""
    at_zero = 1.0 / (1.0 + math.exp(threshold / width))
    at_one = 1.0 / (1.0 + math.exp((threshold - 1.0) / width))
    at_frequency = 1.0 / (1.0 + math.exp((threshold - frequency_norm) / width))
    return (at_frequency - at_zero) / (at_one - at_zero)
