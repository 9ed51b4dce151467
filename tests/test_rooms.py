"""Imports go one way: each folder of `limb_nodes` is a room, and a room imports only those that stand below it."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
EVERYWHERE = {"__version__", "errors"}
SCIENCE = {"foundation", "levels", "model", "solve", "bags", "signals"}
BELOW: dict[str, set[str]] = {
    "errors": set(),
    "foundation": set(),
    "levels": {"foundation"},
    "model": {"foundation", "levels"},
    "solve": {"foundation", "levels", "model"},
    # Bags know neither sections of YAML files nor declared parameters.
    "bags": {"foundation.arrays", "foundation.yaml_text"},
    "signals": {"foundation", "bags"},
    "analysis": SCIENCE,
    "exchange": SCIENCE,
    "nodes": {*SCIENCE, "exchange", "edge"},
    "commands": {*SCIENCE, "analysis", "exchange", "nodes"},
    "edge": set(),
    "cli": {"commands", "edge"},
}
WITH_ROS = {"nodes"}


def is_ros(module: str) -> bool:
    """Whether a module belongs to ROS: its client library, or a package of messages."""
    package = module.split(".")[0]
    return package.startswith(("rclpy", "rcl_", "ros2", "rosidl", "ament_")) or package.endswith(
        ("_msgs", "_interfaces")
    )


def imported(file: Path, text: str) -> Iterator[str]:
    """Every module that a file imports, within functions too, by its absolute name."""
    for item in ast.walk(ast.parse(text)):
        if isinstance(item, ast.Import):
            yield from (name.name for name in item.names)
        elif isinstance(item, ast.ImportFrom):
            package = ".".join(file.parts[: len(file.parts) - item.level]) if item.level else ""
            module = ".".join(filter(None, (package, item.module)))
            yield from (f"{module}.{name.name}" for name in item.names)


def violations(file: Path, text: str) -> list[str]:
    """The modules that a file imports and may not. file: its path from the root."""
    room = file.parts[1].removesuffix(".py")
    allowed = {f"limb_nodes.{name}" for name in BELOW.get(room, set()) | EVERYWHERE | {room}}
    return [
        module
        for module in imported(file, text)
        if (is_ros(module) and room not in WITH_ROS)
        or (f"{module}.".startswith("limb_nodes.") and not any(f"{module}.".startswith(f"{one}.") for one in allowed))
    ]


def test_every_room_imports_only_what_stands_below_it() -> None:
    files = sorted(path.relative_to(ROOT) for path in (ROOT / "limb_nodes").rglob("*.py"))
    wrong = {str(file): violations(file, (ROOT / file).read_text(encoding="utf-8")) for file in files}
    assert {file: modules for file, modules in wrong.items() if modules} == {}


def test_every_folder_is_a_room_and_contributing_names_it() -> None:
    table = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    for path in (ROOT / "limb_nodes").iterdir():
        if (path / "__init__.py").exists():
            assert path.name in BELOW
            assert f"{path.name}/`" in table


@pytest.mark.parametrize(
    ("file", "line", "module"),
    [
        ("bags/read.py", "from limb_nodes.signals.emg import envelopes", "limb_nodes.signals.emg.envelopes"),
        ("bags/read.py", "def f():\n    from limb_nodes import signals", "limb_nodes.signals"),
        ("bags/read.py", "from ..model import load_limb", "limb_nodes.model.load_limb"),
        ("bags/write.py", "from limb_nodes.foundation.section import Section", "limb_nodes.foundation.section.Section"),
        ("foundation/arrays.py", "import limb_nodes.levels.tangent", "limb_nodes.levels.tangent"),
        ("solve/whole.py", "from limb_nodes.bags.read import BagReader", "limb_nodes.bags.read.BagReader"),
        ("signals/emg.py", "from limb_nodes.model import load_limb", "limb_nodes.model.load_limb"),
        ("analysis/plot/series.py", "from limb_nodes.nodes.session import Run", "limb_nodes.nodes.session.Run"),
        ("analysis/record.py", "def f():\n    if True:\n        import rclpy.node", "rclpy.node"),
        ("commands/run.py", "from limb_msgs.msg import JointTorque", "limb_msgs.msg.JointTorque"),
        ("errors.py", "from limb_nodes.foundation.arrays import FloatArray", "limb_nodes.foundation.arrays.FloatArray"),
        ("a_new_room/file.py", "import limb_nodes.levels", "limb_nodes.levels"),
    ],
)
def test_what_leads_upwards_is_told(file: str, line: str, module: str) -> None:
    assert violations(Path("limb_nodes", file), line) == [module]


def test_what_leads_downwards_is_allowed() -> None:
    lines = "import numpy", "import rclpy", "from . import qos", "from limb_nodes.solve.whole import WholeModel"
    assert violations(Path("limb_nodes/nodes/base.py"), "\n".join(lines)) == []
