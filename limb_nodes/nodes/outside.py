"""What acts on a limb from outside, as messages of ROS: a load on its tip, and torques that a controller commands."""

from __future__ import annotations

import math

import numpy as np
from geometry_msgs.msg import WrenchStamped
from sensor_msgs.msg import JointState

from limb_nodes.exchange.forms import BASE
from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.model import Limb
from limb_nodes.solve.small import finite

# What may be left of a force or a torque out of the plane: of its size in the plane.
ROUNDING = 1e-9
# Greater forces (N) and torques (N m) are a mistake of units: they would tear any limb.
MOST = 1e6


def load_of(message: WrenchStamped, limb: Limb, angle: FloatArray, prefix: str) -> FloatArray:
    """Force x, y (N) and torque z (N m) on the tip, in the directions of the base.

    angle: of the joints now (rad): a load may be given in the directions of a segment. prefix: of the names of frames.
    Raises ValueError that says what is wrong with the message.
    """
    force, torque = message.wrench.force, message.wrench.torque
    values = np.array([force.x, force.y, torque.z])
    apart = {"force.z": force.z, "torque.x": torque.x, "torque.y": torque.y}
    if not finite(np.array([*values, *apart.values()])):
        raise ValueError("a force or torque is not finite")
    if np.abs(values).max() > MOST:
        raise ValueError(f"a force or torque is {np.abs(values).max():g}; {MOST:g} in N or N m at most is needed")
    for name, value in apart.items():
        if abs(value) > ROUNDING * float(np.linalg.norm(values)):
            raise ValueError(f"{name} is {value:g}; the limb moves in the plane x, y, and 0 is needed")
    turn = direction_of(message.header.frame_id, limb, angle, prefix)
    cos, sin = math.cos(turn), math.sin(turn)
    return np.array([cos * force.x - sin * force.y, sin * force.x + cos * force.y, torque.z])


def direction_of(frame: str, limb: Limb, angle: FloatArray, prefix: str) -> float:
    """The direction (rad) of a frame of the limb, of its base if it has no name. Raises ValueError."""
    name = frame.removeprefix(prefix)
    if name in ("", BASE):
        return 0.0
    segments = [segment.name for segment in limb.segments]
    if name not in segments:
        frames = ", ".join(f"{prefix}{one}" for one in (BASE, *segments))
        raise ValueError(f"frame_id is {frame[:80]}; one of {frames} is needed")
    return float(limb.base_angle + np.sum(angle[: segments.index(name) + 1]))


def command_of(message: JointState, limb: Limb) -> FloatArray:
    """The commanded torque on each joint [n] (N m), 0 for those that are not named. Raises ValueError."""
    joints = limb.joint_names
    if message.name and not message.effort:
        raise ValueError("has no efforts; a limb is commanded by torques alone, not by positions or velocities")
    if len(message.effort) != len(message.name) or not message.name:
        raise ValueError(f"has {len(message.name)} names and {len(message.effort)} efforts; as many are needed")
    values = np.zeros(len(joints))
    for place, (name, effort) in enumerate(zip(message.name, message.effort, strict=True)):
        if name not in joints:
            raise ValueError(f"names {name[:80]}; one of {', '.join(joints)} is needed")
        if name in message.name[:place]:
            raise ValueError(f"names {name} a second time; each joint once is needed")
        values[joints.index(name)] = effort
    if not finite(values):
        raise ValueError("an effort is not finite")
    if np.abs(values).max() > MOST:
        raise ValueError(f"an effort is {np.abs(values).max():g}; {MOST:g} N m at most is needed")
    return values
