"""Where muscles run, as lines in the plane, for those who draw a limb."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from limb_nodes.levels import UNIT_PROCESSES
from limb_nodes.levels.limb.chain import point_x, point_y
from limb_nodes.levels.muscle.path import PARAMETERS
from limb_nodes.model.kinds import UnitKind
from limb_nodes.model.layout import unit_values
from limb_nodes.model.limb import Limb, Muscle
from limb_nodes.model.points import point_names, points

Point = tuple[float, float]


def has_line(muscle: Muscle) -> bool:
    """Whether the muscle's path is drawn: from origin over a pulley to insertion (2.43, 2.44), or through points."""
    values = muscle.laws["path"].values.keys()
    return {parameter.name for parameter in PARAMETERS} <= values or "segment_0" in values


def muscle_lines(limb: Limb, angle: Sequence[float]) -> dict[str, list[Point]]:
    """Muscle -> points of its line (m) at joint angles (rad); muscles with other paths have no line.

    The line is as long as the muscle-tendon unit. Between straight lines they are the points of the path; else origin
    and insertion, on the axes of the joint's two segments, and the pulley at the moment arm from the joint, on the line
    that halves the angle between them.
    """
    places = dict(zip(point_names(limb), points(limb, angle), strict=True))
    # Where each segment begins and in which direction it runs, the base first.
    starts = [limb.base_position, *(places[name] for name in limb.joint_names)]
    directions = [limb.base_angle + sum(map(float, angle[:count])) for count in range(len(limb.segments) + 1)]
    lines = {}
    for muscle in filter(has_line, limb.muscles):
        path = muscle.laws["path"].values
        if "segment_0" in path:
            lines[muscle.name] = points_of(path, starts, directions)
            continue
        joint = muscle.joints[0]
        x, y = starts[joint + 1]
        middle = directions[joint] + 0.5 * float(angle[joint]) + muscle.role * 0.5 * math.pi
        ends = (
            (-path["proximal_distance"], directions[joint]),
            (path["moment_arm"], middle),
            (path["distal_distance"], directions[joint + 1]),
        )
        lines[muscle.name] = [(point_x(x, far, way), point_y(y, far, way)) for far, way in ends]
    return lines


def points_of(path: Mapping[str, float], starts: Sequence[Point], directions: Sequence[float]) -> list[Point]:
    """The points of a path of straight lines. starts, directions: of the base and the segments (m, rad)."""
    found = []
    for number in range(sum(name.startswith("x_") for name in path)):
        segment = int(path[f"segment_{number}"])
        x, y = starts[segment]
        for far, way in ((path[f"x_{number}"], 0.0), (path[f"y_{number}"], 0.5 * math.pi)):
            x, y = point_x(x, far, directions[segment] + way), point_y(y, far, directions[segment] + way)
        found.append((x, y))
    return found


def maximum_force(muscle: Muscle) -> float:
    """The sum of the greatest isometric active forces (N) of a muscle's motor units (2.19).

    NaN if a law of the user's own makes it depend on the state.
    """
    total = 0.0
    for unit in muscle.units:
        kind = UnitKind({name: unit.laws[name].law for name in UNIT_PROCESSES}, False)
        total += unit_values(unit, kind).get("maximum_fibre_force", math.nan)
    return total
