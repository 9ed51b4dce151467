"""Where muscles run, as lines in the plane, for those who draw a limb."""

from __future__ import annotations

import math
from collections.abc import Sequence

from limb_nodes.levels import UNIT_PROCESSES
from limb_nodes.levels.limb.chain import point_x, point_y
from limb_nodes.levels.muscle.path import PARAMETERS
from limb_nodes.model.kinds import UnitKind
from limb_nodes.model.layout import unit_values
from limb_nodes.model.limb import Limb, Muscle
from limb_nodes.model.points import point_names, points

Point = tuple[float, float]


def has_line(muscle: Muscle) -> bool:
    """Whether the muscle's path is one from origin over a pulley to insertion (2.43, 2.44)."""
    return {parameter.name for parameter in PARAMETERS} <= muscle.laws["path"].values.keys()


def muscle_lines(limb: Limb, angle: Sequence[float]) -> dict[str, list[Point]]:
    """Muscle -> origin, pulley and insertion (m) at joint angles (rad); muscles with other paths have no line.

    The line is as long as the muscle-tendon unit. Origin and insertion lie on the axes of the joint's two segments,
    the pulley at the moment arm from the joint, on the line that halves the angle between them.
    """
    joints = dict(zip(point_names(limb), points(limb, angle), strict=True))
    lines = {}
    for muscle in limb.muscles:
        if not has_line(muscle):
            continue
        path = muscle.laws["path"].values
        x, y = joints[limb.joint_names[muscle.joint]]
        turn = float(angle[muscle.joint])
        proximal = limb.base_angle + sum(angle[: muscle.joint])
        distal = proximal + turn
        middle = proximal + 0.5 * turn + muscle.role * 0.5 * math.pi
        ends = (
            (-path["proximal_distance"], proximal),
            (path["moment_arm"], middle),
            (path["distal_distance"], distal),
        )
        lines[muscle.name] = [(point_x(x, far, way), point_y(y, far, way)) for far, way in ends]
    return lines


def maximum_force(muscle: Muscle) -> float:
    """The sum of the greatest isometric active forces (N) of a muscle's motor units (2.19).

    NaN if a law of the user's own makes it depend on the state.
    """
    total = 0.0
    for unit in muscle.units:
        kind = UnitKind({name: unit.laws[name].law for name in UNIT_PROCESSES}, False)
        total += unit_values(unit, kind).get("maximum_fibre_force", math.nan)
    return total
