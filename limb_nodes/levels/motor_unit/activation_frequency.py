"""Active force by stimulation frequency and fibre length, of the report's source [3].

Symbols of the paper: Af force_frequency_factor, f_eff stimulation frequency over f_0.5, the one of
half the tetanic force at the optimal length, a_f scale, n_f0 exponent, n_f1 length_dependence,
L length over the optimal length. Yield Y and sag S of the paper are 1 here: they have dynamics of
their own.
"""

import math

from limb_nodes.foundation.parameter import Parameter
from limb_nodes.levels.contracts import law, register
from limb_nodes.levels.equation import equation


@register
@law(
    "force_frequency",
    Parameter(
        "half_frequency",
        "1",
        "frequency of half the tetanic force at the optimal length, f_0.5, over the unit's greatest frequency",
        0.5,
        "Cheng et al. 2000: units fire at 0.5 to 2 f_0.5",
        minimum=0.01,
        maximum=10.0,
    ),
    Parameter("scale", "1", "scale of the frequency, a_f", 0.56, "Cheng et al. 2000", minimum=0.01, maximum=10.0),
    Parameter(
        "exponent", "1", "exponent at the optimal length, n_f0", 2.1, "Cheng et al. 2000", minimum=0.1, maximum=20.0
    ),
    Parameter(
        "length_dependence",
        "1",
        "change of the exponent with 1/L, n_f1",
        5.0,
        "Cheng et al. 2000, slow; fast 3.3",
        minimum=0.0,
        maximum=20.0,
    ),
    source="Brown, Cheng and Loeb, J Muscle Res Cell Motil 20 (1999) 627; report [3]",
)
@equation("Af", "force_frequency_factor")
def cheng(
    stimulation_frequency: float,
    maximum_frequency: float,
    sarcomere_length: float,
    optimal_sarcomere_length: float,
    half_frequency: float,
    scale: float,
    exponent: float,
    length_dependence: float,
) -> float:
    """Force-frequency factor (1): 1 - exp(-(f_eff/(a_f n_f))^n_f), n_f = n_f0 + n_f1 (1/L - 1).

    A long fibre needs a lower frequency than a short one. The exponent stays above 0.1: beyond
    1.7 optimal lengths, at which the filaments no longer overlap, it would turn negative.
    """
    if stimulation_frequency <= 0.0:
        return 0.0
    frequency = stimulation_frequency / (half_frequency * maximum_frequency)
    bent = max(0.1, exponent + length_dependence * (optimal_sarcomere_length / sarcomere_length - 1.0))
    return 1.0 - math.exp(-((frequency / (scale * bent)) ** bent))
