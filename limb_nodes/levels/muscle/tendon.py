"""Tendon in series with the muscle (2.30, 2.31).

Report symbols: l_T tendon_length, v_T tendon_velocity (positive when lengthening),
F_T tendon_force, D_T stiffness, C_T damping, l_T^slack slack_length.
"""

from limb_nodes.foundation.parameter import Parameter
from limb_nodes.levels.contracts import register
from limb_nodes.levels.equation import Law, State, equation


@equation("2.30", "tendon_velocity")
def voigt_velocity(
    tendon_force: float,
    tendon_length: float,
    stiffness: float,
    damping: float,
    slack_length: float,
) -> float:
    """Lengthening velocity (m/s) of a spring and a damper side by side."""
    return (-tendon_force - stiffness * max(0.0, tendon_length - slack_length)) / damping


@equation("rigid length", "tendon_length")
def rigid_length(slack_length: float) -> float:
    """Length (m) of a tendon that does not stretch."""
    return slack_length


@equation("rigid velocity", "tendon_velocity")
def rigid_velocity() -> float:
    """Lengthening velocity (m/s) of a tendon that does not stretch."""
    return 0.0


SLACK_LENGTH = Parameter(
    "slack_length",
    "m",
    "length above which the tendon pulls, l_T^slack",
    source="depends on the muscle",
    minimum=0.0,
    below=2.0,
)
LENGTH_STATE = State("tendon_length", "tendon_velocity", "2.31", "length", 1e-2, "m")
INITIAL_LENGTH = Parameter(
    "length",
    "m",
    "length at the start",
    "slack_length",
    "depends on the run",
    minimum=0.0,
    below=2.0,
)
DAMPING = Parameter(
    "damping",
    "N s/m",
    "force per lengthening velocity, C_T",
    1e4,
    "report, 2.3.2, estimate",
    above=0.0,
    maximum=1e9,
)

rigid = register(
    Law(
        "tendon",
        "rigid",
        (rigid_length, rigid_velocity),
        (
            Parameter(
                "slack_length",
                "m",
                "length of the tendon",
                0.0,
                "depends on the muscle",
                minimum=0.0,
                below=2.0,
            ),
        ),
        source="Zajac, CRC Crit Rev Biomed Eng 17 (1989) 359",
    )
)
voigt = register(
    Law(
        "tendon",
        "voigt",
        (voigt_velocity,),
        (
            Parameter(
                "stiffness",
                "N/m",
                "force per stretch, D_T",
                1e5,
                "report, 2.3.2, estimate",
                above=0.0,
                maximum=1e9,
            ),
            DAMPING,
            SLACK_LENGTH,
            INITIAL_LENGTH,
        ),
        states=(LENGTH_STATE,),
        source="report, 2.30 [9]",
    )
)
