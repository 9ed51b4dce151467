"""The frames of a limb's segments as transforms, for those who have no robot_state_publisher."""

from __future__ import annotations

import math
from typing import Any

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Quaternion, Transform, TransformStamped, Vector3
from std_msgs.msg import Header

from limb_nodes.errors import UserError
from limb_nodes.exchange.forms import BASE
from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.model import Limb


def message_class() -> Any:
    """The type of `/tf`. Raises UserError if it is not installed: pip has no package of it."""
    try:
        from tf2_msgs.msg import TFMessage
    except ImportError:
        raise UserError(
            "limb_dynamics: the parameter publish_tf is true, which needs tf2_msgs, and that is not installed; "
            "a ROS 2 that has it is needed, or robot_state_publisher on another machine"
        ) from None
    return TFMessage


def transforms(limb: Limb, angle: FloatArray, stamp: Time, prefix: str) -> list[TransformStamped]:
    """Of each segment, from the one before it; as robot_state_publisher makes them of the robot description.

    angle: of the joints (rad). prefix: of the names of frames.
    """
    parent, (x, y), turn = BASE, limb.base_position, limb.base_angle
    found = []
    for segment, joint_angle in zip(limb.segments, angle.tolist(), strict=True):
        half = 0.5 * (turn + joint_angle)
        placed = Transform(translation=Vector3(x=x, y=y), rotation=Quaternion(z=math.sin(half), w=math.cos(half)))
        header = Header(stamp=stamp, frame_id=f"{prefix}{parent}")
        found.append(TransformStamped(header=header, child_frame_id=f"{prefix}{segment.name}", transform=placed))
        parent, (x, y), turn = segment.name, (segment.length, 0.0), 0.0
    return found
