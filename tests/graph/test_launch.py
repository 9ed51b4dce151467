"""The launch files, where ROS 2's launch is installed; pip does not bring it."""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("launch_ros", reason="launch is not installed")

ROOT = Path(__file__).resolve().parents[2]
LAUNCH = """
import sys
from launch import LaunchDescription, LaunchService
from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource

source = PythonLaunchDescriptionSource(sys.argv[1])
given = [tuple(argument.split(":=")) for argument in sys.argv[2:]]
service = LaunchService()
service.include_launch_description(LaunchDescription([IncludeLaunchDescription(source, launch_arguments=given)]))
sys.exit(service.run())
"""
PARAMETERS = """
/**:
  ros__parameters: {{limb: {limb}, rate: 500.0}}
/**/activation_input:
  ros__parameters: {{source: "flexor=0.9,extensor=0", duration: 0.5}}
/**/limb_dynamics:
  ros__parameters: {{await_recorder: true}}
/**/recorder:
  ros__parameters: {{out: {out}}}
"""


@pytest.fixture(autouse=True)
def _prefix(monkeypatch):
    """The nodes are found as `ros2 run` finds them."""
    monkeypatch.setenv("AMENT_PREFIX_PATH", os.pathsep.join([sys.prefix, os.environ.get("AMENT_PREFIX_PATH", "")]))


def parameters(folder: Path, name: str, limb: str) -> str:
    file = folder / f"{name}.yaml"
    file.write_text(PARAMETERS.format(limb=limb, out=folder / name))
    return str(file)


def test_one_limb(limb, processes, bags, tmp_path):
    file = parameters(tmp_path, "run", limb)
    child = processes.start("-c", LAUNCH, str(ROOT / "limb_nodes/launch/limb.launch.py"), f"params_file:={file}")
    assert child.wait() == 0, child.all_said
    bags.complete(tmp_path / "run", 251, 2_000_000)


def test_a_node_that_fails_ends_the_others_and_is_named(limb, processes, tmp_path):
    file = Path(parameters(tmp_path, "run", limb))
    file.write_text(file.read_text().replace("flexor=0.9", "flexor=9"))
    child = processes.start("-c", LAUNCH, str(ROOT / "limb_nodes/launch/limb.launch.py"), f"params_file:={file}")
    assert child.wait() in (0, 1), child.all_said
    assert "activation_input-1 ended with status 2; the other nodes end, too" in child.printed + child.all_said


def test_two_limbs(limb, processes, bags, tmp_path):
    files = [f"{side}_params_file:={parameters(tmp_path, side, limb)}" for side in ("left", "right")]
    child = processes.start("-c", LAUNCH, str(ROOT / "limb_nodes/launch/two_limbs.launch.py"), *files)
    assert child.wait() == 0, child.all_said
    found = [bags.decoded(tmp_path / side, ("movement_pattern",))["movement_pattern"] for side in ("left", "right")]
    np.testing.assert_array_equal(found[0]["angle"], found[1]["angle"])
    assert found[0]["run"].item() != found[1]["run"].item()


def test_the_shipped_parameters_start_a_run(processes, bags, tmp_path):
    """Those of params/nodes/knee.yaml, from a folder that holds params/."""
    (tmp_path / "here").mkdir()
    shutil.copytree(ROOT / "params", tmp_path / "here" / "params")
    script = f"import os; os.chdir({str(tmp_path / 'here')!r})\n{LAUNCH}"
    launch = str(ROOT / "limb_nodes/launch/limb.launch.py")
    child = processes.start("-c", script, launch, "params_file:=params/nodes/knee.yaml")
    assert child.wait() == 0, child.all_said
    table = bags.decoded(tmp_path / "here" / "knee_run", ("movement_pattern",))["movement_pattern"]
    assert len(table["tick"]) == 401
