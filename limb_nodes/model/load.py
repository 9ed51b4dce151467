"""From a limb's YAML to a checked `Limb`."""

from __future__ import annotations

import copy
import math
import re
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

from limb_nodes.errors import UserError
from limb_nodes.foundation.parameter import Parameter
from limb_nodes.foundation.section import Section, present
from limb_nodes.foundation.yaml_text import parse_yaml, read_yaml, yaml_text
from limb_nodes.levels import CONTRACTS, MUSCLE_PROCESSES, UNIT_PROCESSES, motor_unit
from limb_nodes.levels.motor_unit.recruitment import unit_thresholds
from limb_nodes.model.check import check_geometry, check_unit
from limb_nodes.model.check_law import check_laws
from limb_nodes.model.choice import choose_law, read_law
from limb_nodes.model.chosen import ChosenLaw
from limb_nodes.model.consent import require_consent
from limb_nodes.model.limb import Limb, MotorUnit, Muscle, Person, Segment
from limb_nodes.model.path_remarks import warn_of_arms
from limb_nodes.model.spanning import Crossed, over_joints, read_joints, read_spanning, spans
from limb_nodes.model.system import crossings_of
from limb_nodes.model.user_code import NO_CODE, UserCode, named_modules, user_code

BASE_ANGLE = Parameter(
    "base_angle",
    "rad",
    "direction of the fixed segment that joint 1 hangs from, counter-clockwise from +x",
    -math.pi / 2,
    "hangs straight down at zero joint angles",
    minimum=-2 * math.pi,
    maximum=2 * math.pi,
)
TIP_TORQUE = Parameter("tip_torque", "N m", "torque of the environment on the last segment", 0.0, "depends on the run")
SEGMENT_PARAMETERS = (
    Parameter("mass", "kg", "mass of the segment, m", above=0.0, maximum=1e4),
    Parameter("length", "m", "distance to the next joint or the tip, l", above=0.0, maximum=100.0),
    Parameter(
        "com_distance",
        "m",
        "distance of the centre of mass from the proximal joint, l_COM",
        minimum=0.0,
        maximum=100.0,
    ),
    Parameter("inertia", "kg m^2", "moment of inertia about the centre of mass", above=0.0),
    Parameter(
        "angle",
        "rad",
        "joint angle at the start",
        0.0,
        "depends on the run",
        minimum=-2 * math.pi,
        maximum=2 * math.pi,
    ),
    Parameter(
        "velocity",
        "rad/s",
        "joint velocity at the start",
        0.0,
        "depends on the run",
        minimum=-1e3,
        maximum=1e3,
    ),
)
ACTIVATION_THRESHOLD = Parameter(
    "activation_threshold",
    "1",
    "activation at which all motor units are recruited, U_th",
    0.0,
    "depends on the muscle",
    minimum=0.0,
    below=1.0,
)
DELAY = Parameter(
    "delay",
    "s",
    "electromechanical delay, from the excitation to the muscle",
    0.0,
    "depends on the muscle; 0.03 to 0.06 in people",
    minimum=0.0,
    maximum=1.0,
)
PERSON_MASS = Parameter(
    "mass", "kg", "of the person whose limb it is", source="depends on the person", minimum=2.0, maximum=400.0
)
PERSON_HEIGHT = Parameter(
    "height", "m", "of the person whose limb it is", source="depends on the person", minimum=0.4, maximum=2.6
)
COUNT = Parameter("count", "1", "number of such units", 1.0, "depends on the muscle", 1.0, 10000.0, integer=True)
ORDER = Parameter("order", "1", "place in the recruitment order, R_F", 0.0, "position in the list")
ROLES = {"flexor": 1.0, "extensor": -1.0}


def load_limb(path: str | Path, allow_laws: bool = False) -> Limb:
    """Read and check a limb's YAML file.

    allow_laws: whether code that the file names may run although the user has not trusted it.
    Raises UserError, one line with file, place, value and what is allowed.
    """
    content, text = read_yaml(Path(path))
    return build_limb(content, str(path), text, allowed_code(content, str(path), allow_laws))


def parse_limb(text: str, file: str, allow_laws: bool = False) -> Limb:
    """The same from text, such as a bag holds it; `file` appears in errors."""
    content = parse_yaml(text, file)
    return build_limb(content, file, text, allowed_code(content, file, allow_laws))


def outline(text: str, file: str) -> Limb:
    """A limb to be looked at, whatever its text names: none of its code runs.

    A law of the user's own has no equations then, and the numbers of its section for parameters; nothing is checked
    that would need them. Raises UserError.
    """
    return build_limb(parse_yaml(text, file), file, text, None)


def allowed_code(content: Any, file: str, allow_laws: bool) -> UserCode:
    """The code that a limb's content names. Raises FieldError if it may not run."""
    code = user_code(content, file)
    require_consent(code, file, allow_laws)
    return code


def with_values(limb: Limb, values: Mapping[str, Any], allow_laws: bool = False) -> Limb:
    """A limb with other values at places such as ``muscles[0].tendon.stiffness``.

    A place that is not in the limb's file is added; all checks run again. allow_laws: as for `load_limb`, if a value
    names code that the limb did not. Raises UserError.
    """
    content = unshared(limb.content)
    for place, value in values.items():
        steps: list[str | int] = [
            int(index) if index else name for name, index in re.findall(r"([^.\[\]]+)|\[(\d+)\]", place)
        ]
        target: Any = content
        for step, following in pairwise(steps):
            try:
                if isinstance(target, dict) and target.get(step) is None:
                    target[step] = [] if isinstance(following, int) else {}
                target = target[step]
            except (IndexError, KeyError, TypeError):
                raise UserError(f"{limb.file}: {place} is not a place; a key of the limb is needed") from None
        try:
            # Numbers of numpy as plain ones, which YAML can hold.
            target[steps[-1]] = value.item() if hasattr(value, "item") else value
        except (IndexError, TypeError):
            raise UserError(f"{limb.file}: {place} is not a place; a key of the limb is needed") from None
    known = limb.code.modules.keys() >= set(named_modules(content))
    code = limb.code if known else allowed_code(content, limb.file, allow_laws)
    return build_limb(content, limb.file, yaml_text(content), code)


def unshared(content: Any) -> Any:
    """A deep copy in which what YAML aliases share is there as often as it is used."""
    if isinstance(content, dict):
        return {key: unshared(value) for key, value in content.items()}
    if isinstance(content, list):
        return [unshared(value) for value in content]
    return copy.deepcopy(content)


def build_limb(content: Any, file: str, text: str, code: UserCode | None = NO_CODE) -> Limb:
    """Check the content of a limb's file and make a `Limb` of it. code: the user's own, which runs; see `outline`."""
    top = Section(file, "", content)
    segments = tuple(read_segment(section, code) for section in top.sections("segments", required=True))
    joints = [segment.joint for segment in segments]
    refuse_duplicates(top, "segments", "joint", joints)
    refuse_duplicates(top, "segments", "name", [segment.name for segment in segments])
    sarcomeres = read_named(top, "sarcomeres")
    kinds = read_named(top, "unit_kinds")
    muscles = tuple(
        read_muscle(section, segments, sarcomeres, kinds, code) for section in top.sections("muscles", required=False)
    )
    refuse_duplicates(top, "muscles", "name", [muscle.name for muscle in muscles])
    limb = Limb(
        name=top.text("name"),
        gravity=pair(top.vector("gravity", 2, (0.0, -9.81))),
        base_angle=present(top.number(BASE_ANGLE)),
        base_position=pair(top.vector("base_position", 2, (0.0, 0.0))),
        tip_force=pair(top.vector("tip_force", 2, (0.0, 0.0))),
        tip_torque=present(top.number(TIP_TORQUE)),
        segments=segments,
        muscles=muscles,
        person=read_person(top),
        file=file,
        text=text,
        content=content,
        code=code or NO_CODE,
    )
    top.finish()
    if code is not None:
        for muscle in muscles:
            check_geometry(file, muscle, segments)
        check_laws(limb)
        warn_of_arms(limb)
    return limb


def read_segment(section: Section, code: UserCode | None) -> Segment:
    """One entry of `segments`."""
    values = {parameter.name: present(section.number(parameter)) for parameter in SEGMENT_PARAMETERS}
    joint_range = None
    if section.has("range"):
        joint_range = pair(section.vector("range", 2, None))
        if joint_range[0] >= joint_range[1]:
            section.fail("range", f"is {list(joint_range)}; [lowest, highest] in rad is needed")
        if not joint_range[0] <= values["angle"] <= joint_range[1]:
            section.fail("angle", f"is {values['angle']}; a number within range {list(joint_range)} in rad is needed")
    else:
        section.take("range")
    name = section.text("name")
    joint = section.text("joint", name)
    tissue = tuple(read_law(one, "tissue", code) for one in section.sections("tissue", required=False))
    segment = Segment(name=name, joint=joint, joint_range=joint_range, tissue=tissue, **values)
    section.finish()
    return segment


def read_person(top: Section) -> Person | None:
    """Whose limb it is, if the file tells it."""
    if not top.has("person"):
        top.take("person")
        return None
    section = top.section("person")
    mass, height = section.number(PERSON_MASS), section.number(PERSON_HEIGHT)
    section.finish()
    return Person(present(mass), present(height))


def read_muscle(
    section: Section,
    segments: Sequence[Segment],
    sarcomeres: dict[str, Section],
    kinds: dict[str, Section],
    code: UserCode | None,
) -> Muscle:
    """One entry of `muscles`."""
    name = section.text("name")
    crossed = Crossed(segments, read_joints(section, segments))
    threshold, delay = present(section.number(ACTIVATION_THRESHOLD)), present(section.number(DELAY))
    path = read_path(section, crossed, code)
    # The signs of the moment arms tell it where a path has one for each joint.
    role = 0.0
    if crossings_of(path.law) == ("",):
        role = ROLES[section.choice("role", ROLES)]
    elif not path.law.equations:
        section.take("role")
    laws = {name: path if name == "path" else choose_law(section, name, code) for name in MUSCLE_PROCESSES}
    of_units = {name: choose_law(section, name, code) for name in UNIT_PROCESSES if CONTRACTS[name].section == "muscle"}
    units: list[tuple[float, MotorUnit]] = []
    for position, unit_section in enumerate(section.sections("units", required=True)):
        names = {unit.name for _, unit in units}
        new = read_units(unit_section, position, sarcomeres, kinds, of_units, code)
        for _, unit in new:
            if unit.name in names:
                section.fail(f"units[{position}].name", f"is {unit.name!r} a second time; a name of its own is needed")
        units += new
    units.sort(key=lambda entry: entry[0])
    ordered = [unit for _, unit in units]
    section.finish()
    thresholds = unit_thresholds([unit.values["pcsa"] for unit in ordered], threshold)
    for place, (unit, unit_threshold) in enumerate(zip(ordered, thresholds, strict=True), 1):
        unit.values["unit_threshold"] = unit_threshold
        unit.values["unit_rank"] = place / len(ordered)
    return Muscle(name, crossed.joints, role, threshold, laws, tuple(ordered), section.place, delay)


def read_path(section: Section, crossed: Crossed, code: UserCode | None) -> ChosenLaw:
    """The path of a muscle over its joints."""
    if spans(section):
        return read_spanning(section, crossed)
    return over_joints(section, choose_law(section, "path", code), crossed)


def read_units(
    section: Section,
    position: int,
    sarcomeres: dict[str, Section],
    kinds: dict[str, Section],
    given: dict[str, ChosenLaw],
    code: UserCode | None,
) -> list[tuple[float, MotorUnit]]:
    """One entry of `units`: `count` units with their place in the recruitment order.

    given: laws of the units that the muscle's section chooses.
    """
    section = with_kind(section, kinds)
    section.take("kind")
    name = section.text("name", section.content.get("kind") or f"unit{position + 1}")
    count = int(present(section.number(COUNT)))
    order = present(section.number(ORDER)) if section.has("order") else float(position)
    section.take("order")
    values = {parameter.name: present(section.number(parameter)) for parameter in motor_unit.PARAMETERS}
    if values["maximum_frequency"] <= values["minimum_frequency"]:
        section.fail(
            "maximum_frequency",
            f"is {values['maximum_frequency']:g}; a number > minimum_frequency "
            f"({values['minimum_frequency']:g}) in Hz is needed",
        )
    laws = {
        name: given[name] if name in given else choose_law(section, name, code, sarcomeres) for name in UNIT_PROCESSES
    }
    section.finish()
    if code is not None:
        check_unit(section, laws)
    names = [name] if count == 1 else [f"{name}_{index + 1}" for index in range(count)]
    return [(order, MotorUnit(one, dict(values), laws)) for one in names]


def with_kind(section: Section, kinds: dict[str, Section]) -> Section:
    """A unit's section with what it leaves to its kind; parameters of the same law are merged."""
    if not section.has("kind"):
        return section
    kind = kinds[section.choice("kind", kinds)]
    content = {**kind.content, **section.content}
    for key, own in section.content.items():
        given = kind.content.get(key)
        if isinstance(given, dict) and isinstance(own, dict) and own.get("law", given.get("law")) == given.get("law"):
            content[key] = {**given, **own}
    inherited = {key: kind.at(key) for key in kind.content if key not in section.content}
    return Section(section.file, section.place, content, inherited)


def read_named(top: Section, key: str) -> dict[str, Section]:
    """A mapping of names to mappings, which may be missing."""
    if not top.has(key):
        top.take(key)
        return {}
    holder = top.section(key)
    return {name: holder.section(name) for name in holder.content}


def refuse_duplicates(section: Section, key: str, field: str, names: list[str]) -> None:
    """Refuse a list in which two entries have the same name."""
    for index, name in enumerate(names):
        if name in names[:index]:
            section.fail(f"{key}[{index}].{field}", f"is {name!r} a second time; a name of its own is needed")


def pair(values: tuple[float, ...]) -> tuple[float, float]:
    """A vector of two numbers."""
    return (values[0], values[1])
