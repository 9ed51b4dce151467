"""The robot description is URDF that has the limb's joints."""

from __future__ import annotations

import math
from pathlib import Path
from xml.etree import ElementTree as xml

import pytest
from std_msgs.msg import String

from limb_nodes.model import load_limb
from limb_nodes.model.urdf import urdf
from limb_nodes.nodes.limb_dynamics import LimbDynamics
from limb_nodes.nodes.qos import LATCHED

PARAMS = Path(__file__).resolve().parents[2] / "params"
LIMBS = [path for path in sorted(PARAMS.glob("*.yaml")) if "\nsegments:" in path.read_text()]


@pytest.mark.parametrize("path", LIMBS, ids=lambda path: path.stem)
def test_joints_and_links_are_the_limb_s(path):
    limb = load_limb(path)
    robot = xml.fromstring(urdf(limb))
    assert (robot.tag, robot.get("name")) == ("robot", limb.name)
    links = [link.get("name") for link in robot.findall("link")]
    assert links == ["base", *(segment.name for segment in limb.segments)]
    joints = robot.findall("joint")
    assert [joint.get("name") for joint in joints] == limb.joint_names
    x = 0.0
    for joint, segment, parent in zip(joints, limb.segments, links, strict=False):
        assert joint.find("parent").get("link") == parent
        assert joint.find("child").get("link") == segment.name
        assert joint.find("axis").get("xyz") == "0 0 1"
        if parent != "base":
            assert float(joint.find("origin").get("xyz").split()[0]) == pytest.approx(x)
        x = segment.length
        if segment.joint_range:
            limit = joint.find("limit")
            given = float(limit.get("lower")), float(limit.get("upper"))
            assert given == pytest.approx(segment.joint_range, abs=1e-5)
        assert joint.get("type") == ("revolute" if segment.joint_range else "continuous")
    for segment in limb.segments:
        (link,) = (link for link in robot.findall("link") if link.get("name") == segment.name)
        assert float(link.find("inertial/mass").get("value")) == pytest.approx(segment.mass, rel=1e-5)
    assert float(joints[0].find("origin").get("rpy").split()[2]) == pytest.approx(limb.base_angle)
    assert math.isfinite(limb.base_angle)


def test_a_late_listener_gets_it(bench, limb):
    graph = bench()
    node = graph.add(LimbDynamics, limb=limb, await_recorder=True)
    heard = graph.listen(String, "robot_description", LATCHED)
    graph.until(lambda: heard, "the robot description")
    assert heard[0].data == urdf(node.limb)
