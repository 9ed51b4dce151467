"""A limb of one person as that of another: lengths go with the height, masses with the mass, forces with its power 2/3.

Strength goes with the cross-section of muscles, and this with a person's mass to the power of 2/3 (Jaric, Sports Med 32
(2002) 615). Angles, activations, times and what happens within a sarcomere stay as they are.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from limb_nodes.errors import UserError
from limb_nodes.foundation.yaml_text import placed_yaml
from limb_nodes.levels import CONTRACTS
from limb_nodes.model.chosen import ChosenLaw
from limb_nodes.model.limb import Limb, Person
from limb_nodes.model.load import PERSON_HEIGHT, PERSON_MASS

# Of a segment and of a motor unit, what changes and with what: powers of length, mass and force.
SEGMENT = {"mass": (0, 1, 0), "length": (1, 0, 0), "com_distance": (1, 0, 0), "inertia": (2, 1, 0)}
UNIT = {
    "series_sarcomeres": (1, 0, 0),
    "parallel_sarcomeres": (0, 0, 1),
    "pcsa": (0, 0, 1),
    "maximum_passive_force": (0, 0, 1),
}
# Units of the parameters of laws, as powers of length and force; others stay.
UNITS = {
    "m": (1, 0),
    "m^2": (2, 0),
    "N": (0, 1),
    "N/m": (-1, 1),
    "N s/m": (-1, 1),
    "N/m^2": (-2, 1),
    "N m": (1, 1),
    "N m/rad": (1, 1),
    "N m s/rad": (1, 1),
    "N m/rad^1.5": (1, 1),
}
# What a number may consist of.
NUMBER = "-+.0123456789eE_"
LEAST_BODY_MASS_INDEX, GREATEST_BODY_MASS_INDEX = 8.0, 100.0


# A section of a limb's file, a key and its new value.
Change = tuple[Any, str, Any]


@dataclass(frozen=True)
class Factors:
    """How many times as large lengths, masses and forces become."""

    length: float
    mass: float
    force: float

    def of(self, length: int, mass: int, force: int) -> float:
        """The factor of a quantity with these powers."""
        return self.length**length * self.mass**mass * self.force**force


def factors_between(limb: Limb, mass: float | None, height: float | None) -> Factors:
    """The factors to a person of a mass (kg) and a height (m); what is not given stays.

    Raises UserError if the limb's file names no person, or if there are no such people.
    """
    if limb.person is None:
        example = "`person: {mass: 75.0, height: 1.75}`"
        raise UserError(f"{limb.file}: person is missing; whose limb it is, such as {example}, is needed")
    for value, parameter in (mass, PERSON_MASS), (height, PERSON_HEIGHT):
        if value is not None:
            parameter.check(value)
    new = Person(mass or limb.person.mass, height or limb.person.height)
    index = new.mass / new.height**2
    if not LEAST_BODY_MASS_INDEX <= index <= GREATEST_BODY_MASS_INDEX:
        raise UserError(
            f"{new.mass:g} kg at {new.height:g} m is a body mass index of {index:.3g} kg/m^2; one from "
            f"{LEAST_BODY_MASS_INDEX:g} to {GREATEST_BODY_MASS_INDEX:g} is needed"
        )
    ratio = new.mass / limb.person.mass
    return Factors(new.height / limb.person.height, ratio, ratio ** (2.0 / 3.0))


def scaled_text(limb: Limb, factors: Factors) -> str:
    """The YAML of a limb for the person that the factors lead to: other numbers in the same text."""
    content = placed_yaml(limb.text)
    before = content["person"]
    head = (
        f"# Scaled by `limb scale` from {limb.name} of {before['mass']:g} kg and {before['height']:g} m: lengths times "
        f"{factors.length:.4g},\n# masses times {factors.mass:.4g}, forces times {factors.force:.4g}. The sources are "
        "those of the limb before.\n#\n"
    )
    lines = limb.text.splitlines(keepends=True)
    # What YAML aliases share is there once.
    edits = {edit for section, key, new in changes(content, limb, factors) for edit in edits_of(section, key, new)}
    for line, column, text in sorted(edits, reverse=True):
        lines[line] = edited(lines[line], column, text)
    return head + "".join(lines)


def edits_of(section: Any, key: str | int, new: Any) -> Iterator[tuple[int, int, str]]:
    """Lines, columns and texts that make of a value another; a key that is not there comes first."""
    if isinstance(key, str) and key not in section:
        owner = next(one for one in owners(section) if one.lc.data)
        line, column = owner.lc.key(next(iter(owner.lc.data)))
        added = f"{key}: {written(new)}"
        yield line, column, f"{added}, " if owner.fa.flow_style() else f"{added}\n{' ' * column}"
    elif isinstance(new, list):
        for index, one in enumerate(new):
            yield from edits_of(section[key], index, one)
    else:
        line, column = section.lc.value(key) if isinstance(key, str) else section.lc.item(key)
        yield line, column, written(new)


def written(number: float) -> str:
    """A number as YAML knows a float."""
    digits, mark, exponent = f"{number:.6g}".partition("e")
    return f"{digits if '.' in digits else f'{digits}.0'}{mark}{exponent}"


def edited(line: str, column: int, text: str) -> str:
    """A line with another number at a column, or with a key before what stands there; a comment keeps its column."""
    if ":" in text:
        return line[:column] + text + line[column:]
    rest = line[column:].lstrip(NUMBER)
    longer = len(text) - (len(line) - column - len(rest))
    space = len(rest) - len(rest.lstrip(" "))
    if rest.lstrip(" ").startswith("#") and space > longer:
        rest = " " * (space - longer) + rest.lstrip(" ")
    return line[:column] + text + rest


def rounded(value: Any, factor: float) -> Any:
    """A number, or those of a list, times a factor, to six digits."""
    if isinstance(value, list):
        return [rounded(one, factor) for one in value]
    return float(f"{float(value) * factor:.6g}")


def changes(content: Any, limb: Limb, factors: Factors) -> Iterator[Change]:
    """What changes in the content of a limb's file."""
    yield from named(content["person"], {"mass": factors.mass, "height": factors.length})
    yield from named(content, {"base_position": factors.length})
    for section, segment in zip(content["segments"], limb.segments, strict=True):
        yield from named(section, {key: factors.of(*powers) for key, powers in SEGMENT.items()})
        for tissue, chosen in zip(section.get("tissue") or (), segment.tissue, strict=True):
            yield from of_tissue(tissue, chosen, factors)
    units = {key: factors.of(*powers) for key, powers in UNIT.items()}
    for kind in (content.get("unit_kinds") or {}).values():
        yield from named(kind, units)
    for section, muscle in zip(content.get("muscles") or (), limb.muscles, strict=True):
        for process, contract in CONTRACTS.items():
            if contract.section == "muscle" and isinstance(section.get(process), dict) and process in muscle.laws:
                yield from of_law(section[process], muscle.laws[process], factors)
        if isinstance(section.get("path"), dict):
            yield from of_path(section["path"], factors.length)
        for unit in section["units"]:
            yield from named(unit, units)


def named(section: Any, factors: dict[str, float]) -> Iterator[Change]:
    """The keys of a section that are there."""
    for key, factor in factors.items():
        owner = next((one for one in owners(section) if key in (one.lc.data or ())), None)
        if owner is not None and owner[key] is not None:
            yield owner, key, rounded(owner[key], factor)


def owners(section: Any) -> Iterator[Any]:
    """The mappings in which keys of a section stand: itself, and those that it is merged with."""
    yield section
    for one in section.merge:
        # A library of before 0.19 tells the place of each as well.
        yield from owners(one[1] if isinstance(one, tuple) else one)


def of_law(section: Any, chosen: ChosenLaw, factors: Factors) -> Iterator[Change]:
    """The parameters of a law, by their units; defaults are written down, for they were those of the person before."""
    for parameter in chosen.law.parameters:
        if powers := UNITS.get(parameter.unit):
            factor = factors.of(powers[0], 0, powers[1])
            if section.get(parameter.name) is None and isinstance(parameter.default, float) and parameter.default:
                yield section, parameter.name, rounded(parameter.default, factor)
            yield from named(section, {parameter.name: factor})


def of_path(section: Any, factor: float) -> Iterator[Change]:
    """The lengths of a path over several joints, which are no parameters of its law."""
    if section.get("law") == "linear":
        yield from named(section["moment_arms"], dict.fromkeys(section["moment_arms"], factor))
    for key, inside in ("terms", "coefficient"), ("points", "at"):
        for one in section.get(key) or ():
            yield from named(one, {inside: factor})


def of_tissue(section: Any, chosen: ChosenLaw, factors: Factors) -> Iterator[Change]:
    """The moments of a joint's tissue; where an exponential one is 1 N m moves with it."""
    moment = factors.of(1, 0, 1)
    if section.get("law") == "exponential":
        for end, sign in ("upper", -1.0), ("lower", 1.0):
            shift = sign * math.log(moment) / section[f"{end}_growth"]
            yield section, f"{end}_angle", float(f"{section[f'{end}_angle'] + shift:.6g}")
    yield from of_law(section, chosen, factors)
