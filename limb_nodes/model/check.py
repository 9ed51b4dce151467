"""Checks across the parameters of a muscle, for limbs that could not work as they are given."""

from __future__ import annotations

import math
from collections.abc import Sequence

from limb_nodes.errors import UserError
from limb_nodes.foundation.section import Section
from limb_nodes.levels.muscle.path import muscle_tendon_length
from limb_nodes.levels.sarcomere.lengths import (
    maximum_sarcomere_length,
    minimum_sarcomere_length,
    optimal_sarcomere_length,
)
from limb_nodes.model.chosen import ChosenLaw
from limb_nodes.model.limb import Muscle, Segment
from limb_nodes.model.probe import Probe, given

ANGLES = 181


def check_unit(section: Section, laws: dict[str, ChosenLaw]) -> None:
    """Refuse filaments whose lengths contradict each other."""
    chosen = laws["sarcomere"].values
    shortest = minimum_sarcomere_length(chosen["myosin_length"])
    optimal = optimal_sarcomere_length(chosen["actin_length"])
    if shortest >= optimal:
        section.fail(
            "sarcomere",
            f"has the shortest length {shortest:g} m (0.9 myosin_length); one below the optimal length "
            f"{optimal:g} m (2 actin_length) is needed",
        )


def fibre_length_range(muscle: Muscle, segment: Segment) -> tuple[float, float]:
    """Shortest and longest muscle length (m) over the joint's range with a slack tendon."""
    lowest, highest = segment.joint_range or (-math.pi, math.pi)
    path = muscle.laws["path"].values
    slack = muscle.laws["tendon"].values.get("slack_length", 0.0)
    lengths = [
        muscle_tendon_length(
            lowest + (highest - lowest) * index / (ANGLES - 1),
            muscle.role,
            path["moment_arm"],
            path["proximal_distance"],
            path["distal_distance"],
        )
        - slack
        for index in range(ANGLES)
    ]
    return min(lengths), max(lengths)


def check_geometry(file: str, muscle: Muscle, segments: Sequence[Segment]) -> None:
    """Refuse a muscle whose fibres are never between their shortest and longest length. segments: all of the limb."""
    path = muscle.laws["path"].values
    if not {"moment_arm", "proximal_distance", "distal_distance"} <= path.keys():
        return
    shortest, longest = fibre_length_range(muscle, segments[muscle.joints[0]])
    if longest <= 0.0:
        slack = muscle.laws["tendon"].values["slack_length"]
        raise UserError(
            f"{file}: {muscle.place}.tendon.slack_length is {slack:g}; a number < "
            f"{longest + slack:g} in m is needed, the longest muscle-tendon length of the joint"
        )
    if muscle.laws["aponeurosis"].law.states:
        check_triangle(file, muscle, longest)
        return
    shortest, longest = (fibre_length_of(muscle, max(0.0, length)) for length in (shortest, longest))
    for index, unit in enumerate(muscle.units):
        sarcomere = unit.laws["sarcomere"].values
        series = unit.values["series_sarcomeres"]
        least = series * minimum_sarcomere_length(sarcomere["myosin_length"])
        most = series * maximum_sarcomere_length(sarcomere["myosin_length"], sarcomere["actin_length"])
        if longest < least or shortest > most:
            optimal = series * optimal_sarcomere_length(sarcomere["actin_length"])
            raise UserError(
                f"{file}: {muscle.place}.units[{index}].series_sarcomeres is {series:g}, which gives "
                f"fibres of {least:.4g} to {most:.4g} m (optimal {optimal:.4g}); fibres that reach the lengths "
                f"{shortest:.4g} to {longest:.4g} m of the joint are needed"
            )


def fibre_length_of(muscle: Muscle, muscle_length: float) -> float:
    """Fibre length (m) at a muscle length, for an aponeurosis without states."""
    chosen = muscle.laws["aponeurosis"]
    probe = Probe(chosen, given(chosen), {"muscle_velocity": 0.0, "total_fibre_force": 0.0})
    return probe.at(muscle_length=muscle_length)["fibre_length"]


def check_triangle(file: str, muscle: Muscle, longest: float) -> None:
    """Refuse an area that muscle and aponeurosis cannot span at any joint angle."""
    values = muscle.laws["aponeurosis"].values
    if "area" in values and values["area"] >= values["length"] * longest:
        raise UserError(
            f"{file}: {muscle.place}.aponeurosis.area is {values['area']:g}; a number < "
            f"{values['length'] * longest:g} in m^2 is needed (aponeurosis length times the "
            "longest muscle length)"
        )
