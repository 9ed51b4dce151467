"""Draws docs/images/muscles.png: `muscle_markers` while a seated man tightens all muscles of the knee.

python -m docs.pictures
"""

from __future__ import annotations

import os
import tempfile
import time
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import rclpy
from matplotlib.axes import Axes
from rclpy.context import Context
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions
from visualization_msgs.msg import MarkerArray

from limb_nodes.model.points import point_names, points
from limb_nodes.nodes.distribution import make_executor
from limb_nodes.nodes.qos import LIVE
from limb_nodes.nodes.session import CLASSES

ROOT = Path(__file__).resolve().parents[1]
# Strong enough for colours.
SOURCE = "RF=0.35,VM=0.5,BF=0.6,ST=0.85"
MOMENTS = (0.0, 0.1, 0.2, 0.8)
DURATION = 2.0


def main() -> None:
    """Run the knee in real time, listen, draw."""
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF")
    context = Context()
    with tempfile.TemporaryDirectory() as folder:
        os.environ.setdefault("ROS_LOG_DIR", folder)
        rclpy.init(context=context, signal_handler_options=SignalHandlerOptions.NO)
        common = {"limb": str(ROOT / "params/seated_knee.yaml"), "mode": "realtime", "rate": 500.0}
        own: dict[str, dict[str, Any]] = {"activation_input": {"source": SOURCE, "duration": DURATION}}
        executor = make_executor(context)
        seen: list[tuple[float, MarkerArray]] = []
        nodes: dict[str, Any] = {}

        def look(array: MarkerArray) -> None:
            seen.append((float(nodes["limb_dynamics"].part.stepper.angle[0]), array))

        listener = rclpy.create_node("listener", context=context)
        listener.create_subscription(MarkerArray, "muscle_markers", look, LIVE)
        executor.add_node(listener)
        for name in ("limb_dynamics", "muscle_stack", "activation_input"):
            given = {**common, **own.get(name, {})}
            nodes[name] = CLASSES[name](
                context=context, parameter_overrides=[Parameter(key, value=value) for key, value in given.items()]
            )
            executor.add_node(nodes[name])
        end = time.monotonic() + 60.0
        while not nodes["limb_dynamics"].finished and time.monotonic() < end:
            executor.spin_once(timeout_sec=0.05)
        draw(nodes["limb_dynamics"].limb, seen)
        for node in (listener, *nodes.values()):
            executor.remove_node(node)
            node.destroy_node()
        rclpy.shutdown(context=context)


def second(array: MarkerArray) -> float:
    stamp = array.markers[0].header.stamp
    return float(stamp.sec + 1e-9 * stamp.nanosec)


def draw(limb: Any, seen: list[tuple[float, MarkerArray]]) -> None:
    """Some moments side by side."""
    figure, axes = plt.subplots(1, len(MOMENTS), figsize=(10.0, 2.5), sharey=True, layout="constrained")
    for axis, moment in zip(axes, MOMENTS, strict=True):
        angle, array = min(seen, key=lambda one: abs(second(one[1]) - moment))
        draw_one(axis, limb, angle, array)
        axis.set_title(f"{second(array):.2f} s")
    axes[0].set_ylabel("y (m)")
    figure.savefig(ROOT / "docs" / "images" / "muscles.png", dpi=130)


def draw_one(axis: Axes, limb: Any, angle: float, array: MarkerArray) -> None:
    """Segments in grey, muscles in the colours of their markers."""
    places = dict(zip(point_names(limb), points(limb, [angle]), strict=True))
    (joint,) = limb.joint_names
    ends = [places[joint], places["tip"]]
    axis.plot([0.45, 0.0], [0.0, 0.0], color="#C8C8C8", linewidth=9, solid_capstyle="round")
    axis.plot(*zip(*ends, strict=True), color="#C8C8C8", linewidth=9, solid_capstyle="round")
    for marker in array.markers:
        colour = (marker.color.r, marker.color.g, marker.color.b)
        axis.plot(
            [point.x for point in marker.points],
            [point.y for point in marker.points],
            color=colour,
            linewidth=marker.scale.x * 300.0,
        )
    axis.set(aspect="equal", xlim=(-0.56, 0.5), ylim=(-0.56, 0.1), xlabel="x (m)")
    axis.spines[["top", "right"]].set_visible(False)


if __name__ == "__main__":
    main()
