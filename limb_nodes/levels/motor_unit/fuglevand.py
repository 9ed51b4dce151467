"""Recruitment with exponentially spaced thresholds, of the motor-unit pool of Fuglevand et al.

Symbols of the paper: RR threshold_range, RTE_i the excitation at which unit i joins,
E_max the greatest excitation, MFR minimum_frequency, PFR maximum_frequency; i/n unit_rank.
Many units join early and few late. All rise with the same slope, so early units reach their
greatest frequency before the last ones do. The muscle's activation_threshold plays no part.
"""

from limb_nodes.foundation.parameter import Parameter
from limb_nodes.levels.contracts import law, register
from limb_nodes.levels.equation import equation


@register
@law(
    "recruitment",
    Parameter(
        "threshold_range",
        "1",
        "threshold of the last unit over that of the first, RR",
        30.0,
        "Fuglevand et al. 1993, broad recruitment",
        minimum=1.0,
        maximum=1e4,
    ),
    Parameter(
        "full_recruitment",
        "1",
        "activation at which the last unit joins, RTE_n/E_max",
        0.53,
        "Fuglevand et al. 1993: 30/57 with a gain of 1, MFR 8 and PFR 35 Hz",
        above=0.0,
        below=1.0,
    ),
    source="Fuglevand, Winter and Patla, J Neurophysiol 70 (1993) 2470",
)
@equation("RTE", "stimulation_frequency")
def fuglevand(
    activation: float,
    unit_rank: float,
    minimum_frequency: float,
    maximum_frequency: float,
    threshold_range: float,
    full_recruitment: float,
) -> float:
    """Stimulation frequency (Hz): 0 below RTE_i = RTE_n RR^(i/n - 1), then linear up to f_max."""
    threshold: float = full_recruitment * threshold_range ** (unit_rank - 1.0)
    if activation < threshold:
        return 0.0
    slope = (maximum_frequency - minimum_frequency) / (1.0 - full_recruitment)
    return min(maximum_frequency, minimum_frequency + slope * (activation - threshold))
