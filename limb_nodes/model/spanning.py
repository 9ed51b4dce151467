"""Paths over several joints as a limb's file gives them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from limb_nodes.foundation.parameter import Parameter
from limb_nodes.foundation.section import Section, describe, present
from limb_nodes.levels import Law
from limb_nodes.levels.muscle import linear_path, polynomial_path, straight_path
from limb_nodes.levels.muscle.spanning_path import LENGTH, spanning
from limb_nodes.levels.tangent import UnsupportedCode
from limb_nodes.model.chosen import ChosenLaw
from limb_nodes.model.limb import Segment

# The name of what the first segment hangs from.
BASE = "base"
MOST_TERMS = 100


@dataclass(frozen=True)
class Crossed:
    """The joints that a muscle crosses, by place from proximal to distal, among all segments of its limb."""

    segments: Sequence[Segment]
    joints: tuple[int, ...]

    @property
    def names(self) -> list[str]:
        """Names of the joints."""
        return [self.segments[joint].joint for joint in self.joints]


def read_joints(section: Section, segments: Sequence[Segment]) -> tuple[int, ...]:
    """The joints of a muscle, from `joint` or `joints`; from proximal to distal."""
    names = [segment.joint for segment in segments]
    if not section.has("joints"):
        section.take("joints")
        if not section.has("joint"):
            section.fail("joint", f"is missing; a joint is needed, or a list joints; allowed: {', '.join(names)}")
        return (names.index(section.choice("joint", names)),)
    if section.has("joint"):
        section.fail("joint", "is there beside joints; one of them is needed")
    section.take("joint")
    given = section.take("joints")
    if not isinstance(given, list) or not given:
        section.fail("joints", f"is {describe(given)}; a list of joints is needed; allowed: {', '.join(names)}")
    for place, name in enumerate(given):
        if name not in names:
            section.fail(f"joints[{place}]", f"is {describe(name)}; allowed: {', '.join(names)}")
        if name in given[:place]:
            section.fail(f"joints[{place}]", f"is {name!r} a second time; each joint once is needed")
    joints = sorted(names.index(name) for name in given)
    between = [names[joint] for joint in range(joints[0], joints[-1]) if joint not in joints]
    if between:
        section.fail(
            "joints", f"is {given}, without {', '.join(between)} in between; joints next to each other are needed"
        )
    return tuple(joints)


def read_linear(section: Section, crossed: Crossed) -> tuple[Law, dict[str, float]]:
    """Constant moment arms: length, moment_arms by joint, and angles by joint, at which the length is that."""
    values = {"length": present(section.number(linear_path.LENGTH_AT_REFERENCE))}
    arms = by_joint(section, linear_path.MOMENT_ARM, crossed)
    angles = by_joint(section, linear_path.REFERENCE_ANGLE, crossed)
    for place, (arm, angle) in enumerate(zip(arms, angles, strict=True)):
        values |= {f"arm_{place}": arm, f"reference_angle_{place}": angle}
    return linear_path.linear(len(crossed.joints)), values


def by_joint(section: Section, parameter: Parameter, crossed: Crossed) -> list[float]:
    """A mapping with a number for each joint, which may be missing if there is a default."""
    names, key = crossed.names, parameter.name
    if parameter.default is not None and not section.has(key):
        section.take(key)
        return [float(parameter.default)] * len(names)
    if not section.has(key):
        section.fail(key, f"is missing; {parameter.allowed()} is needed for each of {', '.join(names)}")
    of_joint = section.section(key)
    values = [present(of_joint.number(replace(parameter, name=name))) for name in names]
    of_joint.finish()
    return values


def read_polynomial(section: Section, crossed: Crossed) -> tuple[Law, dict[str, float]]:
    """Terms of a polynomial, each with its coefficient and the powers of the joints' angles."""
    names = crossed.names
    values: dict[str, float] = {}
    powers: list[tuple[int, ...]] = []
    terms = section.sections("terms", required=True)
    if len(terms) > MOST_TERMS:
        section.fail("terms", f"has {len(terms)} entries; {MOST_TERMS} at most are needed")
    for number, term in enumerate(terms):
        values[f"coefficient_{number}"] = present(term.number(polynomial_path.COEFFICIENT))
        power = Parameter("power", "1", "", 0.0, minimum=0.0, maximum=polynomial_path.MOST_POWER, integer=True)
        given = term.section("powers") if term.has("powers") else Section(term.file, term.at("powers"), {})
        term.take("powers")
        powers.append(tuple(int(present(given.number(replace(power, name=name)))) for name in names))
        given.finish()
        term.finish()
        if powers[-1] in powers[:-1]:
            section.fail(f"terms[{number}].powers", "are those of a term before; each product of powers once is needed")
    for place, name in enumerate(names):
        if not any(term[place] for term in powers):
            section.fail("terms", f"have no power of {name}; the length must change with each joint of the muscle")
    note_fit(section)
    return polynomial_path.polynomial(tuple(powers)), values


def note_fit(section: Section) -> None:
    """Where a polynomial comes from and how far it is off (m), which a file may note."""
    if section.has("source"):
        section.text("source")
    section.take("source")
    error = Parameter("error", "m", "greatest error of the fit", 0.0, minimum=0.0, maximum=1.0)
    section.number(error)


def read_straight(section: Section, crossed: Crossed) -> tuple[Law, dict[str, float]]:
    """Points on segments or on the base, between which the path is straight."""
    first, names = crossed.joints[0], [BASE, *(segment.name for segment in crossed.segments)]
    spanned = names[first : first + len(crossed.joints) + 1]
    values: dict[str, float] = {}
    places: list[int] = []
    points = section.sections("points", required=True)
    for number, point in enumerate(points):
        places.append(spanned.index(point.choice("segment", spanned)))
        x, y = point.vector("at", 2, None)
        values |= {f"x_{number}": x, f"y_{number}": y, f"segment_{number}": first + places[-1]}
        point.finish()
    for place in 0, len(spanned) - 1:
        if place not in places:
            section.fail("points", f"has none on {spanned[place]}; one on each end of the joints is needed")
    for place in range(len(crossed.joints)):
        before = first + place - 1
        values[f"segment_length_{place}"] = crossed.segments[before].length if before >= 0 else 0.0
    return straight_path.straight(tuple(places)), values


READERS: dict[str, Callable[[Section, Crossed], tuple[Law, dict[str, float]]]] = {
    "linear": read_linear,
    "polynomial": read_polynomial,
    "straight_lines": read_straight,
}


def spans(section: Section) -> bool:
    """Whether a muscle's section chooses one of these paths."""
    path = section.content.get("path")
    name: Any = path.get("law") if isinstance(path, Mapping) else path
    return isinstance(name, str) and name in READERS


def read_spanning(section: Section, crossed: Crossed) -> ChosenLaw:
    """One of these paths, from the muscle's key `path`."""
    path = section.section("path")
    law, values = READERS[path.choice("law", READERS)](path, crossed)
    path.finish()
    return ChosenLaw(law, values, path.place)


def over_joints(section: Section, chosen: ChosenLaw, crossed: Crossed) -> ChosenLaw:
    """A path that was chosen by its law, over the joints of its muscle.

    A law that gives the length alone gets the rest. Such a law calls the angles by the names of the joints, as in
    knee_angle, or joint_angle if there is only one.
    """
    law, names = chosen.law, crossed.names
    defined = {item.defines for item in law.equations}
    if "moment_arm" in defined or LENGTH not in defined:
        if len(names) > 1 and law.equations:
            section.fail(
                "path.law",
                f"is {law.name!r}, a law for one joint; over {', '.join(names)} allowed: {', '.join(READERS)}, or a "
                "law of one's own that gives the muscle-tendon length alone",
            )
        return chosen
    (length,) = (item for item in law.equations if item.defines == LENGTH)
    angles = tuple(f"{name}_angle" for name in names)
    if len(names) == 1 and "joint_angle" in length.uses:
        angles = ("joint_angle",)
    if unused := [angle for angle in angles if angle not in length.uses]:
        section.fail("path.law", f"is {law.name!r}, whose length does not use {', '.join(unused)}; it is needed")
    try:
        return replace(chosen, law=spanning(law, angles))
    except UnsupportedCode as problem:
        section.fail("path.law", f"is {law.name!r}; it cannot be compiled: {problem}")
        raise
