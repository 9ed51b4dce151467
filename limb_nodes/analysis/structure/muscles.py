"""The equations of a limb's muscles and motor units, bound by `model.system` as for the program that runs.

Its checks are left out, so that a system that cannot run can still be examined.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence

from limb_nodes.analysis.structure.relations import Assembly, Relation, Term, Variable
from limb_nodes.levels import CONTRACTS, MUSCLE_PROCESSES, UNIT_PROCESSES, Equation, Law
from limb_nodes.model import Limb, MotorUnit, Muscle
from limb_nodes.model.system import (
    UNIT_INPUTS,
    BoundEquation,
    System,
    crossings_of,
    muscle_equations,
    owed_by,
    unit_equations,
)

SARCOMERE, UNIT, MUSCLE, TENDON, APONEUROSIS = "sarcomere", "motor_unit", "muscle", "tendon", "aponeurosis"
# Of what the level of the muscle defines, the report puts these into its sub-level.
TENDON_VARIABLES = re.compile(r"tendon_force|muscle_torque(_\d+)?")
COMPUTED_PARAMETER = "unit_threshold"


def muscle_assembly(limb: Limb) -> Assembly:
    """The equations of all muscles with their motor units; joint angles and excitations are given."""
    assembly = Assembly()
    for one in limb.muscles:
        add_muscle(assembly, one, [limb.segments[joint].name for joint in one.joints])
    return assembly


def unit_owner(one: Muscle, unit: MotorUnit) -> str:
    """The owner of a motor unit's variables."""
    return f"{one.name}.{unit.name}"


def rate_equations(law: Law) -> set[str]:
    """What a law defines on the way to the rates of its states, apart from what it owes to its level."""
    definitions = {item.defines: item for item in law.equations}
    owed = CONTRACTS[law.process].defines
    names: set[str] = set()
    waiting = [state.rate for state in law.states]
    while waiting:
        name = waiting.pop()
        if name in definitions and name not in names and name not in owed:
            names.add(name)
            waiting += definitions[name].uses
    return names


def level_of(law: Law, defines: str) -> str:
    """The level of one of a law's equations; a state and its rate make the sub-level of the aponeurosis."""
    if law.process == "aponeurosis" and defines in {*rate_equations(law), *(state.name for state in law.states)}:
        return APONEUROSIS
    return CONTRACTS[law.process].level


def add_muscle(assembly: Assembly, one: Muscle, segments: Sequence[str]) -> None:
    """Append a muscle, its motor units and the sums over them. segments: those behind the joints that it crosses."""
    units = [unit_owner(one, unit) for unit in one.units]
    laws = {process: one.laws[process].law for process in MUSCLE_PROCESSES}
    names = {
        f"{name}{ending}": Variable(segment, name)
        for ending, segment in zip(crossings_of(laws["path"]), segments, strict=True)
        for name in ("joint_angle", "joint_velocity")
    }
    add_system(assembly, one.name, muscle_equations(laws), laws, names)
    for unit, owner in zip(one.units, units, strict=True):
        laws = {process: unit.laws[process].law for process in UNIT_PROCESSES}
        names = {name: Variable(one.name, name) for name in UNIT_INPUTS}
        add_system(assembly, owner, unit_equations(laws), laws, names)
    pcsa = [Term(Variable(owner, "pcsa")) for owner in units]
    total = Variable(one.name, "muscle_pcsa")
    assembly.add(Relation("2.42", one.name, MUSCLE, Term(total), tuple(pcsa)))
    for rank, owner in enumerate(units):
        threshold = Term(Variable(owner, COMPUTED_PARAMETER))
        uses = (Term(total), *pcsa[: rank + 1])
        assembly.add(Relation("2.36 threshold", owner, MUSCLE, threshold, uses))
    forces = tuple(Term(Variable(owner, "fibre_force")) for owner in units)
    assembly.add(Relation("2.37", one.name, MUSCLE, Term(Variable(one.name, "total_fibre_force")), forces))


def add_system(
    assembly: Assembly, owner: str, system: System, laws: Mapping[str, Law], elsewhere: Mapping[str, Variable]
) -> None:
    """Append the equations of a muscle or motor unit and the states of its laws.

    elsewhere: variables that belong to another owner, by name.
    """

    def term(name: str, order: int = 0) -> Term:
        return Term(elsewhere.get(name) or Variable(owner, name), order)

    def add(bound: BoundEquation, level: str, process: str = "", offered: Iterable[str] = ()) -> None:
        uses = tuple(dict.fromkeys(map(term, bound.symbols)))
        defines = Term(Variable(owner, bound.defines))
        variables = tuple(term(name).variable for name in offered)
        assembly.add(Relation(bound.equation.number, owner, level, defines, uses, process, variables))

    home = UNIT if system.inputs == UNIT_INPUTS else MUSCLE
    for name in system.parameters:
        if name != COMPUTED_PARAMETER:
            assembly.parameters[Variable(owner, name)] = parameter_level(name, home)
    for bound in system.equations:
        if not bound.process:
            add(bound, TENDON if TENDON_VARIABLES.fullmatch(bound.defines) else home)
    for process, law in laws.items():
        for bound in system.equations:
            if bound.process == process:
                own = bound.equation in law.equations
                # The lengths of the sarcomere belong to its level, whatever its law.
                add(bound, level_of(law, bound.defines), process if own else "", offers(law, bound.equation))
        for state in law.states:
            level, rate = level_of(law, state.name), term(state.rate)
            assembly.add(Relation(state.number, owner, level, term(state.name, 1), (rate,), process))
        for name in owed_by(law):
            assembly.variables.setdefault(term(name).variable, level_of(law, name))


def parameter_level(name: str, home: str) -> str:
    """The level of a parameter: that of the law that knows it, or `home`."""
    process, inside, _ = name.partition("__")
    if not inside:
        return home
    return APONEUROSIS if process == "aponeurosis" else CONTRACTS[process].level


def offers(law: Law, item: Equation) -> list[str]:
    """What a sarcomere's law is given and does not use, on its last equation."""
    if law.process != "sarcomere" or item is not law.equations[-1]:
        return []
    used = {name for one in law.equations for name in one.uses}
    return [name for name in CONTRACTS[law.process].given if name not in used]
