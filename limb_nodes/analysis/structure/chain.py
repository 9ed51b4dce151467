"""The equations of the limb, segment by segment, in the original and in the transformed form."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from limb_nodes.analysis.structure.relations import Assembly, Relation, Term, Variable, relate, substitute
from limb_nodes.levels.equation import ScalarFunction, equation_of
from limb_nodes.levels.limb import chain, original, transformed
from limb_nodes.model import Limb

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
Given = Mapping[str, Iterable[Term]]


def of(owner: str, *names: str, order: int = 0) -> tuple[Term, ...]:
    """Variables of a segment."""
    return tuple(Term(Variable(owner, name), order) for name in names)


def interface(limb: Limb, level: str) -> list[Relation]:
    """Torques of the joints by those of the muscles, joint angles and velocities by those of the segments."""
    found = []
    previous = ""
    for k, segment in enumerate(limb.segments):
        torques = tuple(Term(Variable(m.name, "muscle_torque")) for m in limb.muscles if m.joint == k)
        (torque,) = of(segment.name, "joint_torque")
        found.append(Relation("2.61", segment.name, level, torque, torques))
        for item, angle in (
            (original.joint_angle, "segment_angle"),
            (original.joint_velocity, "segment_velocity"),
        ):
            equation = equation_of(item)
            (defined,) = of(segment.name, equation.defines)
            given = {angle: of(segment.name, angle), f"previous_{angle}": of(previous, angle) if k else NONE}
            found.append(relate(equation, level, segment.name, defined, given))
        previous = segment.name
    return found


def original_assembly(limb: Limb) -> Assembly:
    """The original form (2.56-2.65) with its interface to the muscles."""
    assembly = Assembly()
    for relation in [*original_relations(limb), *interface(limb, ORIGINAL)]:
        assembly.add(relation)
    return assembly


def original_relations(limb: Limb) -> list[Relation]:
    """Every segment as a free body."""
    relations: list[Relation] = []

    def add(owner: str, function: ScalarFunction, given: Given, defines: Term | None = None) -> None:
        item = equation_of(function)
        target = defines or of(owner, item.defines)[0]
        constants = dict.fromkeys(("mass", "inertia", "length", "com_distance", "gravity_x", "gravity_y"), NONE)
        relations.append(relate(item, ORIGINAL, owner, target, {**constants, **given}))

    names = [segment.name for segment in limb.segments]
    for k, name in enumerate(names):
        own = {
            variable: of(name, variable)
            for variable in ("segment_angle", "segment_velocity", "joint_torque", "joint_force_x", "joint_force_y")
        }
        following = names[k + 1] if k + 1 < len(names) else None
        angle, velocity = of(name, "segment_angle", order=1)[0], of(name, "segment_velocity", order=1)[0]
        add(name, original.segment_angle_rate, own, angle)
        if following is None:
            turning = {**own, **TIP_FORCE, "tip_torque": TIP_TORQUE}
            add(name, original.last_segment_velocity_rate, turning, velocity)
        else:
            carried = {
                f"next_{variable}": of(following, variable)
                for variable in ("joint_torque", "joint_force_x", "joint_force_y")
            }
            add(name, original.segment_velocity_rate, {**own, **carried}, velocity)
        for axis, speed, push, force, last_force, point in (
            (
                "x",
                original.com_velocity_x,
                original.com_acceleration_x,
                original.joint_force_x,
                original.last_joint_force_x,
                chain.point_x,
            ),
            (
                "y",
                original.com_velocity_y,
                original.com_acceleration_y,
                original.joint_force_y,
                original.last_joint_force_y,
                chain.point_y,
            ),
        ):
            rates = {
                f"{variable}_{axis}_rate": of(name, f"{variable}_{axis}", order=1)
                for variable in ("com_position", "com_velocity")
            }
            pulls = of(following, f"joint_force_{axis}") if following else NONE
            given = {
                f"com_acceleration_{axis}": of(name, f"com_acceleration_{axis}"),
                f"next_joint_force_{axis}": pulls,
                **TIP_FORCE,
            }
            add(name, speed, rates)
            add(name, push, rates)
            add(name, force if following else last_force, given)
            # 2.65 sums over the segments before; the chain of joint positions is put in below.
            place = {
                f"origin_{axis}": of(name, f"joint_position_{axis}") if k else NONE,
                "distance": NONE,
                "segment_angle": of(name, "segment_angle"),
            }
            add(name, point, place, of(name, f"com_position_{axis}")[0])
            if following:
                add(name, point, place, of(following, f"joint_position_{axis}")[0])
    return substitute(relations, ("joint_position_x", "joint_position_y"))


def transformed_relations(limb: Limb) -> list[Relation]:
    """Segment angles and velocities alone (3.10, 3.11), with A, M, F and G put into 3.11."""
    relations: list[Relation] = []

    def add(owner: str, function: ScalarFunction, given: Given, defines: Term) -> None:
        relations.append(relate(equation_of(function), TRANSFORMED, owner, defines, given))

    names = [segment.name for segment in limb.segments]
    for k, name in enumerate(names):
        angle = of(name, "segment_angle")
        add(
            name,
            transformed.segment_angle_rate,
            {"segment_velocity": of(name, "segment_velocity")},
            of(name, "segment_angle", order=1)[0],
        )
        torque = {"joint_torque": of(name, "joint_torque")}
        (net,) = of(name, "net_torque")
        if k + 1 < len(names):
            following = {"next_joint_torque": of(names[k + 1], "joint_torque")}
            add(name, transformed.net_torque, {**torque, **following}, net)
        else:
            add(name, transformed.last_net_torque, {**torque, "tip_torque": TIP_TORQUE}, net)
        directions = {"cosine": angle, "sine": angle}
        gravity = {"first_moment": NONE, "gravity_x": NONE, "gravity_y": NONE}
        add(name, chain.gravity_torque, {**gravity, **directions}, of(name, "gravity_torque")[0])
        tip = {"length": NONE, **TIP_FORCE, **directions}
        add(name, chain.tip_force_torque, tip, of(name, "tip_force_torque")[0])
        inertial, centrifugal = [], []
        for other in names:
            pair = f"{name}, {other}"
            both = (*angle, *of(other, "segment_angle")) if other != name else NONE
            coupling, motion, turn = of(pair, "inertia_coupling", "inertial_torque", "centrifugal_torque")
            given = {"coupling": NONE, "cosine": both}
            add(pair, chain.inertia_coupling, given, coupling)
            given = {"inertia_coupling": (coupling,), "segment_velocity_rate": of(other, "segment_velocity", order=1)}
            add(pair, transformed.inertial_torque, given, motion)
            inertial.append(motion)
            if other != name:
                given = {"coupling": NONE, "sine": both, "segment_velocity": of(other, "segment_velocity")}
                add(pair, chain.centrifugal_torque, given, turn)
                centrifugal.append(turn)
        row = {
            "net_torque": (net,),
            "gravity_torque": of(name, "gravity_torque"),
            "tip_force_torque": of(name, "tip_force_torque"),
            "inertial_torque": inertial,
            "centrifugal_torque": centrifugal,
        }
        add(name, transformed.torque_residual, row, of(name, "segment_velocity", order=1)[0])
    return substitute(relations, ABBREVIATIONS)
