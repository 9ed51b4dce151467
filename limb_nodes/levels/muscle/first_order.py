"""Activation that follows the excitation with separate times of rise and fall.

Symbols of the paper: u excitation, a activation, tau_act rise_time, tau_deact fall_time.
"""

from limb_nodes.foundation.parameter import Parameter
from limb_nodes.levels.contracts import register
from limb_nodes.levels.equation import Law, State, equation


@equation("Thelen 1-2", "activation_rate")
def activation_rate(excitation: float, activation: float, rise_time: float, fall_time: float) -> float:
    """Rate (1/s) of the activation, (u - a)/tau.

    tau is tau_act (0.5 + 1.5 a) while the activation rises and tau_deact/(0.5 + 1.5 a) while it falls: an
    active muscle takes up less of the calcium that it is given, and more slowly.
    """
    share = 0.5 + 1.5 * activation
    if excitation > activation:
        return (excitation - activation) / (rise_time * share)
    return (excitation - activation) * share / fall_time


first_order = register(
    Law(
        "activation_dynamics",
        "first_order",
        (activation_rate,),
        (
            Parameter(
                "rise_time",
                "s",
                "time constant of the rise, tau_act",
                0.015,
                "Thelen 2003, young adults",
                minimum=1e-4,
                maximum=10.0,
            ),
            Parameter(
                "fall_time",
                "s",
                "time constant of the fall, tau_deact",
                0.05,
                "Thelen 2003, young adults",
                minimum=1e-4,
                maximum=10.0,
            ),
            Parameter(
                "initial_activation",
                "1",
                "activation at the start",
                0.0,
                "depends on the run",
                minimum=0.0,
                maximum=1.0,
            ),
        ),
        states=(State("activation", "activation_rate", "Thelen 1", "initial_activation", 1.0),),
        ranges={"activation": (0.0, 1.0)},
        source="Thelen, J Biomech Eng 125 (2003) 70",
    )
)
