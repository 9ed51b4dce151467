"""Positions of the joints, centres of mass and tip of a limb (2.65)."""

from __future__ import annotations

from collections.abc import Sequence

from limb_nodes.levels.limb.chain import point_x, point_y
from limb_nodes.model.limb import Limb


def point_names(limb: Limb) -> list[str]:
    """Names of the points: of each segment its joint and `NAME.com`, then `tip`."""
    return [name for s in limb.segments for name in (s.joint, f"{s.name}.com")] + ["tip"]


def points(limb: Limb, angle: Sequence[float]) -> list[tuple[float, float]]:
    """Positions (m) of the points at joint angles (rad), in the order of `point_names`."""
    x, y = limb.base_position
    direction = limb.base_angle
    positions = []
    for segment, turn in zip(limb.segments, angle, strict=True):
        direction += float(turn)
        distance = segment.com_distance
        positions += [(x, y), (point_x(x, distance, direction), point_y(y, distance, direction))]
        x, y = point_x(x, segment.length, direction), point_y(y, segment.length, direction)
    return [*positions, (x, y)]
