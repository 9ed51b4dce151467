"""What a law of each process is given and what it owes in return.

A law of a process

1. defines every variable under `defines`, each by one equation, plus any intermediate variables
   of its own;
2. uses only the variables under `given`, the variables that it defines and its own parameters,
   all of them as argument names of its equations;
3. declares each of its parameters with unit, allowed range and source;
4. is written in plain scalar Python: arithmetic, comparisons, `if`, `abs`, `min`, `max`, the
   functions of `math`, and other functions of the same kind; no loops, containers or side
   effects. Such code runs interpreted, compiled and differentiated alike. An equation of parameters
   alone may be any Python that returns a number: it runs once, interpreted, when a limb is loaded;
5. may bring states; it then defines the rate of each;
6. keeps the properties under `properties`, which are checked when a limb is loaded, over the law's
   `ranges` if it declares them; a law with states has finite rates there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from limb_nodes.foundation.parameter import Parameter
from limb_nodes.levels.equation import Equation, Law, ScalarFunction, State


@dataclass(frozen=True)
class Contract:
    """The interface of one process.

    owner: "motor_unit" or "muscle", of which each has a law of this process, or "joint", which has any number.
    level: the level of the report that holds the equations: "sarcomere", "motor_unit", "muscle", or its sub-level
        "tendon". A law of the last two is chosen in a muscle's section of a limb's file.
    default: the law of a section that names none. absent: the law if there is no section.
    follows: what need not be defined, for it follows from the rest (`levels.muscle.spanning_path`).
    """

    process: str
    owner: str
    level: str
    meaning: str
    given: tuple[str, ...]
    defines: tuple[str, ...]
    default: str
    properties: tuple[str, ...] = ()
    absent: str = ""
    follows: tuple[str, ...] = ()

    @property
    def section(self) -> str:
        """The section of a limb's file that chooses the law: "motor_unit", "muscle" or "segment"."""
        if self.owner == "joint":
            return "segment"
        return "muscle" if self.level in ("muscle", "tendon") else "motor_unit"


CONTRACTS: dict[str, Contract] = {
    contract.process: contract
    for contract in (
        Contract(
            "sarcomere",
            "motor_unit",
            "sarcomere",
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
            "motor_unit",
            "motor_unit",
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
            "motor_unit",
            "motor_unit",
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
            "motor_unit",
            "motor_unit",
            "factor of passive force by fibre length",
            ("fibre_length_norm",),
            ("passive_force_factor",),
            "quadratic",
            ("rises with the fibre length", "not negative"),
        ),
        Contract(
            "recruitment",
            "motor_unit",
            "muscle",
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
            "path",
            "muscle",
            "muscle",
            "muscle-tendon length, velocity and moment arm by joint angle",
            ("joint_angle", "joint_velocity", "role"),
            ("muscle_tendon_length", "muscle_tendon_velocity", "moment_arm"),
            "constant_moment_arm",
            ("the velocity is the rate at which the length shortens", "the length is positive"),
            follows=("muscle_tendon_velocity", "moment_arm"),
        ),
        Contract(
            "tendon",
            "muscle",
            "tendon",
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
        Contract(
            "activation_dynamics",
            "muscle",
            "muscle",
            "activation of the muscle by excitation",
            ("excitation",),
            ("activation",),
            "none",
            ("rises with the excitation and is not negative, if the law has no states",),
        ),
        Contract(
            "tissue",
            "joint",
            "limb",
            "moment of what is around a joint beside muscles, a list of laws whose moments add up",
            ("joint_angle", "joint_velocity"),
            ("passive_moment",),
            "linear",
            ("what the velocity adds acts against it", "acts somewhere in the joint's range", "no states"),
        ),
    )
}

UNIT_PROCESSES = tuple(name for name, contract in CONTRACTS.items() if contract.owner == "motor_unit")
MUSCLE_PROCESSES = tuple(name for name, contract in CONTRACTS.items() if contract.owner == "muscle")

REGISTRY: dict[str, dict[str, Law]] = {process: {} for process in CONTRACTS}


def register(new: Law) -> Law:
    """Let limbs choose a law by its name; returns the law."""
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
    its value is the variable that the contract asks for. Of a path that is the length; its arguments may be the angles
    of several joints, such as knee_angle. Raises TypeError if the contract asks for more than one variable: such a law
    is built with `Law`.
    """
    contract = CONTRACTS[process]
    owed = [name for name in contract.defines if name not in contract.follows]
    if len(owed) != 1:
        raise TypeError(f"a law of {process} defines {', '.join(contract.defines)}: build it with Law(...)")

    def build(function: ScalarFunction) -> Law:
        marked = function.__dict__.get("equation")
        number = marked.number if isinstance(marked, Equation) else function.__name__
        item = Equation(number, owed[0], function)
        return Law(process, function.__name__, (item,), parameters, states, source)

    return build
