"""Activation that follows the excitation through a critically damped filter of second order, then a curve.

The filter is the twitch of a muscle: tau^2 d2u/dt2 + 2 tau du/dt + u = e. The curve makes of the neural activation u
the activation a, for force is no straight line over EMG. Symbols: e excitation, u neural_activation, a activation,
tau time_constant, A shape, (u_0, a_0) node, d curve_height, c curve_rate.
"""

import math

from limb_nodes.foundation.parameter import Parameter
from limb_nodes.levels.bent_rise import STRAIGHT, bent_rise
from limb_nodes.levels.contracts import register
from limb_nodes.levels.equation import Law, State, equation


@equation("du/dt", "neural_activation_rate")
def neural_activation_rate(neural_velocity: float) -> float:
    """Rate (1/s) of the neural activation."""
    return neural_velocity


@equation("d2u/dt2", "neural_velocity_rate")
def neural_velocity_rate(
    excitation: float, neural_activation: float, neural_velocity: float, time_constant: float
) -> float:
    """Rate (1/s^2) of the velocity of the neural activation, (e - u)/tau^2 - 2/tau du/dt."""
    return (excitation - neural_activation) / (time_constant * time_constant) - 2.0 * neural_velocity / time_constant


@equation("at rest", "initial_neural_velocity")
def initial_neural_velocity() -> float:
    """Rate (1/s) of the neural activation at the start."""
    return 0.0


@equation("Lloyd-Besier", "activation")
def exponential_curve(neural_activation: float, shape: float) -> float:
    """Activation (1), (exp(A u) - 1)/(exp(A) - 1): from 0 to 1, straight if A is 0."""
    return bent_rise(max(0.0, neural_activation), shape)


@equation("u_0", "node_excitation")
def node_excitation(node: float, shape: float) -> float:
    """Neural activation (1) of the node: it leaves the straight line a = u at a right angle, as far as A."""
    return node - shape / math.sqrt(2.0)


@equation("a_0", "node_activation")
def node_activation(node: float, shape: float) -> float:
    """Activation (1) of the node."""
    return node + shape / math.sqrt(2.0)


@equation("slope above the node", "node_slope")
def node_slope(node_excitation: float, node_activation: float) -> float:
    """Slope (1) of the line from the node to (1, 1), and of the curve at the node."""
    return (1.0 - node_activation) / (1.0 - node_excitation)


@equation("c", "curve_rate")
def curve_rate(node_excitation: float, node_activation: float, node_slope: float) -> float:
    """The c (1) of d ln(c u + 1) with which the curve meets the node with its slope; 0 if all is a straight line."""
    wanted = node_slope * node_excitation / node_activation
    if wanted > 1.0 - STRAIGHT:
        return 0.0
    # z/((1 + z) ln(1 + z)) falls from 1 to 0.
    low, high = 0.0, 1e9
    for _ in range(200):
        middle = math.sqrt((low + 1.0) * (high + 1.0)) - 1.0
        if middle / ((1.0 + middle) * math.log1p(middle)) > wanted:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high) / node_excitation


@equation("d", "curve_height")
def curve_height(node_excitation: float, node_activation: float, curve_rate: float) -> float:
    """The d (1) of d ln(c u + 1)."""
    return node_activation / math.log1p(curve_rate * node_excitation) if curve_rate > 0.0 else 0.0


@equation("Manal-Buchanan", "activation")
def logarithmic_curve(
    neural_activation: float,
    node_excitation: float,
    node_activation: float,
    node_slope: float,
    curve_rate: float,
    curve_height: float,
) -> float:
    """Activation (1): d ln(c u + 1) up to the node, from there a straight line to 1."""
    rising = max(0.0, neural_activation)
    if curve_rate > 0.0 and rising < node_excitation:
        return curve_height * math.log1p(curve_rate * rising)
    return node_activation + node_slope * (rising - node_excitation)


FILTER = (neural_activation_rate, neural_velocity_rate, initial_neural_velocity)
STATES = (
    State("neural_activation", "neural_activation_rate", "du/dt", "initial_activation", 1.0),
    State("neural_velocity", "neural_velocity_rate", "d2u/dt2", "initial_neural_velocity", 50.0, "1/s"),
)
PARAMETERS = (
    Parameter(
        "time_constant",
        "s",
        "time constant of the filter, tau; a twitch is at its height after it",
        0.03,
        "Milner-Brown, Stein and Yemm, J Physiol 228 (1973) 285: contraction times of 0.03 to 0.1 s",
        minimum=1e-4,
        maximum=10.0,
    ),
    Parameter(
        "initial_activation", "1", "neural activation at the start", 0.0, "depends on the run", minimum=0.0, maximum=1.0
    ),
)
RANGES = {"neural_activation": (0.0, 1.0), "neural_velocity": (-50.0, 50.0)}

second_order = register(
    Law(
        "activation_dynamics",
        "second_order",
        (*FILTER, exponential_curve),
        (
            *PARAMETERS,
            Parameter(
                "shape",
                "1",
                "bend of the curve, A: 0 is straight, -3 the most",
                0.0,
                "Lloyd and Besier 2003: -3 to 0, by subject and muscle",
                minimum=-3.0,
                maximum=0.0,
            ),
        ),
        states=STATES,
        ranges=RANGES,
        source="Lloyd and Besier, J Biomech 36 (2003) 765",
    )
)
second_order_logarithmic = register(
    Law(
        "activation_dynamics",
        "second_order_logarithmic",
        (
            *FILTER,
            node_excitation,
            node_activation,
            node_slope,
            curve_rate,
            curve_height,
            logarithmic_curve,
        ),
        (
            *PARAMETERS,
            Parameter(
                "shape",
                "1",
                "how far the node is from the straight line, A: 0 is straight, 0.12 the most",
                0.0,
                "Manal and Buchanan 2003: 0 to 0.12",
                minimum=0.0,
                maximum=0.12,
            ),
            Parameter(
                "node",
                "1",
                "where the curve turns into a line, along the straight line a = u",
                0.3,
                "Buchanan et al., J Appl Biomech 20 (2004) 367: the first 30 % are curved",
                minimum=0.2,
                maximum=0.6,
            ),
        ),
        states=STATES,
        ranges=RANGES,
        source="Manal and Buchanan, J Biomech 36 (2003) 1197",
    )
)
