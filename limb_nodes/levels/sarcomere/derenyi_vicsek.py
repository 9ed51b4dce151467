"""Cross-bridge force after Derenyi and Vicsek, the report's sarcomere (2.4-2.12).

Report symbols: k_P- phosphate_release_rate, k_P+ phosphate_binding_rate, k_ADP- adp_release_rate,
k_ADP+ adp_binding_rate, k_ATP+ atp_binding_rate, f attachment_force, f' detachment_force,
l power_stroke, d binding_site_spacing, delta debye_length, [P] phosphate, [ADP] adp, [ATP] atp,
F_S^max maximum_sarcomere_force, w bound_probability, V^max maximum_sarcomere_velocity,
V^max,inf saturated_velocity, K_m michaelis_constant, K_m^0 unhindered_michaelis_constant,
K_i adp_inhibition_constant, v_S sarcomere_velocity, v_S^norm sarcomere_velocity_norm,
F_S sarcomere_force.
"""

import math

from limb_nodes.foundation.parameter import Parameter
from limb_nodes.levels.contracts import register
from limb_nodes.levels.equation import Law, equation


@equation("2.5", "bound_probability")
def bound_probability(phosphate_release_rate: float, phosphate_binding_rate: float, phosphate: float) -> float:
    """Steady-state probability (1) of the strongly bound state."""
    return phosphate_release_rate / (phosphate_release_rate + phosphate_binding_rate * phosphate)


@equation("2.4", "maximum_sarcomere_force")
def maximum_sarcomere_force(
    power_stroke: float,
    binding_site_spacing: float,
    attachment_force: float,
    bound_probability: float,
) -> float:
    """Isometric force (N)."""
    return power_stroke / binding_site_spacing * attachment_force * bound_probability


@equation("2.8", "saturated_velocity")
def saturated_velocity(
    attachment_force: float, detachment_force: float, power_stroke: float, adp_release_rate: float
) -> float:
    """Greatest shortening velocity (m/s) at unlimited ATP."""
    return attachment_force / detachment_force * power_stroke * adp_release_rate


@equation("2.9", "unhindered_michaelis_constant")
def unhindered_michaelis_constant(adp_release_rate: float, atp_binding_rate: float) -> float:
    """Michaelis constant (M) without ADP."""
    return adp_release_rate / atp_binding_rate


@equation("2.10", "adp_inhibition_constant")
def adp_inhibition_constant(adp_release_rate: float, adp_binding_rate: float) -> float:
    """ADP concentration (M) that doubles the Michaelis constant; infinite if ADP never binds."""
    return adp_release_rate / adp_binding_rate if adp_binding_rate > 0.0 else math.inf


@equation("2.7", "michaelis_constant")
def michaelis_constant(unhindered_michaelis_constant: float, adp: float, adp_inhibition_constant: float) -> float:
    """Michaelis constant (M) of the shortening velocity."""
    return unhindered_michaelis_constant * (1.0 + adp / adp_inhibition_constant)


@equation("2.6", "maximum_sarcomere_velocity")
def maximum_sarcomere_velocity(saturated_velocity: float, atp: float, michaelis_constant: float) -> float:
    """Greatest shortening velocity (m/s)."""
    return saturated_velocity * atp / (michaelis_constant + atp)


@equation("2.11", "sarcomere_velocity_norm")
def sarcomere_velocity_norm(sarcomere_velocity: float, maximum_sarcomere_velocity: float) -> float:
    """Shortening velocity in units of 1.15 V_max (1)."""
    return sarcomere_velocity / (1.15 * maximum_sarcomere_velocity)


@equation("2.12", "sarcomere_force")
def sarcomere_force(
    sarcomere_velocity_norm: float,
    maximum_sarcomere_force: float,
    debye_length: float,
    power_stroke: float,
    eccentric_plateau: float,
) -> float:
    """Force (N) at a normalised shortening velocity.

    Shortening follows 2.12. That formula diverges for lengthening; there a hyperbola continues it
    with equal value and slope at zero velocity and levels off at the eccentric plateau.
    """
    elasticity = debye_length / power_stroke
    if sarcomere_velocity_norm > 0.0:
        detached = math.exp(-0.15 / sarcomere_velocity_norm)
        strain = sarcomere_velocity_norm / 0.15 - detached / (1.0 - detached)
        return maximum_sarcomere_force * (1.0 - detached) * (1.0 - elasticity * strain - sarcomere_velocity_norm)
    lengthening = -sarcomere_velocity_norm
    half_velocity = (eccentric_plateau - 1.0) / (1.0 + elasticity / 0.15)
    return maximum_sarcomere_force * (1.0 + (eccentric_plateau - 1.0) * lengthening / (lengthening + half_velocity))


derenyi_vicsek = register(
    Law(
        "sarcomere",
        "derenyi_vicsek",
        (
            bound_probability,
            maximum_sarcomere_force,
            saturated_velocity,
            unhindered_michaelis_constant,
            adp_inhibition_constant,
            michaelis_constant,
            maximum_sarcomere_velocity,
            sarcomere_velocity_norm,
            sarcomere_force,
        ),
        (
            Parameter(
                "phosphate_release_rate",
                "1/s",
                "release of phosphate that forms the strong bond",
                76.0,
                "report, 2.1.2 [5], rabbit psoas",
                above=0.0,
            ),
            Parameter(
                "phosphate_binding_rate",
                "1/(M s)",
                "rebinding of phosphate",
                0.0,
                "report, 2.1.2 [5]",
                minimum=0.0,
            ),
            Parameter(
                "adp_release_rate",
                "1/s",
                "release of ADP that frees the head for ATP",
                230.0,
                "report, 2.1.2 [5], rabbit psoas",
                above=0.0,
            ),
            Parameter(
                "adp_binding_rate",
                "1/(M s)",
                "rebinding of ADP",
                0.0,
                "report, 2.1.2 [5]",
                minimum=0.0,
            ),
            Parameter(
                "atp_binding_rate",
                "1/(M s)",
                "binding of ATP that detaches the head",
                0.76e6,
                "report, 2.1.2 [5], rabbit psoas",
                above=0.0,
            ),
            Parameter(
                "attachment_force",
                "N",
                "force of a head in the power stroke",
                4e-12,
                "report, 2.1.2 [5]",
                above=0.0,
            ),
            Parameter(
                "detachment_force",
                "N",
                "force of a head in the drag stroke",
                4e-12,
                "report, 2.1.2 [5]",
                above=0.0,
            ),
            Parameter(
                "power_stroke",
                "m",
                "working distance of the power stroke",
                11e-9,
                "report, 2.1.2 [5]",
                above=0.0,
                below=1e-6,
            ),
            Parameter(
                "binding_site_spacing",
                "m",
                "distance of neighbouring binding sites",
                45e-9,
                "report, 2.1.2 [8]",
                above=0.0,
                below=1e-6,
            ),
            Parameter(
                "debye_length",
                "m",
                "Debye length of the cross-bridge",
                3e-9,
                "report, 2.1.2 [5]",
                above=0.0,
                below=1e-6,
            ),
            Parameter(
                "phosphate",
                "M",
                "concentration of phosphate",
                0.0,
                "report, 2.1.2 [5]",
                minimum=0.0,
                maximum=1.0,
            ),
            Parameter(
                "adp",
                "M",
                "concentration of ADP",
                0.0,
                "report, 2.1.2 [5]",
                minimum=0.0,
                maximum=1.0,
            ),
            Parameter(
                "atp",
                "M",
                "concentration of ATP",
                3e-3,
                "report, 2.1.2 [5]",
                above=0.0,
                maximum=1.0,
            ),
            Parameter(
                "eccentric_plateau",
                "1",
                "greatest force while lengthening over the isometric force",
                1.4,
                "extension of 2.12 to lengthening",
                above=1.0,
                maximum=3.0,
            ),
        ),
        source="Derenyi and Vicsek, PNAS 93 (1996) 6775",
    )
)
