"""The levels of a limb, each as a set of equations with its unknowns and inputs."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence

from limb_nodes.analysis.structure import chain, muscles
from limb_nodes.analysis.structure.muscles import APONEUROSIS, MUSCLE, SARCOMERE, TENDON, UNIT, unit_owner
from limb_nodes.analysis.structure.relations import Assembly, EquationSet
from limb_nodes.levels import CONTRACTS, MUSCLE_PROCESSES, UNIT_PROCESSES, Law
from limb_nodes.model import Limb, Muscle

ASSEMBLED, MODEL = "muscle_assembled", "model"
TITLES = {
    SARCOMERE: "level of sarcomere",
    UNIT: "level of motor unit",
    MUSCLE: "level of muscle, sub-level of muscle",
    TENDON: "level of muscle, sub-level of tendon",
    APONEUROSIS: "level of muscle, sub-level of aponeurosis",
    ASSEMBLED: "muscle with tendon, aponeurosis, motor units and sarcomeres",
    chain.ORIGINAL: "level of limb, original form",
    chain.TRANSFORMED: "level of limb, transformed form",
    MODEL: "whole model",
}
MUSCLE_LEVELS = (SARCOMERE, UNIT, MUSCLE, TENDON, APONEUROSIS)
MUSCLE_LAWS = tuple(process for process in MUSCLE_PROCESSES if CONTRACTS[process].level == MUSCLE)
# Of motor units, in the level of the muscle.
COMMON_LAWS = tuple(process for process in UNIT_PROCESSES if CONTRACTS[process].level == MUSCLE)


def equation_sets(limb: Limb, level: str | None = None) -> list[EquationSet]:
    """The equations of every level of a limb, or of the level that is named.

    Muscles and motor units with the same laws appear once, with all of them as members.
    """
    assembly = muscles.muscle_assembly(limb)
    sets = [*sets_of_units(limb, assembly), *sets_of_muscles(limb, assembly)]
    joints, laws = limb.joint_names, chain.tissue_laws(limb)
    original = chain.original_assembly(limb)
    sets.append(original.view(chain.ORIGINAL, TITLES[chain.ORIGINAL], [chain.ORIGINAL], laws=laws, members=joints))
    transformed = Assembly()
    for relation in chain.transformed_relations(limb):
        transformed.add(relation)
    sets.append(transformed.view(chain.TRANSFORMED, TITLES[chain.TRANSFORMED], [chain.TRANSFORMED], members=joints))
    for relation in [*chain.interface(limb, chain.INTERFACE), *chain.transformed_relations(limb)]:
        assembly.add(relation)
    every = (*MUSCLE_LEVELS, chain.INTERFACE, chain.TRANSFORMED)
    sets.append(assembly.view(MODEL, TITLES[MODEL], every, members=[limb.name]))
    return [one for one in sets if level is None or one.name == level]


def sets_of_units(limb: Limb, assembly: Assembly) -> Iterator[EquationSet]:
    """Sarcomeres and motor units, one set for each choice of laws."""
    for level in (SARCOMERE, UNIT):
        processes = [process for process in UNIT_PROCESSES if CONTRACTS[process].level == level]
        alike: dict[tuple[Law, ...], list[str]] = {}
        for muscle in limb.muscles:
            for unit in muscle.units:
                laws = tuple(unit.laws[process].law for process in processes)
                alike.setdefault(laws, []).append(unit_owner(muscle, unit))
        for laws, owners in alike.items():
            names = {process: law.name for process, law in zip(processes, laws, strict=True)}
            yield owned_view(assembly, level, [level], {owners[0]}, names, owners)


def sets_of_muscles(limb: Limb, assembly: Assembly) -> Iterator[EquationSet]:
    """Muscles, tendons and aponeuroses, one set for each choice of laws; then muscles with all that is in them."""
    for group in grouped(limb, lambda muscle: (laws_of(muscle, MUSCLE_LAWS), unit_laws(muscle, COMMON_LAWS))):
        first = group[0]
        laws = names_by_process(laws_of(first, MUSCLE_LAWS)) | names_by_process(unit_laws(first, COMMON_LAWS)[0])
        yield owned_view(assembly, MUSCLE, [MUSCLE], owners_of(first), laws, [m.name for m in group])
    for level in (TENDON, APONEUROSIS):
        for group in grouped(limb, lambda muscle, level=level: laws_of(muscle, [level])):  # type: ignore[misc]
            first = group[0]
            laws = names_by_process(laws_of(first, [level]))
            view = owned_view(assembly, level, [level], owners_of(first), laws, [m.name for m in group])
            if view.relations:
                yield view
    for group in grouped(limb, lambda muscle: (laws_of(muscle, muscle.laws), unit_laws(muscle, UNIT_PROCESSES))):
        first = group[0]
        yield owned_view(assembly, ASSEMBLED, MUSCLE_LEVELS, owners_of(first), all_laws(first), [m.name for m in group])


def grouped(limb: Limb, key: Callable[[Muscle], object]) -> list[list[Muscle]]:
    """The muscles of a limb, those with equal keys together."""
    alike: dict[object, list[Muscle]] = {}
    for muscle in limb.muscles:
        alike.setdefault(key(muscle), []).append(muscle)
    return list(alike.values())


def laws_of(muscle: Muscle, processes: Iterable[str]) -> tuple[Law, ...]:
    """A muscle's laws of some processes."""
    return tuple(muscle.laws[process].law for process in processes)


def unit_laws(muscle: Muscle, processes: Sequence[str]) -> tuple[tuple[Law, ...], ...]:
    """The laws of some processes of each motor unit."""
    return tuple(tuple(unit.laws[process].law for process in processes) for unit in muscle.units)


def names_by_process(laws: Iterable[Law]) -> dict[str, str]:
    """Names of laws by process."""
    return {law.process: law.name for law in laws}


def all_laws(muscle: Muscle) -> dict[str, str]:
    """Names of all laws of a muscle and its motor units by process."""
    names = names_by_process(laws_of(muscle, muscle.laws))
    for process in UNIT_PROCESSES:
        laws = [unit.laws[process].law.name for unit in muscle.units]
        names[process] = ", ".join(dict.fromkeys(laws))
    return names


def owners_of(muscle: Muscle) -> set[str]:
    """The owners of the variables of a muscle."""
    return {muscle.name, *(unit_owner(muscle, unit) for unit in muscle.units)}


def owned_view(
    assembly: Assembly,
    name: str,
    levels: Sequence[str],
    owners: set[str],
    laws: dict[str, str],
    members: Sequence[str],
) -> EquationSet:
    """The equations of one muscle or motor unit in some levels."""
    return assembly.view(
        name,
        TITLES[name],
        levels,
        lambda relation: relation.owner in owners,
        lambda variable: variable.owner in owners,
        laws,
        members,
    )
