"""Bad input of `limb run`, `limb play` and of single nodes: one line, status 2, nothing written."""

from __future__ import annotations

import re
import signal
from pathlib import Path

import pytest
from rclpy.parameter_client import AsyncParameterClient

from limb_nodes import cli
from limb_nodes.bags.types import make_message
from limb_nodes.bags.write import BagWriter
from limb_nodes.nodes import session
from limb_nodes.nodes.running import run_node
from limb_nodes.nodes.session import CLASSES

pytestmark = pytest.mark.usefixtures("own_signals")

CSV = "time,flexor,extensor\n0,0.1,0.2\n0.5,{flexor},0.2\n1,0.3,0.2\n"
FILES = {
    "good.csv": CSV.format(flexor="0.5"),
    "nan.csv": CSV.format(flexor="nan"),
    "high.csv": CSV.format(flexor="1.5"),
    "negative.csv": CSV.format(flexor="-0.1"),
    "word.csv": CSV.format(flexor="much"),
    "lacks.csv": "time,flexor\n0,0.1\n1,0.2\n",
    "lacks.yaml": "muscles:\n  flexor: {wave: constant, value: 0.5}\n",
    "broken.yaml": "muscles: [",
    "empty.csv": "",
    "binary.csv": "\0\1\2",
}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The working folder with files of every kind in it."""
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    (tmp_path / "there").mkdir()
    monkeypatch.chdir(tmp_path)
    return tmp_path


def one_line(said: str, *parts: str) -> None:
    """Assert that one line of error is all that was said."""
    lines = said.strip().splitlines()
    assert len(lines) == 1, said
    assert lines[0].startswith("limb: error: "), said
    for part in parts:
        assert part in lines[0], said


@pytest.mark.parametrize(
    ("given", "parts"),
    [
        ({"limb": "absent.yaml"}, ["absent.yaml"]),
        ({"limb": "broken.yaml"}, ["broken.yaml"]),
        ({"limb": "there"}, ["there"]),
        ({"limb": "lacks.yaml"}, ["lacks.yaml"]),
        ({"--activation": "absent.csv"}, ["absent.csv"]),
        ({"--activation": None}, ["--activation"]),
        ({"--activation": "lacks.csv"}, ["lacks.csv", "extensor"]),
        ({"--activation": "lacks.yaml", "--duration": "1"}, ["lacks.yaml", "extensor"]),
        ({"--activation": "flexor=0.5", "--duration": "1"}, ["extensor"]),
        ({"--activation": "flexor=0.5,extensor=0"}, ["duration"]),
        ({"--activation": "nan.csv"}, ["nan.csv", "line 3", "flexor", "[0, 1]"]),
        ({"--activation": "high.csv"}, ["high.csv", "line 3", "flexor", "1.5", "[0, 1]"]),
        ({"--activation": "negative.csv"}, ["negative.csv", "-0.1"]),
        ({"--activation": "word.csv"}, ["word.csv", "much"]),
        ({"--activation": "empty.csv"}, ["empty.csv"]),
        ({"--activation": "binary.csv"}, ["binary.csv"]),
        ({"--activation": "there"}, ["there"]),
        ({"--duration": "2"}, ["good.csv", "2"]),
        ({"--duration": "0"}, ["--duration", "0"]),
        ({"--duration": "-1"}, ["--duration", "-1"]),
        ({"--duration": "nan"}, ["--duration", "nan"]),
        ({"--duration": "inf"}, ["duration", "inf"]),
        ({"--duration": "inf", "--activation": None, "--mode": "realtime"}, ["duration", "inf"]),
        ({"--duration": "0.00001"}, ["duration"]),
        ({"--duration": "0.00001", "--activation": None, "--mode": "realtime"}, ["duration"]),
        ({"--rate": "0"}, ["rate", "0"]),
        ({"--rate": "-5"}, ["rate", "-5"]),
        ({"--rate": "nan"}, ["rate", "nan"]),
        ({"--rate": "inf"}, ["rate", "inf"]),
        ({"--rate": "1e7"}, ["rate"]),
        ({"--rate": "fast"}, ["--rate", "fast"]),
        ({"--out": "there"}, ["there"]),
        ({"--out": "good.csv"}, ["good.csv"]),
        ({"--out": "good.csv/run"}, ["good.csv"]),
        ({"--mode": "slow"}, ["--mode", "slow", "lockstep", "realtime"]),
        ({"--namespace": "two words"}, ["--namespace", "two words"]),
        ({"--state-every": "0"}, ["--state-every", "0"]),
        ({"--state-every": "10000000"}, ["--state-every", "10000000"]),
    ],
    ids=str,
)
@pytest.mark.parametrize("processes", [False, True], ids=["one process", "processes"])
def test_limb_run_refuses(given, parts, processes, folder, limb, capfd):
    options = {"limb": limb, "--activation": "good.csv", "--out": "out", **given}
    arguments = ["run", options.pop("limb")]
    for name, value in options.items():
        arguments += [] if value is None else [f"{name}={value}"]
    before = sorted(folder.rglob("*"))
    try:
        status = cli.main([*arguments, *(["--processes"] if processes else [])])
    except SystemExit as end:  # argparse's own way out
        status = end.code
    assert status == 2
    one_line(capfd.readouterr().err, *parts)
    assert sorted(folder.rglob("*")) == before


GOOD = {
    "activation_input": {"source": "flexor=0.9,extensor=0", "duration": "1.0"},
    "muscle_stack": {},
    "limb_dynamics": {},
    "recorder": {"out": "out"},
}


@pytest.mark.parametrize("node", CLASSES)
@pytest.mark.parametrize(
    ("given", "parts"),
    [
        ({"limb": "''"}, ["limb"]),
        ({"limb": "absent.yaml"}, ["absent.yaml"]),
        ({"limb": "5"}, ["limb", "5"]),
        ({"mode": "slow"}, ["mode", "slow", "lockstep, realtime"]),
        ({"mode": "true"}, ["mode", "True"]),
        ({"identity": "mine"}, ["identity", "mine", "32 hexadecimal digits"]),
        ({"identity": "7"}, ["identity", "7"]),
        ({"rate": "0.0"}, ["rate", "0"]),
        ({"rate": "-1.0"}, ["rate", "-1"]),
        ({"rate": ".nan"}, ["rate", "nan"]),
        ({"rate": "1e9"}, ["rate"]),
        ({"rate": "fast"}, ["rate", "fast"]),
        ({"rate": "[1.0, 2.0]"}, ["rate"]),
    ],
    ids=str,
)
def test_each_node_refuses(node, given, parts, folder, limb, capfd):
    refuse(node, {**GOOD[node], **given}, parts, folder, limb, capfd)


@pytest.mark.parametrize(
    ("node", "given", "parts"),
    [
        ("activation_input", {"source": "''"}, ["source"]),
        ("activation_input", {"source": "absent.csv"}, ["absent.csv"]),
        ("activation_input", {"source": "lacks.yaml"}, ["extensor"]),
        ("activation_input", {"source": "nan.csv"}, ["nan.csv", "line 3"]),
        ("activation_input", {"duration": "-1.0"}, ["duration", "-1"]),
        ("activation_input", {"duration": ".nan"}, ["duration", "nan"]),
        ("activation_input", {"duration": ".nan", "source": "''", "mode": "realtime"}, ["duration", "nan"]),
        ("activation_input", {"duration": "0.00001", "source": "''", "mode": "realtime"}, ["duration"]),
        ("muscle_stack", {"state_every": "0"}, ["state_every", "0"]),
        ("muscle_stack", {"state_every": "1.5"}, ["state_every", "1.5"]),
        ("muscle_stack", {"publish_muscle_state": "3"}, ["publish_muscle_state", "3"]),
        ("limb_dynamics", {"await_recorder": "maybe"}, ["await_recorder", "maybe"]),
        ("recorder", {"out": "''"}, ["out"]),
        ("recorder", {"out": "there"}, ["there"]),
        ("recorder", {"out": "7"}, ["out", "7"]),
        # Typed for a node that does not have it; a file of parameters may be for all nodes.
        ("limb_dynamics", {"duration": "5.0"}, ["duration is a parameter of another node"]),
        ("activation_input", {"out": "x"}, ["out is a parameter of another node"]),
        ("recorder", {"durations": "5.0"}, ["durations is no parameter"]),
    ],
    ids=str,
)
def test_a_node_refuses_what_is_its_own(node, given, parts, folder, limb, capfd):
    refuse(node, {**GOOD[node], **given}, parts, folder, limb, capfd)


def refuse(node, given, parts, folder, limb, capfd):
    """Assert that a node ends at once with one line."""
    arguments = ["--ros-args"]
    for name, value in {"limb": limb, **given}.items():
        arguments += ["-p", f"{name}:={value}"]
    before = sorted(folder.rglob("*"))
    assert run_node(CLASSES[node], arguments) == 2
    one_line(capfd.readouterr().err, *parts)
    assert sorted(folder.rglob("*")) == before


def test_what_is_typed_wins_over_a_section_of_a_file(limb, processes, tmp_path, bench):
    """Wherever the node is, and in the form that ROS reads."""
    file = tmp_path / "all.yaml"
    file.write_text(
        f"/**:\n  ros__parameters: {{limb: {limb}, rate: 200.0, duration: 3.0}}\n"
        f"/**/recorder:\n  ros__parameters: {{out: {tmp_path / 'file'}, rate: 100.0}}\n"
    )
    graph = bench()
    typed = ["-p", f"out:={tmp_path / 'typed'}", "-p", "rate:=5e2", "-r", "__ns:=/left"]
    node = processes.start(
        "-m", "limb_nodes.nodes.recorder", "--ros-args", *typed, "--params-file", str(file), "-p", "priority:=0"
    )
    client = AsyncParameterClient(graph.probe, "/left/recorder")
    graph.until(client.services_are_ready, "the recorder")
    answer = client.get_parameters(["out", "rate"])
    graph.until(answer.done, "its parameters")
    out, rate = answer.result().values
    assert (out.string_value, rate.double_value) == (str(tmp_path / "typed"), 500.0)
    node.signal(signal.SIGTERM)
    assert node.wait() == 0


def test_a_node_that_waits_in_vain_gives_up_at_the_limit_that_it_was_given(limb, processes):
    node = processes.node("muscle_stack", limb=limb, stall_limit=1.0)
    assert node.wait() == 1
    assert "has waited 1 s for limb_state of tick 0 from limb_dynamics" in node.said


def test_a_whole_number_is_a_rate_too(bench, limb):
    """`-p rate:=200`, as a person types it."""
    assert bench().add(CLASSES["limb_dynamics"], limb=limb, rate=200).ticks.nanoseconds == 5_000_000


@pytest.mark.parametrize(
    ("options", "parts"),
    [
        (["absent"], ["absent"]),
        (["there"], ["there"]),
        (["good.csv"], ["good.csv"]),
        (["bag", "--topic=activation"], ["bag", "activation", "/emg_envelope"]),
        (["bag", "--topic=joint_states"], ["/joint_states", "sensor_msgs/msg/JointState", "EmgEnvelope"]),
        (["bag", "--rate-factor=0"], ["--rate-factor", "0"]),
        (["bag", "--rate-factor=-1"], ["--rate-factor", "-1"]),
        (["bag", "--rate-factor=nan"], ["--rate-factor", "nan"]),
        (["bag", "--rate-factor=x"], ["--rate-factor", "x"]),
        (["bag", "--wait=-1"], ["--wait", "-1"]),
        (["bag", "--wait=inf"], ["--wait", "inf"]),
        (["bag", "--namespace=1a"], ["--namespace", "1a"]),
        (["bag", "--wait=0.2"], ["nobody", "/emg_envelope", "0.2 s"]),
        (["bag", "--wait=0.2", "--namespace=left"], ["nobody", "/left/emg_envelope"]),
    ],
    ids=str,
)
def test_limb_play_refuses(options, parts, folder, capfd):
    with BagWriter(folder / "bag", {}) as bag:
        bag.write("emg_envelope", 0, make_message("limb_msgs/msg/MuscleActivation", 0, name=["a"], activation=[0.5]))
        bag.write("joint_states", 0, make_message("sensor_msgs/msg/JointState", 0))
    try:
        status = cli.main(["play", *options])
    except SystemExit as end:
        status = end.code
    assert status == 2
    one_line(capfd.readouterr().err, *parts)


def test_the_command_itself_ends_with_status_2(processes, limb, folder):
    """As a person starts it: no traceback of the interpreter's end either."""
    child = processes.limb("run", limb, "--activation", str(folder / "nan.csv"), "--out", str(folder / "out"))
    node = processes.node("recorder", limb=limb, out=folder / "there")
    assert (child.wait(), node.wait()) == (2, 2)
    one_line(child.said, "nan.csv")
    one_line(node.said, "there")
    assert child.printed == ""
    assert not (folder / "out").exists()


def test_help_names_every_option(capsys):
    for command in "run", "play":
        with pytest.raises(SystemExit) as end:
            cli.main([command, "--help"])
        assert end.value.code == 0
        assert len(re.findall(r"^  --\w+", capsys.readouterr().out, re.MULTILINE)) >= 5


def test_nodes_that_cannot_find_each_other(limb, tmp_path, monkeypatch, capfd):
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF")
    monkeypatch.setattr(session, "STARTING", 5.0)
    arguments = ["run", limb, "--activation", "flexor=0.5,extensor=0", "--duration", "1", "--processes"]
    assert cli.main([*arguments, "--out", str(tmp_path / "run")]) == 2
    one_line(capfd.readouterr().err, "5 s", *CLASSES, "ROS_AUTOMATIC_DISCOVERY_RANGE")
