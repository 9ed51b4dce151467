"""The equations of a limb's muscles and motor units, as their laws choose them.

They are bound as `model.system` binds them for the program that runs, but without its checks, so that a system that
cannot run can still be examined.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

from limb_nodes.analysis.structure.relations import Assembly, Relation, Term, Variable
from limb_nodes.foundation.parameter import Parameter
from limb_nodes.levels import CONTRACTS, Equation, Law, motor_unit, muscle, sarcomere
from limb_nodes.model import ChosenLaw, Limb, MotorUnit, Muscle
from limb_nodes.model.kinds import MUSCLE_PROCESSES, UNIT_PROCESSES
from limb_nodes.model.system import UNIT_INPUTS, UNIT_PARAMETERS

SARCOMERE, UNIT, MUSCLE, TENDON, APONEUROSIS = "sarcomere", "motor_unit", "muscle", "tendon", "aponeurosis"
# The report puts recruitment into the level of the muscle, and force and torque of the tendon into its sub-level.
PROCESS_LEVELS = {
    "sarcomere": SARCOMERE,
    "tendon": TENDON,
    "path": MUSCLE,
    "aponeurosis": MUSCLE,
    "activation_dynamics": MUSCLE,
    "recruitment": MUSCLE,
}
TENDON_VARIABLES = ("tendon_force", "muscle_torque")
COMPUTED_PARAMETER = "unit_threshold"
JOINT_INPUTS = ("joint_angle", "joint_velocity")

Resolver = Callable[[str], Term]


def muscle_assembly(limb: Limb) -> Assembly:
    """The equations of all muscles with their motor units; joint angles and excitations are given."""
    assembly = Assembly()
    for one in limb.muscles:
        add_muscle(assembly, one, limb.segments[one.joint].name)
    return assembly


def unit_owner(one: Muscle, unit: MotorUnit) -> str:
    """The owner of a motor unit's variables."""
    return f"{one.name}.{unit.name}"


def own_parameters(process: str, law: Law) -> tuple[Parameter, ...]:
    """The parameters that are known inside a law only."""
    return (*(sarcomere.PARAMETERS if process == "sarcomere" else ()), *law.parameters)


def rate_equations(law: Law) -> set[str]:
    """What a law defines on the way to the rates of its states, apart from what it owes to its level."""
    definitions = {item.defines: item for item in law.equations}
    owed = CONTRACTS[law.process].defines
    found: set[str] = set()
    waiting = [state.rate for state in law.states]
    while waiting:
        name = waiting.pop()
        if name in definitions and name not in found and name not in owed:
            found.add(name)
            waiting += definitions[name].uses
    return found


def level_of(process: str, law: Law, defines: str) -> str:
    """The level of one of a law's equations; a state and its rate make the sub-level of the aponeurosis."""
    if process == "aponeurosis" and defines in {*rate_equations(law), *(state.name for state in law.states)}:
        return APONEUROSIS
    return PROCESS_LEVELS.get(process, UNIT)


def add_muscle(assembly: Assembly, one: Muscle, segment: str) -> None:
    """Append a muscle, its motor units and the sums over them."""
    laws = {process: one.laws[process] for process in MUSCLE_PROCESSES}
    names = {name: Variable(segment, name) for name in JOINT_INPUTS}
    units = [unit_owner(one, unit) for unit in one.units]
    assembly.parameters[Variable(one.name, "role")] = MUSCLE
    add_level(
        assembly, one.name, muscle.EQUATIONS, lambda name: TENDON if name in TENDON_VARIABLES else MUSCLE, laws, names
    )
    for unit, owner in zip(one.units, units, strict=True):
        for name in UNIT_PARAMETERS:
            if name != COMPUTED_PARAMETER:
                assembly.parameters[Variable(owner, name)] = UNIT
        chosen = {process: unit.laws[process] for process in UNIT_PROCESSES}
        shared = {name: Variable(one.name, name) for name in UNIT_INPUTS}
        add_level(assembly, owner, motor_unit.EQUATIONS, lambda name: UNIT, chosen, shared)
    pcsa = [Term(Variable(owner, "pcsa")) for owner in units]
    total = Variable(one.name, "muscle_pcsa")
    assembly.add(Relation("2.42", one.name, MUSCLE, Term(total), tuple(pcsa)))
    for rank, owner in enumerate(units):
        threshold = Term(Variable(owner, COMPUTED_PARAMETER))
        uses = (Term(total), *pcsa[: rank + 1])
        assembly.add(Relation("2.36 threshold", owner, MUSCLE, threshold, uses))
    forces = tuple(Term(Variable(owner, "fibre_force")) for owner in units)
    assembly.add(Relation("2.37", one.name, MUSCLE, Term(Variable(one.name, "total_fibre_force")), forces))


def add_level(
    assembly: Assembly,
    owner: str,
    equations: Iterable[Equation],
    level: Callable[[str], str],
    laws: Mapping[str, ChosenLaw],
    elsewhere: Mapping[str, Variable],
) -> None:
    """Append the equations of a muscle or motor unit and those of its laws.

    elsewhere: variables that belong to another owner, by name.
    """

    def resolver(own: Mapping[str, Variable]) -> Resolver:
        return lambda name: Term(own.get(name) or elsewhere.get(name) or Variable(owner, name))

    plain = resolver({})
    for item in equations:
        assembly.add(bind(item, owner, level(item.defines), "", plain))
    for process, chosen in laws.items():
        law = chosen.law
        own = {p.name: Variable(owner, f"{process}__{p.name}") for p in own_parameters(process, law)}
        home = APONEUROSIS if process == "aponeurosis" else PROCESS_LEVELS.get(process, UNIT)
        assembly.parameters.update(dict.fromkeys(own.values(), home))
        # The lengths of the sarcomere belong to its level, whatever its law.
        if process == "sarcomere":
            for item in sarcomere.EQUATIONS:
                assembly.add(bind(item, owner, SARCOMERE, "", resolver(own)))
        last = len(law.equations) - 1
        for place, item in enumerate(law.equations):
            relation = bind(item, owner, level_of(process, law, item.defines), process, resolver(own))
            if place == last and process == "sarcomere":
                relation = with_offers(relation, law, resolver({}))
            assembly.add(relation)
        for state in law.states:
            home = level_of(process, law, state.name)
            variable, rate = plain(state.name).variable, plain(state.rate)
            assembly.add(Relation(state.number, owner, home, Term(variable, 1), (rate,), process))
        for name in CONTRACTS[process].defines:
            assembly.variables.setdefault(plain(name).variable, level_of(process, law, name))


def bind(item: Equation, owner: str, level: str, process: str, resolve: Resolver) -> Relation:
    """One equation with its arguments resolved; what it defines is never a parameter."""
    uses = dict.fromkeys(resolve(name) for name in item.uses)
    return Relation(item.number, owner, level, Term(Variable(owner, item.defines)), tuple(uses), process)


def with_offers(relation: Relation, law: Law, resolve: Resolver) -> Relation:
    """The last equation of a law with the variables that its contract gives and the law does not use."""
    used = {name for item in law.equations for name in item.uses}
    offered = tuple(resolve(name).variable for name in CONTRACTS[law.process].given if name not in used)
    return Relation(
        relation.number, relation.owner, relation.level, relation.defines, relation.uses, relation.process, offered
    )
