"""Hill's hyperbola, the force-velocity law of the Hill-type models.

Symbols of the paper: P sarcomere_force, P_0 maximum_force, a/P_0 curvature, v sarcomere_velocity,
v_max maximum_velocity.
"""

from limb_nodes.foundation.parameter import Parameter
from limb_nodes.levels.contracts import register
from limb_nodes.levels.equation import Law, equation


@equation("P_0", "maximum_sarcomere_force")
def maximum_sarcomere_force(maximum_force: float) -> float:
    """Isometric force (N)."""
    return maximum_force


@equation("Hill", "sarcomere_force")
def sarcomere_force(
    sarcomere_velocity: float,
    maximum_force: float,
    maximum_velocity: float,
    curvature: float,
    eccentric_plateau: float,
) -> float:
    """Force (N) at a shortening velocity: (P + a) (v + b) = (P_0 + a) b, with b = v_max a/P_0.

    Lengthening follows a hyperbola that meets Hill's with equal value and slope at zero velocity
    and levels off at the eccentric plateau.
    """
    velocity = sarcomere_velocity / maximum_velocity
    if velocity > 0.0:
        return maximum_force * (1.0 - velocity) / (1.0 + velocity / curvature)
    half_velocity = (eccentric_plateau - 1.0) * curvature / (1.0 + curvature)
    return maximum_force * (1.0 - (eccentric_plateau - 1.0) * velocity / (half_velocity - velocity))


hill = register(
    Law(
        "sarcomere",
        "hill",
        (maximum_sarcomere_force, sarcomere_force),
        (
            Parameter(
                "maximum_force",
                "N",
                "isometric force, P_0",
                9.7778e-13,
                "report, 2.4 with the values of rabbit psoas",
                above=0.0,
            ),
            Parameter(
                "maximum_velocity",
                "m/s",
                "shortening velocity without load, v_max",
                2.29817e-6,
                "report, 2.6 with the values of rabbit psoas",
                above=0.0,
                below=1.0,
            ),
            Parameter(
                "curvature",
                "1",
                "constant of the hyperbola, a/P_0",
                0.25,
                "Hill, Proc R Soc B 126 (1938) 136, frog",
                minimum=0.01,
                maximum=100.0,
            ),
            Parameter(
                "eccentric_plateau",
                "1",
                "greatest force while lengthening over the isometric force",
                1.5,
                "van Soest and Bobbert, Biol Cybern 69 (1993) 195",
                above=1.0,
                maximum=3.0,
            ),
        ),
        source="Hill, Proc R Soc B 126 (1938) 136",
    )
)
