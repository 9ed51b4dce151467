"""Stimulation frequency by activation, and the order in which units join (2.36, 2.42).

Report symbols: U activation, U_th activation_threshold, U_th,i unit_threshold,
f_F stimulation_frequency, PCSA_F pcsa, PCSA_M muscle_pcsa.
"""

from collections.abc import Sequence

from limb_nodes.levels.contracts import law, register
from limb_nodes.levels.equation import equation


def unit_thresholds(pcsa: Sequence[float], activation_threshold: float) -> list[float]:
    """Activation (1) from which each unit fires (2.36, 2.42).

    pcsa: areas (m^2) of the muscle's units in the order of recruitment.
    Unit i joins when the share of the area up to and with it is activated:
    U_th,i = U_th (PCSA_1 + ... + PCSA_i) / PCSA_M.
    """
    muscle_pcsa = sum(pcsa)
    thresholds, recruited = [], 0.0
    for area in pcsa:
        recruited += area
        thresholds.append(activation_threshold * recruited / muscle_pcsa)
    return thresholds


@register
@law("recruitment", source="report, 2.36 [3]")
@equation("2.36", "stimulation_frequency")
def linear(activation: float, unit_threshold: float, minimum_frequency: float, maximum_frequency: float) -> float:
    """Stimulation frequency (Hz): 0 below the unit's threshold, then linear up to f_max."""
    if activation < unit_threshold or activation <= 0.0:
        return 0.0
    return (maximum_frequency - minimum_frequency) / (1.0 - unit_threshold) * (
        activation - unit_threshold
    ) + minimum_frequency
