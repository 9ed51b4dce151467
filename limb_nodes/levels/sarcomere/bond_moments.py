"""Moments of a normal distribution of bond lengths below a bound, and what detaches from it.

Bond lengths are in units of the reach h. `mean` and `deviation` are those of the distribution
(1). Huxley's rates with Zahalak's extension, at the bond length x:
f = f_1 x for 0 < x < 1, else 0;
g = g_2 for x < 0, g_1 x for 0 < x < 1, g_1 x + g_3 (x - 1) beyond.
"""

import math


def share_below(bound: float, mean: float, deviation: float) -> float:
    """Zeroth moment (1) of the bonds shorter than `bound`."""
    return 0.5 * (1.0 + math.erf((bound - mean) / (deviation * math.sqrt(2.0))))


def density(bound: float, mean: float, deviation: float) -> float:
    """Deviation times the density (1) at `bound`."""
    distance = (bound - mean) / deviation
    return deviation * math.exp(-0.5 * distance * distance) / math.sqrt(2.0 * math.pi)


def first_below(bound: float, mean: float, deviation: float) -> float:
    """First moment (1) of the bonds shorter than `bound`."""
    return mean * share_below(bound, mean, deviation) - density(bound, mean, deviation)


def second_below(bound: float, mean: float, deviation: float) -> float:
    """Second moment (1) of the bonds shorter than `bound`."""
    square = mean * mean + deviation * deviation
    return square * share_below(bound, mean, deviation) - (mean + bound) * density(bound, mean, deviation)


def third_below(bound: float, mean: float, deviation: float) -> float:
    """Third moment (1) of the bonds shorter than `bound`."""
    cube = mean * (mean * mean + 3.0 * deviation * deviation)
    square = mean * mean + mean * bound + bound * bound + 2.0 * deviation * deviation
    return cube * share_below(bound, mean, deviation) - square * density(bound, mean, deviation)


def loss_0(mean: float, deviation: float, f1: float, g1: float, g2: float, g3: float) -> float:
    """Zeroth moment of (f + g) n (1/s) over that of the bonds n."""
    within = first_below(1.0, mean, deviation)
    return (
        g2 * share_below(0.0, mean, deviation)
        + (f1 + g1) * (within - first_below(0.0, mean, deviation))
        + (g1 + g3) * (mean - within)
        - g3 * (1.0 - share_below(1.0, mean, deviation))
    )


def loss_1(mean: float, deviation: float, f1: float, g1: float, g2: float, g3: float) -> float:
    """First moment of (f + g) n (1/s) over the zeroth of the bonds n."""
    within = second_below(1.0, mean, deviation)
    return (
        g2 * first_below(0.0, mean, deviation)
        + (f1 + g1) * (within - second_below(0.0, mean, deviation))
        + (g1 + g3) * (mean * mean + deviation * deviation - within)
        - g3 * (mean - first_below(1.0, mean, deviation))
    )


def loss_2(mean: float, deviation: float, f1: float, g1: float, g2: float, g3: float) -> float:
    """Second moment of (f + g) n (1/s) over the zeroth of the bonds n."""
    within = third_below(1.0, mean, deviation)
    return (
        g2 * second_below(0.0, mean, deviation)
        + (f1 + g1) * (within - third_below(0.0, mean, deviation))
        + (g1 + g3) * (mean * (mean * mean + 3.0 * deviation * deviation) - within)
        - g3 * (mean * mean + deviation * deviation - second_below(1.0, mean, deviation))
    )
