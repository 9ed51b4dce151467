"""A muscle's path seen along one of the joints that it crosses, the others as at the start."""

from __future__ import annotations

from collections.abc import Iterable

from limb_nodes.model.limb import Limb, Muscle
from limb_nodes.model.probe import Probe, given
from limb_nodes.model.system import crossings_of


def along_joint(
    limb: Limb, muscle: Muscle, joint: int, angles: Iterable[float], speed: float = 0.0
) -> list[dict[str, float]]:
    """What the path is at angles (rad) of a joint that turns at a speed (rad/s), by variable.

    Of the variables that there are for each joint, `moment_arm` is that of this one. Raises BrokenLaw.
    """
    chosen = muscle.laws["path"]
    endings = dict(zip(muscle.joints, crossings_of(chosen.law), strict=True))
    probe = Probe(chosen, given(chosen), {"role": muscle.role})
    still: dict[str, float] = {}
    for crossed, ending in endings.items():
        still |= {f"joint_angle{ending}": limb.segments[crossed].angle, f"joint_velocity{ending}": 0.0}
    own = endings[joint]
    turning = still | {f"joint_velocity{own}": speed}
    points = (probe.at(**{**turning, f"joint_angle{own}": float(angle)}) for angle in angles)
    return [{**point, "moment_arm": point[f"moment_arm{own}"]} for point in points]
