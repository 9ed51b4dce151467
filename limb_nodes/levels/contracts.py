"""What a law of each process is given and what it owes in return.

A law of a process

1. defines every variable under `defines`, each by one equation, plus any intermediate variables
   of its own;
2. uses only the variables under `given`, the variables that it defines and its own parameters,
   all of them as argument names of its equations;
3. declares each of its parameters with unit, allowed range and source;
4. is written in plain scalar Python: arithmetic, comparisons, `if`, `abs`, `min`, `max`, the
   functions of `math`, and other functions of the same kind; no loops, containers or side
   effects. Such code runs interpreted, compiled and differentiated alike;
5. may bring states; it then defines the rate of each;
6. keeps the properties under `properties`, which are checked when a limb is loaded, over the law's
   `ranges` where it declares them; a law with states has finite rates there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from limb_nodes.foundation.parameter import Parameter
from limb_nodes.levels.equation import Equation, Law, ScalarFunction, State


@dataclass(frozen=True)
class Contract:
    """The interface of one process.

    level: "unit" or "muscle", where the process belongs.
    default: the law of a section that names none; absent: the law where the section is missing.
    """

    process: str
    level: str
    meaning: str
    given: tuple[str, ...]
    defines: tuple[str, ...]
    default: str
    properties: tuple[str, ...] = ()
    absent: str = ""


CONTRACTS: dict[str, Contract] = {
    contract.process: contract
    for contract in (
        Contract(
            "sarcomere",
            "unit",
            "force of one sarcomere",
            (
                "sarcomere_length",
                "sarcomere_velocity",
                "sarcomere_frequency",
                "optimal_sarcomere_length",
                "minimum_sarcomere_length",
                "maximum_sarcomere_length",
            ),
            ("maximum_sarcomere_force", "sarcomere_force"),
            "derenyi_vicsek",
            ("falls with the shortening velocity", "value and slope continuous at zero velocity"),
        ),
        Contract(
            "force_length",
            "unit",
            "factor of active force by fibre length",
            (
                "fibre_length_norm",
                "sarcomere_length",
                "optimal_sarcomere_length",
                "minimum_sarcomere_length",
                "maximum_sarcomere_length",
            ),
            ("force_length_factor",),
            "cheng",
            ("finite and not negative for normalised lengths from 0 to 2",),
        ),
        Contract(
            "force_frequency",
            "unit",
            "factor of active force by stimulation frequency",
            (
                "frequency_norm",
                "stimulation_frequency",
                "minimum_frequency",
                "maximum_frequency",
                "fibre_length_norm",
                "sarcomere_length",
                "optimal_sarcomere_length",
            ),
            ("force_frequency_factor",),
            "sigmoid",
            ("rises with the frequency", "zero at zero frequency"),
        ),
        Contract(
            "passive_force",
            "unit",
            "factor of passive force by fibre length",
            ("fibre_length_norm",),
            ("passive_force_factor",),
            "quadratic",
            ("rises with the fibre length", "not negative"),
        ),
        Contract(
            "recruitment",
            "unit",
            "stimulation frequency of a unit by activation",
            (
                "activation",
                "unit_threshold",
                "unit_rank",
                "minimum_frequency",
                "maximum_frequency",
            ),
            ("stimulation_frequency",),
            "linear",
            ("zero at zero activation", "rises with the activation"),
        ),
        Contract(
            "activation_dynamics",
            "muscle",
            "activation of the muscle by excitation",
            ("excitation",),
            ("activation",),
            "none",
            ("rises with the excitation and is not negative, where the law has no states",),
        ),
        Contract(
            "path",
            "muscle",
            "muscle-tendon length, velocity and moment arm by joint angle",
            ("joint_angle", "joint_velocity", "role"),
            ("muscle_tendon_length", "muscle_tendon_velocity", "moment_arm"),
            "constant_moment_arm",
            ("the velocity is the rate at which the length shortens", "the length is positive"),
        ),
        Contract(
            "tendon",
            "muscle",
            "length and lengthening velocity of the tendon by its force",
            ("tendon_force", "tendon_length"),
            ("tendon_velocity",),
            "voigt",
            ("with a state: falls with the length, rises with the pull",),
            absent="rigid",
        ),
        Contract(
            "aponeurosis",
            "muscle",
            "fibre geometry between muscle line and aponeurosis",
            ("muscle_length", "muscle_velocity", "total_fibre_force"),
            (
                "fibre_length",
                "fibre_velocity",
                "pennation_angle",
                "muscle_force",
            ),
            "constant_area",
            ("muscle force and fibre velocity rise with the force of the fibres", "the muscle force is not negative"),
            absent="none",
        ),
    )
}

REGISTRY: dict[str, dict[str, Law]] = {process: {} for process in CONTRACTS}


def register(new: Law) -> Law:
    """Make a law selectable by its name; returns the law."""
    REGISTRY[new.process][new.name] = new
    return new


def law(
    process: str,
    *parameters: Parameter,
    states: tuple[State, ...] = (),
    source: str = "",
) -> Callable[[ScalarFunction], Law]:
    """Make a law of one equation from a function.

    The function's arguments are variables that the contract of `process` gives, or `parameters`;
    its value is the variable that the contract asks for. Raises TypeError where the contract asks
    for more than one variable: such a law is built with `Law`.
    """
    contract = CONTRACTS[process]
    if len(contract.defines) != 1:
        wanted = ", ".join(contract.defines)
        raise TypeError(f"a law of {process} defines {wanted}: build it with Law(...)")

    def make(function: ScalarFunction) -> Law:
        number = function.__name__
        marked = function.__dict__.get("equation")
        if isinstance(marked, Equation):
            number = marked.number
        made = Equation(number, contract.defines[0], function)
        return Law(process, function.__name__, (made,), parameters, states, source)

    return make
