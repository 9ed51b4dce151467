"""A limb as URDF, for RViz and robot_state_publisher."""

from __future__ import annotations

import math
from xml.etree import ElementTree as xml

from limb_nodes.model.limb import Limb, Segment

WIDTH = 0.04


def urdf(limb: Limb) -> str:
    """The robot description: one link per segment, revolute about z if the joint has a range."""
    robot = xml.Element("robot", name=limb.name)
    xml.SubElement(robot, "link", name="base")
    x, y = limb.base_position
    parent, origin = "base", (x, y, limb.base_angle)
    for segment in limb.segments:
        add_joint(robot, segment, parent, origin)
        add_link(robot, segment)
        parent, origin = segment.name, (segment.length, 0.0, 0.0)
    xml.indent(robot)
    return xml.tostring(robot, encoding="unicode")


def add_joint(robot: xml.Element, segment: Segment, parent: str, origin: tuple[float, float, float]) -> None:
    """The joint at a segment's proximal end; origin: x, y and direction in the parent."""
    kind = "revolute" if segment.joint_range else "continuous"
    joint = xml.SubElement(robot, "joint", name=segment.joint, type=kind)
    xml.SubElement(joint, "parent", link=parent)
    xml.SubElement(joint, "child", link=segment.name)
    xml.SubElement(joint, "origin", xyz=f"{origin[0]:g} {origin[1]:g} 0", rpy=f"0 0 {origin[2]:.17g}")
    xml.SubElement(joint, "axis", xyz="0 0 1")
    if segment.joint_range:
        low, high = segment.joint_range
        xml.SubElement(joint, "limit", lower=f"{low:g}", upper=f"{high:g}", effort="10000", velocity="1000")


def add_link(robot: xml.Element, segment: Segment) -> None:
    """A segment as a cylinder along x, with its inertia."""
    link = xml.SubElement(robot, "link", name=segment.name)
    visual = xml.SubElement(link, "visual")
    half = segment.length / 2
    xml.SubElement(visual, "origin", xyz=f"{half:g} 0 0", rpy=f"0 {math.pi / 2:.17g} 0")
    geometry = xml.SubElement(visual, "geometry")
    xml.SubElement(geometry, "cylinder", radius=f"{WIDTH / 2:g}", length=f"{segment.length:g}")
    inertial = xml.SubElement(link, "inertial")
    xml.SubElement(inertial, "origin", xyz=f"{segment.com_distance:g} 0 0")
    xml.SubElement(inertial, "mass", value=f"{segment.mass:g}")
    # The model moves in the plane only; the other two moments keep tools from refusing the link.
    moment = f"{segment.inertia:g}"
    xml.SubElement(inertial, "inertia", ixx=moment, iyy=moment, izz=moment, ixy="0", ixz="0", iyz="0")
