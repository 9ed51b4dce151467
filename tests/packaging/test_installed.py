"""What an installation brings: messages, nodes where `ros2 run` looks for them, parameters."""

from __future__ import annotations

import importlib
import os
import re
import sys
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numpy as np
import pytest

import limb_nodes
from limb_nodes.bags.read import BagReader
from limb_nodes.bags.types import limb_typestore
from limb_nodes.bags.write import BagWriter
from limb_nodes.foundation.topics import TOPIC_TYPES

ROOT = Path(__file__).resolve().parents[2]
NODES = re.findall(r"\w+", re.search(r"foreach\(node (.*)\)", (ROOT / "limb_nodes/install.cmake").read_text())[1])  # type: ignore[index]
TYPES = sorted({name for name in TOPIC_TYPES.values() if name.startswith("limb_msgs/")})


def test_the_versions_agree() -> None:
    for package in "msgs", "limb_nodes":
        assert f"<version>{limb_nodes.__version__}</version>" in (ROOT / package / "package.xml").read_text()


@pytest.mark.parametrize("node", NODES)
def test_each_node_is_a_module_with_main(node: str) -> None:
    assert callable(importlib.import_module(f"limb_nodes.nodes.{node}").main)


def test_every_message_is_built_and_every_field_has_a_comment_or_a_name() -> None:
    listed = set(re.findall(r'"msg/(\w+)\.msg"', (ROOT / "msgs/CMakeLists.txt").read_text()))
    files = {path.stem for path in (ROOT / "msgs/msg").glob("*.msg")}
    assert listed == files == {name.split("/")[-1] for name in TYPES}
    for path in (ROOT / "msgs/msg").glob("*.msg"):
        for line in path.read_text().splitlines():
            assert line.startswith("float64") <= ("#" in line), f"{path.name}: {line}: without unit"


class TestPrefix:
    """The installed prefix; skipped in an environment that the project is not installed in."""

    @pytest.fixture(autouse=True)
    def installed(self) -> None:
        try:
            version("limb-nodes")
        except PackageNotFoundError:
            pytest.skip("limb-nodes is not installed in this environment")

    @pytest.mark.parametrize("node", NODES)
    def test_ros2_run_finds_the_node(self, node: str) -> None:
        """`ros2 run` takes an executable file of lib/<package>, in a prefix whose index names the package."""
        file = Path(sys.prefix, "lib", "limb_nodes", node)
        assert os.access(file, os.X_OK)
        for package in "limb_nodes", "limb_msgs":
            assert Path(sys.prefix, "share", "ament_index", "resource_index", "packages", package).exists()
            assert Path(sys.prefix, "share", package, "package.xml").exists()

    def test_the_wheel_has_no_tests(self) -> None:
        from importlib.metadata import files

        names = [str(name) for name in files("limb-nodes") or []]
        assert names
        assert [name for name in names if "test" in name.lower()] == []

    @pytest.mark.parametrize("msgtype", TYPES)
    def test_messages_of_ros_can_be_recorded_and_read(self, msgtype: str, tmp_path: Path) -> None:
        """Bytes from ROS's own serialisation, values from ours."""
        import importlib

        from geometry_msgs.msg import Point
        from rclpy.serialization import serialize_message

        kind = getattr(importlib.import_module("limb_msgs.msg"), msgtype.split("/")[-1])
        with BagWriter(tmp_path / "run", {}) as bag:
            for k in range(5):
                types = kind.get_fields_and_field_types()
                ticked = {"tick": k} if "tick" in types else {}
                message = kind(**ticked)
                if "header" in types:
                    message.header.stamp.nanosec = k
                for field, type_name in types.items():
                    if type_name in ("sequence<double>", "double[3]"):
                        setattr(message, field, [0.1 * k, -1.0, 2.0])
                    elif type_name == "sequence<string>":
                        setattr(message, field, ["a", "bcd", "ef"])
                    elif type_name == "sequence<geometry_msgs/Point>":
                        setattr(message, field, [Point(x=0.1 * k, y=-1.0, z=2.0)])
                bag.write_raw("topic", k, serialize_message(message), msgtype)
                empty = kind(**ticked)
                bag.write_raw("empty", k, serialize_message(empty), msgtype)
        with BagReader(tmp_path / "run") as reader:
            table = reader.table("topic")
            assert len(reader.table("empty")["time"]) == 5
            rows = [message for _, message in reader.read_topic("topic")]
        for name, (_, detail) in limb_typestore().fielddefs[msgtype][1]:
            if name == "tick":
                assert table[name].tolist() == [0, 1, 2, 3, 4]
            elif name == "position":
                np.testing.assert_array_equal(table[name][:, 0], [[0.1 * k, -1.0, 2.0] for k in range(5)])
            elif isinstance(detail[0], tuple) and detail[0][1] == ("string", 0):
                assert list(table[name]) == ["a", "bcd", "ef"]
            elif isinstance(detail[0], tuple) and detail[0][1][0] == "float64":
                np.testing.assert_array_equal(table[name], [[0.1 * k, -1.0, 2.0] for k in range(5)])
                np.testing.assert_array_equal(table[name], [getattr(row, name) for row in rows])
