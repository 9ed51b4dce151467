"""Whether a curve is finite, goes one way and has no kink; else the words for what is wrong."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise

UNITS = {
    "sarcomere_velocity": "m/s",
    "sarcomere_length": "m",
    "stimulation_frequency": "Hz",
    "joint_angle": "rad",
    "tendon_length": "m",
    "tendon_force": "N",
    "muscle_length": "m",
    "total_fibre_force": "N",
}
POINTS = 120
# Share of the greatest value by which a curve may go the wrong way: round-off.
ROUND_OFF = 1e-11
# One-sided slopes that differ by this share are a kink.
KINK = 1e-3


def grid(low: float, high: float, count: int = POINTS) -> list[float]:
    """Evenly spaced points, both ends among them."""
    return [low + (high - low) * index / count for index in range(count)] + [high]


def number_text(value: float) -> str:
    """A number in a message."""
    return "not a number" if math.isnan(value) else f"{value:.4g}"


def point_text(variable: str, value: float) -> str:
    """A point in a message."""
    unit = UNITS.get(variable, "")
    return f"{variable} {value:.6g}{' ' + unit if unit else ''}"


def curve_fault(
    name: str,
    variable: str,
    xs: list[float],
    ys: list[float],
    *,
    direction: int = 0,
    least: float = -math.inf,
    suffix: str = "",
) -> str:
    """The place at which a curve is not finite, goes below `least`, or against `direction` (-1 falls, 1 rises)."""
    for x, y in zip(xs, ys, strict=True):
        if not math.isfinite(y):
            return f"{name} is {number_text(y)} at {point_text(variable, x)}{suffix}; a finite number is needed"
        if y < least:
            return f"{name} is {number_text(y)} at {point_text(variable, x)}{suffix}; a number >= {least:g} is needed"
    if direction:
        slack = ROUND_OFF * max(abs(y) for y in ys)
        for (x0, y0), (x1, y1) in pairwise(zip(xs, ys, strict=True)):
            if direction * (y1 - y0) < -slack:
                wrong, right = ("rises", "falls") if direction < 0 else ("falls", "rises")
                unit = UNITS.get(variable, "")
                span = f"{variable} {x0:.6g} and {x1:.6g}{' ' + unit if unit else ''}"
                return f"{name} {wrong} between {span}{suffix}; a law that {right} is needed"
    return ""


def kink_fault(name: str, variable: str, curve: Callable[[float], float], scale: float, suffix: str) -> str:
    """Whether value or slope differ on the two sides of zero.

    On each side they are those of the parabola through three near points, carried to zero: so
    curvature does not pass for a kink, nor a jump for a steep slope.
    """
    step = 1e-6 * scale
    middle = curve(0.0)
    values, slopes = [], []
    for side in (-step, step):
        one, two, three = curve(side), curve(2.0 * side), curve(3.0 * side)
        values.append(3.0 * one - 3.0 * two + three)
        slopes.append((-5.0 * one + 8.0 * two - 3.0 * three) / (2.0 * side))
    steepest = max(abs(slope) for slope in slopes)
    gap = max(abs(value - middle) for value in values)
    at_zero = point_text(variable, 0.0) + suffix
    if gap > KINK * step * steepest + 1e-9 * abs(middle):
        steps = f"from {values[0]:.4g} over {middle:.4g} to {values[1]:.4g}"
        return f"{name} jumps {steps} at {at_zero}; a continuous law is needed"
    if abs(slopes[1] - slopes[0]) > KINK * steepest + 1e-14 * abs(middle) / step:
        sides = f"its slope is {slopes[0]:.4g} below and {slopes[1]:.4g} above"
        return f"{name} has a kink at {at_zero}: {sides}; a smooth law is needed"
    return ""
