"""The muscle around its laws: from joint and motor units to the torque (2.37-2.54).

Report symbols: F_F* total_fibre_force, F_F fibre_force, l_M muscle_length, v_M muscle_velocity,
l_M+T muscle_tendon_length, v_M+T muscle_tendon_velocity, l_T tendon_length, v_T tendon_velocity,
F_M muscle_force, F_T tendon_force, M_M muscle_torque, r_M moment_arm.
"""

from dataclasses import replace

from limb_nodes.levels.equation import Equation, equation, equation_of


@equation("2.49", "muscle_length")
def muscle_length(muscle_tendon_length: float, tendon_length: float) -> float:
    """Length (m) of the muscle without its tendon."""
    return muscle_tendon_length - tendon_length


@equation("2.50", "muscle_velocity")
def muscle_velocity(muscle_tendon_velocity: float, tendon_velocity: float) -> float:
    """Shortening velocity (m/s) of the muscle without its tendon."""
    return muscle_tendon_velocity + tendon_velocity


@equation("2.53", "tendon_force")
def tendon_force(muscle_force: float) -> float:
    """Force (N) of the tendon on the muscle."""
    return -muscle_force


@equation("2.54", "muscle_torque")
def muscle_torque(tendon_force: float, moment_arm: float, role: float) -> float:
    """Torque (N m) about the joint: positive for a flexor, negative for an extensor."""
    return -role * tendon_force * moment_arm


@equation("virtual work", "muscle_torque")
def torque_on_joint(tendon_force: float, moment_arm: float) -> float:
    """Torque (N m) about one of several joints; the moment arm has the sign of what the muscle does there."""
    return -tendon_force * moment_arm


EQUATIONS = tuple(equation_of(function) for function in (muscle_length, muscle_velocity, tendon_force, muscle_torque))


def muscle_equations(crossings: tuple[str, ...]) -> tuple[Equation, ...]:
    """The equations of a muscle over joints whose variables have these endings; ("",) for the report's one joint."""
    if crossings == ("",):
        return EQUATIONS
    on_joint = equation_of(torque_on_joint)
    torques = (
        replace(on_joint, defines=f"muscle_torque{one}", named=("tendon_force", f"moment_arm{one}"))
        for one in crossings
    )
    return *EQUATIONS[:-1], *torques
