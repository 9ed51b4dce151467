"""What those see who look at a limb: muscles as lines, frames of segments, layouts for Foxglove and PlotJuggler."""

from __future__ import annotations

import importlib
import json
import math
import re
from pathlib import Path
from xml.etree import ElementTree as xml

import numpy as np
import pytest
from std_msgs.msg import Header
from visualization_msgs.msg import Marker, MarkerArray

from limb_nodes.errors import UserError
from limb_nodes.foundation.topics import TOPIC_TYPES
from limb_nodes.model import load_limb
from limb_nodes.model.lines import maximum_force, muscle_lines
from limb_nodes.model.points import point_names, points
from limb_nodes.nodes.activation_input import ActivationInput
from limb_nodes.nodes.limb_dynamics import LimbDynamics
from limb_nodes.nodes.markers import COLOURINGS, Markers
from limb_nodes.nodes.messages import stamp_at
from limb_nodes.nodes.muscle_stack import MuscleStack
from limb_nodes.nodes.qos import LIVE
from limb_nodes.nodes.recorder import Recorder
from limb_nodes.nodes.transforms import transforms
from limb_nodes.solve.outputs import LENGTHS, MUSCLE_OUTPUTS
from limb_nodes.solve.ranges import limits

PARAMS = Path(__file__).resolve().parents[2] / "params"
RATE = 500.0


@pytest.fixture(scope="module")
def arm():
    return load_limb(PARAMS / "arm.yaml")


def outputs_of(limb, **given) -> np.ndarray:
    """What muscles show, all within their ranges: rows of zeros but for lengths and what is given."""
    shown = np.zeros((len(limb.muscles), len(MUSCLE_OUTPUTS)))
    for row, muscle in zip(shown, limb.muscles, strict=True):
        for name, (low, high) in zip(LENGTHS, limits(muscle), strict=True):
            row[MUSCLE_OUTPUTS.index(name)] = low + 0.5 * (min(high, low + 1.0) - low)
        for name, value in given.items():
            row[MUSCLE_OUTPUTS.index(name)] = value
    return shown


def colours(array: MarkerArray) -> list[tuple[float, ...]]:
    return [(marker.color.r, marker.color.g, marker.color.b) for marker in array.markers]


@pytest.mark.parametrize("colouring", COLOURINGS)
def test_more_is_redder(colouring, arm):
    drawn = Markers(arm, colouring)
    angle = np.array([0.3, 0.8])
    name = {"force": "muscle_force", "activation": "activation"}[colouring]
    most = min(maximum_force(muscle) for muscle in arm.muscles) if colouring == "force" else 1.0
    seen = [
        colours(drawn.message(Header(), angle, outputs_of(arm, **{name: share * most})))[0]
        for share in (0.0, 0.1, 0.5, 1.0)
    ]
    reds, blues = [colour[0] for colour in seen], [colour[2] for colour in seen]
    assert reds == sorted(set(reds))
    assert blues == sorted(set(blues), reverse=True)
    other = {"force": "activation", "activation": "muscle_force"}[colouring]
    assert colours(drawn.message(Header(), angle, outputs_of(arm, **{other: 1.0})))[0] == seen[0]


@pytest.mark.parametrize("length", LENGTHS)
def test_a_muscle_out_of_its_range_is_seen(length, arm):
    drawn, angle = Markers(arm, "force"), np.array([0.3, 0.8])
    shown = outputs_of(arm)
    within = drawn.message(Header(), angle, shown).markers
    shown[1, MUSCLE_OUTPUTS.index(length)] = -0.001
    outside = drawn.message(Header(), angle, shown).markers
    changed = [old.color != new.color and new.scale.x > old.scale.x for old, new in zip(within, outside, strict=True)]
    assert changed == [number == 1 for number in range(len(arm.muscles))]


def test_muscles_are_lines_where_they_are(bench, tmp_path, bags, limb, waves, reference):
    """And a run that is looked at is the same as one that is not."""
    graph = bench("left")
    heard = graph.listen(MarkerArray, "muscle_markers", LIVE)
    common = {"limb": limb, "rate": 1000.0}
    stack = graph.add(MuscleStack, **common)
    graph.add(LimbDynamics, await_recorder=True, **common)
    graph.until(lambda: stack.count_subscribers("muscle_markers"), "the one who looks")
    graph.add(ActivationInput, source=waves, duration=0.5, **common)
    recorder = graph.add(Recorder, out=str(tmp_path / "run"), **common)
    graph.until(lambda: recorder.finished and heard, "the end")
    graph.finish(recorder)
    assert bags.differences(reference, tmp_path / "run") == []
    table = bags.decoded(tmp_path / "run", ("movement_pattern",))["movement_pattern"]
    for array in heard:
        stamp = array.markers[0].header.stamp
        tick = round((stamp.sec + stamp.nanosec * 1e-9) * 1000.0)
        lines = muscle_lines(stack.limb, table["angle"][tick])
        assert [marker.ns for marker in array.markers] == list(lines)
        for marker, line in zip(array.markers, lines.values(), strict=True):
            assert (marker.type, marker.header.frame_id) == (Marker.LINE_STRIP, "left/base")
            np.testing.assert_allclose([(point.x, point.y) for point in marker.points], line, atol=1e-12)
            assert [point.z for point in marker.points] == [0.0] * 3
            assert marker.color.a == 1.0


def test_the_frames_are_the_segments(arm):
    from limb_nodes.exchange.ticks import Ticks

    angle = np.array([0.4, -0.9])
    x = y = turn = 0.0
    places = dict(zip(point_names(arm), points(arm, angle.tolist()), strict=True))
    parent = "left/base"
    for segment, transform in zip(
        arm.segments, transforms(arm, angle, stamp_at(25, Ticks(RATE)), "left/"), strict=True
    ):
        assert (transform.header.frame_id, transform.child_frame_id) == (parent, f"left/{segment.name}")
        assert (transform.header.stamp.sec, transform.header.stamp.nanosec) == (0, 50_000_000)
        moved, turned = transform.transform.translation, transform.transform.rotation
        x += moved.x * math.cos(turn) - moved.y * math.sin(turn)
        y += moved.x * math.sin(turn) + moved.y * math.cos(turn)
        turn += 2.0 * math.atan2(turned.z, turned.w)
        assert (x, y) == pytest.approx(places[segment.joint], abs=1e-12)
        parent = transform.child_frame_id
    assert turn == pytest.approx(arm.base_angle + angle.sum())


def has_tf2() -> bool:
    return importlib.util.find_spec("tf2_msgs") is not None


@pytest.mark.skipif(has_tf2(), reason="tf2_msgs is installed")
def test_frames_need_the_messages_of_tf2(bench, limb):
    with pytest.raises(UserError, match="publish_tf is true, which needs tf2_msgs, and that is not installed"):
        bench().add(LimbDynamics, limb=limb, publish_tf=True)


@pytest.mark.skipif(not has_tf2(), reason="tf2_msgs is not installed")
def test_frames_are_published_on_request(bench, limb):
    from tf2_msgs.msg import TFMessage

    graph = bench()
    heard = graph.listen(TFMessage, "/tf", LIVE)
    node = graph.add(LimbDynamics, limb=limb, publish_tf=True)
    graph.until(lambda: heard, "the frames")
    assert [one.child_frame_id for one in heard[0].transforms] == [segment.name for segment in node.limb.segments]


# Topics that only those who look at a limb subscribe.
LOOKED_AT = {"muscle_markers": "visualization_msgs/msg/MarkerArray"}


def fields_of(topic: str) -> dict[str, str]:
    """The fields of a topic's messages, and their types."""
    name = topic if topic in TOPIC_TYPES else topic.removeprefix("/")
    package, folder, kind = {**TOPIC_TYPES, **LOOKED_AT}[name].split("/")
    return getattr(importlib.import_module(f"{package}.{folder}"), kind).get_fields_and_field_types()


def test_the_layout_for_foxglove_shows_topics_that_there_are():
    layout = json.loads((PARAMS / "layouts" / "foxglove.json").read_text())
    panels = layout["configById"]
    for panel in panels.values():
        for topic in (*panel.get("topics", ()), *(layer["topic"] for layer in panel.get("layers", {}).values())):
            assert fields_of(topic)
        if "topicToRender" in panel:
            assert fields_of(panel["topicToRender"])
        for path in panel.get("paths", ()):
            topic, field = re.fullmatch(r"(/\w+)\.(\w+)\[:\]", path["value"]).groups()
            assert fields_of(topic)[field].startswith("sequence<double"), path["value"]
    placed = re.findall(r'"(?:first|second)": "([^"]+)"', json.dumps(layout["layout"]))
    assert sorted(placed) == sorted(panels)


def test_the_layout_for_plotjuggler_shows_numbers_that_the_knee_has():
    limb = load_limb(PARAMS / "seated_knee.yaml")
    curves = [curve.get("name") for curve in xml.parse(PARAMS / "layouts" / "plotjuggler.xml").iter("curve")]
    assert len(curves) == len(set(curves)) > 10
    for curve in curves:
        if match := re.fullmatch(r"/joint_states/(\w+)/(position|velocity|effort)", curve):
            assert match[1] in limb.joint_names
        else:
            topic, field, number = re.fullmatch(r"(/\w+)/(\w+)\[(\d+)\]", curve).groups()
            assert fields_of(topic)[field].startswith("sequence<double"), curve
            assert int(number) < len(limb.muscles)
