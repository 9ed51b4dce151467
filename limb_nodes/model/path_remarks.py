"""What a person should know of the paths of a limb's muscles, although the limb can run."""

from __future__ import annotations

import math
import warnings
from itertools import pairwise

from limb_nodes.model.along_joint import along_joint
from limb_nodes.model.curve_checks import grid
from limb_nodes.model.limb import Limb, Muscle
from limb_nodes.model.probe import BrokenLaw
from limb_nodes.model.system import crossings_of

ANGLES = 40
# A share of the moment arm that is rounding.
ROUNDING = 1e-9


class LimbWarning(UserWarning):
    """A limb can run, but may not be what was meant."""


def warn_of_arms(limb: Limb) -> None:
    """Warn of polynomial paths whose moment arm on a joint changes its sign within the joint's range."""
    for muscle in limb.muscles:
        if muscle.laws["path"].law.name == "polynomial":
            for joint in muscle.joints:
                if (angle := sign_change(limb, muscle, joint)) is not None:
                    arm = f"the moment arm of {muscle.name} on {limb.joint_names[joint]}"
                    where = f"changes its sign at {angle:.3g} rad, the other joints as at the start"
                    warnings.warn(f"{limb.file}: {muscle.place}.path: {arm} {where}", LimbWarning, stacklevel=2)


def sign_change(limb: Limb, muscle: Muscle, joint: int) -> float | None:
    """The angle (rad) of a joint at which a muscle's moment arm on it is 0; None if it keeps its sign."""
    arms = [(angle, point["moment_arm"]) for angle, point in over_range(limb, muscle, joint) if point["moment_arm"]]
    for (near, before), (far, after) in pairwise(arms):
        if before * after < 0.0:
            return near + (far - near) * before / (before - after)
    return None


def over_range(limb: Limb, muscle: Muscle, joint: int) -> list[tuple[float, dict[str, float]]]:
    """A joint's angles over its range, and what a muscle's path is there at 1 rad/s."""
    low, high = limb.segments[joint].joint_range or (-math.pi, math.pi)
    # Without the ends: stretched out, a path may lie in its joint's axis.
    angles = grid(low, high, ANGLES)[1:-1]
    return list(zip(angles, along_joint(limb, muscle, joint, angles, speed=1.0), strict=True))


def unequal_work(limb: Limb) -> str:
    """In words, the muscles whose force does other work along their length than their torque on the joint; "" if none.

    Over the joint's range: by how much they shorten, as a share of what their moment arm says.
    """
    shares: dict[str, list[float]] = {}
    laws = set()
    for muscle in limb.muscles:
        law = muscle.laws["path"].law
        if crossings_of(law) != ("",):
            continue
        try:
            points = [point for _, point in over_range(limb, muscle, muscle.joints[0])]
        except BrokenLaw:
            continue
        pairs = [(point["muscle_tendon_velocity"], muscle.role * point["moment_arm"]) for point in points]
        found = [speed / arm for speed, arm in pairs if arm]
        if any(abs(share - 1.0) > ROUNDING for share in found):
            shares[muscle.name] = found
            laws.add(law.name)
    if not shares:
        return ""
    low, high = (f(share for found in shares.values() for share in found) for f in (min, max))
    return f"{', '.join(shares)}: shorten by {low:.2f} to {high:.2f} of their moment arm ({', '.join(sorted(laws))})"
