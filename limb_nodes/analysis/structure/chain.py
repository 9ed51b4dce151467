"""The equations of the limb, segment by segment, in the original and in the transformed form."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from limb_nodes.analysis.structure.relations import Assembly, Relation, Term, Variable, relate, substitute
from limb_nodes.levels.equation import ScalarFunction, equation_of
from limb_nodes.levels.limb import chain, original, transformed
from limb_nodes.model import Limb
from limb_nodes.model.limb import Segment
from limb_nodes.model.system import crossings_of, tissue_system

ORIGINAL, TRANSFORMED, INTERFACE = "limb_original", "limb_transformed", "limb_interface"
TIP_FORCE = {name: (Term(Variable("", name)),) for name in ("tip_force_x", "tip_force_y")}
TIP_TORQUE = (Term(Variable("", "tip_torque")),)
ABBREVIATIONS = (
    "net_torque",
    "centrifugal_torque",
    "tip_force_torque",
    "gravity_torque",
    "inertial_torque",
    "inertia_coupling",
)
NONE: tuple[Term, ...] = ()


class AxisEquations(NamedTuple):
    """The equations of the original form along one axis."""

    velocity: ScalarFunction
    acceleration: ScalarFunction
    force: ScalarFunction
    last_force: ScalarFunction
    point: ScalarFunction


AXES = {
    "x": AxisEquations(
        original.com_velocity_x,
        original.com_acceleration_x,
        original.joint_force_x,
        original.last_joint_force_x,
        chain.point_x,
    ),
    "y": AxisEquations(
        original.com_velocity_y,
        original.com_acceleration_y,
        original.joint_force_y,
        original.last_joint_force_y,
        chain.point_y,
    ),
}
Given = Mapping[str, Iterable[Term]]


def of(owner: str, *names: str, order: int = 0) -> tuple[Term, ...]:
    """Variables of a segment."""
    return tuple(Term(Variable(owner, name), order) for name in names)


def interface(limb: Limb, level: str) -> list[Relation]:
    """Torques of the joints by those of the muscles, joint angles and velocities by those of the segments."""
    relations = []
    previous = ""
    for k, segment in enumerate(limb.segments):
        torques = tuple(
            Term(Variable(m.name, f"muscle_torque{ending}"))
            for m in limb.muscles
            for ending, joint in zip(crossings_of(m.laws["path"].law), m.joints, strict=True)
            if joint == k
        )
        (torque,) = of(segment.name, "joint_torque")
        tissue = tissue_relations(segment, level)
        passive = tuple(one.defines for one in tissue if one.defines.variable.name == "passive_moment")
        relations += [Relation("2.61", segment.name, level, torque, torques + passive), *tissue]
        for item, angle in (
            (original.joint_angle, "segment_angle"),
            (original.joint_velocity, "segment_velocity"),
        ):
            equation = equation_of(item)
            (defined,) = of(segment.name, equation.defines)
            given = {angle: of(segment.name, angle), f"previous_{angle}": of(previous, angle) if k else NONE}
            relations.append(relate(equation, level, segment.name, defined, given))
        previous = segment.name
    return relations


def tissue_relations(segment: Segment, level: str) -> list[Relation]:
    """The equations of the tissue of a segment's joint; each law's variables have an owner of their own."""
    relations = []
    for number, chosen in enumerate(segment.tissue):
        owner = f"{segment.name}.tissue{number}"
        system = tissue_system(chosen.law)
        defined = {bound.defines for bound in system.equations}
        for bound in system.equations:
            owners = dict.fromkeys(defined, owner) | dict.fromkeys(system.inputs, segment.name)
            uses = tuple(Term(Variable(owners[name], name)) for name in bound.symbols if name in owners)
            defines = Term(Variable(owner, bound.defines))
            relations.append(Relation(bound.equation.number, owner, level, defines, uses, bound.process))
    return relations


def tissue_laws(limb: Limb) -> dict[str, str]:
    """Names of all laws of the joints' tissue by process."""
    names = dict.fromkeys(chosen.law.name for segment in limb.segments for chosen in segment.tissue)
    return {"tissue": ", ".join(names)} if names else {}


def original_assembly(limb: Limb) -> Assembly:
    """The original form (2.56-2.65) with its interface to the muscles."""
    assembly = Assembly()
    for relation in [*original_relations(limb), *interface(limb, ORIGINAL)]:
        assembly.add(relation)
    return assembly


def original_relations(limb: Limb) -> list[Relation]:
    """Every segment as a free body."""
    names = [segment.name for segment in limb.segments]
    relations: list[Relation] = []
    for k, name in enumerate(names):
        following = names[k + 1] if k + 1 < len(names) else ""
        relations += turning(name, following)
        for axis, equations in AXES.items():
            relations += translation(name, following, axis, equations, based=k == 0)
    return substitute(relations, ("joint_position_x", "joint_position_y", "proximal_moment", "distal_moment"))


def free_body(owner: str, function: ScalarFunction, given: Given, defines: Term | None = None) -> Relation:
    """An equation of a segment, by default of the variable that it defines."""
    item = equation_of(function)
    constants = dict.fromkeys(("mass", "inertia", "length", "com_distance", "gravity_x", "gravity_y"), NONE)
    return relate(item, ORIGINAL, owner, defines or of(owner, item.defines)[0], {**constants, **given})


def turning(name: str, following: str) -> list[Relation]:
    """Angle and angular velocity of a segment; `following` is the segment that it carries, if any."""
    own = {
        variable: of(name, variable)
        for variable in (
            "segment_angle",
            "segment_velocity",
            "joint_torque",
            "joint_force_x",
            "joint_force_y",
            "proximal_moment",
            "distal_moment",
        )
    }
    angle, velocity = of(name, "segment_angle", "segment_velocity", order=1)
    if following:
        own |= {f"distal_force_{axis}": of(following, f"joint_force_{axis}") for axis in AXES}
        own["next_joint_torque"] = of(following, "joint_torque")
        rate = original.segment_velocity_rate
    else:
        own |= {f"distal_force_{axis}": TIP_FORCE[f"tip_force_{axis}"] for axis in AXES}
        own["tip_torque"] = TIP_TORQUE
        rate = original.last_segment_velocity_rate
    return [
        free_body(name, original.segment_angle_rate, own, angle),
        free_body(name, rate, own, velocity),
        free_body(name, original.proximal_moment, own),
        free_body(name, original.distal_moment, own),
    ]


def translation(name: str, following: str, axis: str, equations: AxisEquations, based: bool) -> list[Relation]:
    """Movement of a segment's centre of mass along an axis, and the forces. based: whether the base holds it."""
    given = {
        f"{variable}_{axis}_rate": of(name, f"{variable}_{axis}", order=1)
        for variable in ("com_position", "com_velocity")
    }
    given |= {
        f"com_acceleration_{axis}": of(name, f"com_acceleration_{axis}"),
        f"next_joint_force_{axis}": of(following, f"joint_force_{axis}") if following else NONE,
        **TIP_FORCE,
        # 2.65 sums over the segments before; the chain of joint positions is put in later.
        f"origin_{axis}": NONE if based else of(name, f"joint_position_{axis}"),
        "distance": NONE,
        "segment_angle": of(name, "segment_angle"),
    }
    relations = [
        free_body(name, equations.velocity, given),
        free_body(name, equations.acceleration, given),
        free_body(name, equations.force if following else equations.last_force, given),
        free_body(name, equations.point, given, of(name, f"com_position_{axis}")[0]),
    ]
    if following:
        relations.append(free_body(name, equations.point, given, of(following, f"joint_position_{axis}")[0]))
    return relations


def transformed_relations(limb: Limb) -> list[Relation]:
    """Segment angles and velocities alone (3.10, 3.11), with A, M, F and G put into 3.11."""
    names = [segment.name for segment in limb.segments]
    relations: list[Relation] = []
    for k, name in enumerate(names):
        relations += torques(name, names[k + 1] if k + 1 < len(names) else "")
        for other in names:
            relations += coupling(name, other)
        relations.append(balance(name, names))
    return substitute(relations, ABBREVIATIONS)


def transform(owner: str, function: ScalarFunction, given: Given, defines: Term | None = None) -> Relation:
    """An equation of the transformed form, by default of the variable that it defines."""
    item = equation_of(function)
    constants = dict.fromkeys(("length", "first_moment", "coupling", "gravity_x", "gravity_y"), NONE)
    return relate(item, TRANSFORMED, owner, defines or of(owner, item.defines)[0], {**constants, **given})


def torques(name: str, following: str) -> list[Relation]:
    """Angle of a segment, and the torques on it that no other segment's movement makes."""
    (angle,) = of(name, "segment_angle")
    turned = {"cosine": (angle,), "sine": (angle,), **TIP_FORCE}
    muscles = {"joint_torque": of(name, "joint_torque"), "tip_torque": TIP_TORQUE}
    if following:
        muscles["next_joint_torque"] = of(following, "joint_torque")
    return [
        transform(
            name,
            transformed.segment_angle_rate,
            {"segment_velocity": of(name, "segment_velocity")},
            of(name, "segment_angle", order=1)[0],
        ),
        transform(name, transformed.net_torque if following else transformed.last_net_torque, muscles),
        transform(name, chain.gravity_torque, turned),
        transform(name, chain.tip_force_torque, turned),
    ]


def coupling(name: str, other: str) -> list[Relation]:
    """The torques on a segment by the movement of another or of its own."""
    pair = f"{name}, {other}"
    angles = (*of(name, "segment_angle"), *of(other, "segment_angle")) if other != name else NONE
    given = {
        "cosine": angles,
        "sine": angles,
        "inertia_coupling": of(pair, "inertia_coupling"),
        "segment_velocity_rate": of(other, "segment_velocity", order=1),
        "segment_velocity": of(other, "segment_velocity"),
    }
    relations = [transform(pair, chain.inertia_coupling, given), transform(pair, transformed.inertial_torque, given)]
    return relations + ([transform(pair, chain.centrifugal_torque, given)] if other != name else [])


def balance(name: str, names: Sequence[str]) -> Relation:
    """The row of 3.11 of a segment among all."""
    row: dict[str, tuple[Term, ...]] = {
        variable: of(name, variable) for variable in ("net_torque", "gravity_torque", "tip_force_torque")
    }
    pairs = {other: f"{name}, {other}" for other in names}
    row["inertial_torque"] = tuple(term for pair in pairs.values() for term in of(pair, "inertial_torque"))
    row["centrifugal_torque"] = tuple(
        term for other, pair in pairs.items() if other != name for term in of(pair, "centrifugal_torque")
    )
    return transform(name, transformed.torque_residual, row, of(name, "segment_velocity", order=1)[0])
