"""Tendon with a toe region: exponential at small strain, then linear, beside a damper.

Symbols of the paper: F_T tendon_force, epsilon the strain, epsilon_0 strain_at_maximum,
F_M^0 maximum_force, F_toe toe_force, k_toe toe_shape, epsilon_toe the strain where the toe ends.
The damper is the report's (2.30); without it the tendon's velocity would not follow from its force.
"""

import math

from limb_nodes.foundation.parameter import Parameter
from limb_nodes.levels.contracts import register
from limb_nodes.levels.equation import Law, equation
from limb_nodes.levels.muscle.tendon import DAMPING, INITIAL_LENGTH, LENGTH_STATE


@equation("epsilon_toe", "toe_strain")
def toe_strain(strain_at_maximum: float, toe_force: float, toe_shape: float) -> float:
    """Strain (1) at which exponential and line meet with equal slope, 0.609 epsilon_0 at the defaults."""
    toe = toe_force * toe_shape / -math.expm1(-toe_shape)
    return strain_at_maximum * toe / (toe + 1.0 - toe_force)


@equation("Thelen 4", "elastic_tendon_force")
def elastic_tendon_force(
    tendon_length: float,
    slack_length: float,
    toe_strain: float,
    maximum_force: float,
    strain_at_maximum: float,
    toe_force: float,
    toe_shape: float,
) -> float:
    """Force (N) of the stretched tendon at rest."""
    strain = max(0.0, tendon_length / slack_length - 1.0)
    if strain <= toe_strain:
        return maximum_force * toe_force * math.expm1(toe_shape * strain / toe_strain) / math.expm1(toe_shape)
    stiffness = (1.0 - toe_force) / (strain_at_maximum - toe_strain)
    return maximum_force * (toe_force + stiffness * (strain - toe_strain))


@equation("2.30 with a toe", "tendon_velocity")
def toe_velocity(tendon_force: float, elastic_tendon_force: float, damping: float) -> float:
    """Lengthening velocity (m/s) of the tendon and a damper side by side."""
    return (-tendon_force - elastic_tendon_force) / damping


toe_region = register(
    Law(
        "tendon",
        "toe_region",
        (toe_strain, elastic_tendon_force, toe_velocity),
        (
            Parameter(
                "slack_length",
                "m",
                "length above which the tendon pulls, l_T^slack",
                source="depends on the muscle",
                above=0.0,
                below=2.0,
            ),
            Parameter(
                "maximum_force",
                "N",
                "greatest isometric force of the muscle, F_M^0",
                source="depends on the muscle",
                above=0.0,
                maximum=1e6,
            ),
            Parameter(
                "strain_at_maximum",
                "1",
                "strain at the greatest force, epsilon_0",
                0.04,
                "Thelen 2003, young adults",
                minimum=1e-4,
                maximum=1.0,
            ),
            Parameter(
                "toe_force",
                "1",
                "force at the end of the toe over the greatest, F_toe",
                0.33,
                "Thelen 2003",
                above=0.0,
                below=1.0,
            ),
            Parameter("toe_shape", "1", "steepness of the toe, k_toe", 3.0, "Thelen 2003", minimum=0.01, maximum=50.0),
            DAMPING,
            INITIAL_LENGTH,
        ),
        states=(LENGTH_STATE,),
        source="Thelen, J Biomech Eng 125 (2003) 70",
    )
)
