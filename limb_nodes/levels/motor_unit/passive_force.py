"""Passive force by fibre length (2.24). Report symbols: F_PE, l_F^slack slack_length."""

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
        1.2,
        "depends on the muscle",
        minimum=0.0,
        below=2.0,
    ),
    source="report, 2.24 [4]",
)
@equation("2.24", "passive_force_factor")
def quadratic(fibre_length_norm: float, slack_length: float) -> float:
    """Passive force factor (1): a parabola from 0 at slack to 1 at the longest length."""
    stretch = max(0.0, fibre_length_norm - slack_length)
    return (stretch / (2.0 - slack_length)) ** 2
