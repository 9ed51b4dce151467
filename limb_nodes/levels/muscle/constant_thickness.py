"""Pennation with a rigid aponeurosis: the muscle keeps its thickness, as in Hill-type models.

Symbols: alpha pennation_angle (between fibres and line of pull), l_F sin(alpha) thickness,
l_M muscle_length along the line of pull, l_F fibre_length, v_M, v_F the shortening velocities.
"""

import math

from limb_nodes.foundation.parameter import Parameter
from limb_nodes.levels.contracts import register
from limb_nodes.levels.equation import Law, equation


@equation("alpha", "pennation_angle")
def pennation_angle(muscle_length: float, thickness: float) -> float:
    """Angle (rad) between fibres and line of pull."""
    return math.atan2(thickness, muscle_length)


@equation("l_F", "fibre_length")
def fibre_length(muscle_length: float, thickness: float) -> float:
    """Fibre length (m), slanting across the thickness."""
    return math.hypot(muscle_length, thickness)


@equation("v_F", "fibre_velocity")
def fibre_velocity(muscle_velocity: float, pennation_angle: float) -> float:
    """Shortening velocity (m/s) of the fibres; less than the muscle's, for they also turn."""
    return muscle_velocity * math.cos(pennation_angle)


@equation("F_M", "muscle_force")
def muscle_force(total_fibre_force: float, pennation_angle: float) -> float:
    """Force (N) along the line of pull; a muscle-tendon unit cannot push."""
    return max(total_fibre_force * math.cos(pennation_angle), 0.0)


constant_thickness = register(
    Law(
        "aponeurosis",
        "constant_thickness",
        (pennation_angle, fibre_length, fibre_velocity, muscle_force),
        (
            Parameter(
                "thickness",
                "m",
                "distance of origin and insertion of the fibres across the line of pull",
                source="depends on the muscle: optimal fibre length times the sine of the angle there",
                minimum=0.0,
                below=1.0,
            ),
        ),
        source="Zajac, CRC Crit Rev Biomed Eng 17 (1989) 359",
    )
)
