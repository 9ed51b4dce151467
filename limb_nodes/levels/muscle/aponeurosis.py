"""Pennation: aponeurosis, fibres and line of pull as a triangle of constant area (2.29-2.52).

Report symbols: l_M muscle_length, v_M muscle_velocity, l_F fibre_length, v_F fibre_velocity,
l_A aponeurosis_length, v_A aponeurosis_velocity (positive when lengthening),
theta_penn pennation_angle (between aponeurosis and fibres), beta_AM aponeurosis_angle (between
aponeurosis and line of pull), alpha_FM fibre_angle (between fibres and line of pull),
F_F* total_fibre_force, F_M muscle_force, F_A aponeurosis_force, A area, C_A stiffness,
V_A viscosity, l_A^slack slack_length.

The pennation angle is no state of its own: it follows from muscle and aponeurosis length (2.51),
so 2.29 serves only to derive the fibre velocity, and nothing drifts.
"""

import math

from limb_nodes.foundation.parameter import Parameter
from limb_nodes.levels.contracts import register
from limb_nodes.levels.equation import Law, State, equation


@equation("2.51", "pennation_angle")
def pennation_angle(muscle_length: float, aponeurosis_length: float, area: float) -> float:
    """Angle (rad) between aponeurosis and fibres at which the triangle has the given area.

    The form of 2.51 that also tells an obtuse angle: its sine is A/(l_A l_F) and its cosine
    (sqrt(l_M^2 l_A^2 - A^2) - l_A^2)/(l_A l_F). Raises ValueError (NaN if compiled) if the two
    lengths cannot span the area.
    """
    spanned = muscle_length * aponeurosis_length
    return math.atan2(area, math.sqrt(spanned * spanned - area * area) - aponeurosis_length * aponeurosis_length)


@equation("2.34", "fibre_length")
def fibre_length(muscle_length: float, aponeurosis_length: float, area: float) -> float:
    """Fibre length (m) by the law of cosines.

    The form of 2.34 with 2.51 put in, l_F^2 = l_A^2 + l_M^2 - 2 sqrt(l_A^2 l_M^2 - A^2), without its cancellation. Of
    the angle alone 2.34 has two roots once the muscle is shorter than the aponeurosis. Raises ValueError (NaN if
    compiled) if the two lengths cannot span the area.
    """
    spanned = muscle_length * aponeurosis_length
    along = muscle_length - aponeurosis_length
    return math.sqrt(along * along + 2.0 * area * area / (spanned + math.sqrt(spanned * spanned - area * area)))


@equation("2.40", "aponeurosis_angle")
def aponeurosis_angle(fibre_length: float, muscle_length: float, pennation_angle: float) -> float:
    """Angle (rad) between aponeurosis and line of pull."""
    return math.asin(fibre_length * math.sin(pennation_angle) / muscle_length)


@equation("2.41", "fibre_angle")
def fibre_angle(pennation_angle: float, aponeurosis_angle: float) -> float:
    """Angle (rad) between fibres and line of pull (2.39, 2.41)."""
    return pennation_angle - aponeurosis_angle


@equation("2.35", "fibre_velocity")
def fibre_velocity(
    muscle_velocity: float,
    aponeurosis_velocity: float,
    pennation_angle: float,
    aponeurosis_angle: float,
    fibre_angle: float,
) -> float:
    """Shortening velocity (m/s) of the fibres, 2.35 with 2.29 put in."""
    return (aponeurosis_velocity * math.cos(fibre_angle) + muscle_velocity * math.cos(pennation_angle)) / math.cos(
        aponeurosis_angle
    )


@equation("2.38", "muscle_force")
def muscle_force(total_fibre_force: float, pennation_angle: float, aponeurosis_angle: float) -> float:
    """Force (N) along the line of pull; a muscle-tendon unit cannot push."""
    # In this order of arguments, what is not a number stays so.
    return max(total_fibre_force * math.cos(pennation_angle) / math.cos(aponeurosis_angle), 0.0)


@equation("2.55", "aponeurosis_force")
def aponeurosis_force(total_fibre_force: float, pennation_angle: float) -> float:
    """Force (N) that the fibres put on the aponeurosis."""
    return -total_fibre_force * math.cos(pennation_angle)


@equation("2.32", "aponeurosis_velocity")
def aponeurosis_velocity(
    aponeurosis_force: float,
    aponeurosis_length: float,
    stiffness: float,
    viscosity: float,
    slack_length: float,
) -> float:
    """Lengthening velocity (m/s) of a quadratic spring beside a damper."""
    stretch = max(0.0, aponeurosis_length - slack_length)
    return (-aponeurosis_force - stiffness * stretch * stretch) / viscosity


@equation("parallel fibre length", "fibre_length")
def parallel_fibre_length(muscle_length: float) -> float:
    """Fibre length (m) without pennation."""
    return muscle_length


@equation("parallel fibre velocity", "fibre_velocity")
def parallel_fibre_velocity(muscle_velocity: float) -> float:
    """Shortening velocity (m/s) of the fibres without pennation."""
    return muscle_velocity


@equation("parallel pennation", "pennation_angle")
def parallel_pennation_angle() -> float:
    """Pennation angle (rad) without pennation."""
    return 0.0


@equation("2.38 parallel", "muscle_force")
def parallel_muscle_force(total_fibre_force: float) -> float:
    """Force (N) along the line of pull without pennation; never below zero."""
    return max(total_fibre_force, 0.0)


none = register(
    Law(
        "aponeurosis",
        "none",
        (
            parallel_pennation_angle,
            parallel_fibre_length,
            parallel_fibre_velocity,
            parallel_muscle_force,
        ),
        source="fibres along the line of pull",
    )
)
constant_area = register(
    Law(
        "aponeurosis",
        "constant_area",
        (
            pennation_angle,
            fibre_length,
            aponeurosis_angle,
            fibre_angle,
            aponeurosis_force,
            aponeurosis_velocity,
            fibre_velocity,
            muscle_force,
        ),
        (
            Parameter(
                "area",
                "m^2",
                "area of the triangle, A",
                source="depends on the muscle",
                above=0.0,
                below=1.0,
            ),
            Parameter(
                "stiffness",
                "N/m^2",
                "force per squared stretch, C_A",
                source="report, 2.3.2 [40]: 1.6e5 to 3.8e5, rat gastrocnemius",
                above=0.0,
                maximum=1e12,
            ),
            Parameter(
                "viscosity",
                "N s/m",
                "force per lengthening velocity, V_A",
                1e4,
                "report, 2.3.2, estimate",
                above=0.0,
                maximum=1e9,
            ),
            Parameter(
                "slack_length",
                "m",
                "length above which the aponeurosis pulls, l_A^slack",
                source="report, 2.3.2 [40]: 0.0198, rat gastrocnemius",
                above=0.0,
                below=2.0,
            ),
            Parameter(
                "length",
                "m",
                "length at the start",
                "slack_length",
                "depends on the run",
                above=0.0,
                below=2.0,
            ),
        ),
        states=(State("aponeurosis_length", "aponeurosis_velocity", "2.33", "length", 1e-2, "m"),),
        source="report, 2.29-2.52 [40, 41]",
    )
)
