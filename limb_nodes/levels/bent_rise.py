"""An exponential rise from 0 to 1, which several laws bend one way or the other."""

import math

# Below this, the rise is a straight line to the last digit but one.
STRAIGHT = 1e-6


def bent_rise(part: float, bend: float) -> float:
    """Height (1) at a part of the way, (exp(bend part) - 1)/(exp(bend) - 1): early if the bend is negative."""
    if abs(bend) < STRAIGHT:
        return part
    return math.expm1(bend * part) / math.expm1(bend)
