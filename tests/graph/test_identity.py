"""Of two runs in one namespace the later gives way, and the one in place takes nothing from it."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from limb_msgs.msg import Claim, JointTorque, LimbState, MuscleActivation, Recorded
from std_msgs.msg import Header

from limb_nodes.exchange.identity import new_identity
from limb_nodes.exchange.ticks import Ticks
from limb_nodes.foundation.topics import exchanged
from limb_nodes.model import load_limb
from limb_nodes.nodes.claims import comes_before, new_claim
from limb_nodes.nodes.limb_dynamics import LimbDynamics
from limb_nodes.nodes.muscle_stack import MuscleStack
from limb_nodes.nodes.qos import LATCHED, STREAM
from limb_nodes.nodes.recorder import Recorder
from limb_nodes.nodes.session import CLASSES
from limb_nodes.nodes.settings import RunSettings, checked

LONG = "600"
MUSCLES, JOINTS = ["flexor", "extensor"], ["joint"]
# How many runs come to one that is in place, and how many pairs start together.
NEWCOMERS, PAIRS = 4, 2
# As many runs at a time as a test starts.
TOGETHER = 2


@pytest.fixture
def load() -> Iterator[None]:
    """Two processes that keep the machine busy."""
    busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(2)]
    yield
    for process in busy:
        process.kill()
        process.wait()


def refused(child: Any) -> None:
    """Assert that a run has ended with one line that names the namespace."""
    assert (child.wait(), child.printed) == (2, ""), child.said
    assert len(child.said.splitlines()) == 1, child.said
    assert re.match("limb: error: (--)?namespace is /, in which ", child.said), child.said


def test_every_newcomer_is_refused_and_the_run_in_place_is_as_if_alone(
    limb, waves, reference, load, processes, bench, bags, tmp_path
):
    """The run in place stands still while newcomers come, so that none comes too late; theirs would be longer."""
    graph = bench()
    ready, _ = checked(RunSettings(limb, waves, rate=1000.0, duration=0.5, out=str(tmp_path / "first")))
    first = {name: graph.add(kind, **ready.parameters(name)) for name, kind in CLASSES.items()}
    graph.until(lambda: first["limb_dynamics"].part.tick > 100, "the first ticks")
    arguments = ["run", limb, "--activation", "flexor=0.9,extensor=0", "--duration", LONG]
    for number in range(0, NEWCOMERS, TOGETHER):
        options = ["--processes"] if number == 0 else []
        children = [processes.limb(*arguments, "--out", tmp_path / f"{number + k}", *options) for k in range(TOGETHER)]
        for child in children:
            refused(child)
        tick = first["limb_dynamics"].part.tick
        graph.until(lambda tick=tick: first["limb_dynamics"].part.tick > tick, "another tick")
    graph.until(lambda: first["recorder"].finished, "the end of the run in place")
    assert {name: node.failure for name, node in first.items()} == dict.fromkeys(CLASSES)
    assert {name: node.part.bad_input for name, node in first.items()} == dict.fromkeys(CLASSES, 0)
    graph.finish(first["recorder"])
    assert bags.differences(reference, tmp_path / "first") == []


@pytest.mark.parametrize("options", [[], ["--processes"]], ids=["one process", "processes"])
def test_a_command_in_place_goes_on(options, limb, processes, until, bags, tmp_path):
    arguments = ["run", limb, "--activation", "flexor=0.9,extensor=0"]
    first = processes.limb(*arguments, "--duration", LONG, "--out", tmp_path / "first", *options)
    until(lambda: any((tmp_path / "first").glob("*.mcap")) or not first.running(), "the first run")
    second = processes.limb(*arguments, "--duration", LONG, "--out", tmp_path / "second")
    third = processes.limb(*arguments, "--duration", "0.1", "--out", tmp_path / "third", "--namespace", "other")
    refused(second)
    assert (third.wait(), third.said) == (0, "")
    assert first.running()
    first.signal(signal.SIGINT)
    assert (first.wait(), first.said) == (130, "")
    torque = bags.decoded(tmp_path / "first")["joint_torque"]["tick"]
    np.testing.assert_array_equal(torque, np.arange(len(torque)))


def test_of_two_that_start_together_one_goes_on(limb, load, processes, until, tmp_path):
    for pair in range(PAIRS):
        folders = [tmp_path / f"{pair}{name}" for name in "ab"]
        arguments = ["run", limb, "--activation", "flexor=0.9,extensor=0", "--duration", LONG]
        both = [processes.limb(*arguments, "--out", folder) for folder in folders]
        ended = until(lambda both=both: [child for child in both if not child.running()], "one to give way")
        assert len(ended) == 1
        refused(ended[0])
        (survivor,) = (child for child in both if child is not ended[0])
        folder = folders[both.index(survivor)]
        until(lambda folder=folder: any(folder.glob("*.mcap")), "the bag of the one that stays")
        assert survivor.running(), survivor.said
        survivor.signal(signal.SIGINT)
        assert (survivor.wait(), survivor.said) == (130, "")


def claimed(limb: str, identity: str = "", rate: float = 1000.0, mode: str = "lockstep") -> Claim:
    return new_claim(identity or new_identity(), load_limb(limb), Ticks(rate), mode)


def test_the_earlier_claim_comes_before_whoever_compares(limb):
    first, second = claimed(limb), claimed(limb)
    assert comes_before(first, second) and not comes_before(second, first)  # noqa: PT018
    second.since = first.since
    assert comes_before(first, second) != comes_before(second, first)
    assert not comes_before(first, first)


def test_limb_dynamics_gives_way_to_an_earlier_claim_and_answers_a_later_one(bench, limb):
    earlier = claimed(limb)
    graph = bench()
    heard = graph.listen(Claim, exchanged("claim"), STREAM)
    node = graph.add(LimbDynamics, limb=limb)
    graph.until(lambda: heard, "its claim")
    assert heard[0].run == node.part.identity
    claims = graph.publisher(Claim, exchanged("claim"), LATCHED, listeners=2)
    claims.publish(claimed(limb))
    graph.until(lambda: heard.count(heard[0]) == 2, "its claim, again")
    assert node.failure is None
    claims.publish(earlier)
    graph.until(lambda: node.failure, "it to give way")
    assert earlier.run in node.failure[0]
    assert "namespace is /, in which" in node.failure[0]


def activation(identity: str, tick: int, value: float) -> MuscleActivation:
    return MuscleActivation(header=header(tick), run=identity, tick=tick, name=MUSCLES, activation=[value, value])


def states(identity: str, tick: int) -> LimbState:
    return LimbState(header=header(tick), run=identity, tick=tick, joint=JOINTS, angle=[0.5], velocity=[0.0])


def header(tick: int) -> Header:
    message = Header()
    message.stamp.nanosec = tick * 1_000_000
    return message


@pytest.mark.parametrize("given", [True, False], ids=["identity given", "that of the first message"])
def test_a_node_takes_its_run_s_messages_alone(given, bench, limb, capfd):
    own, other = new_identity(), new_identity()
    graph = bench()
    heard = graph.listen(JointTorque, exchanged("joint_torque"), STREAM)
    node = graph.add(MuscleStack, limb=limb, rate=1000.0, **({"identity": own} if given else {}))
    activations = graph.publisher(MuscleActivation, exchanged("activation"), STREAM)
    joints = graph.publisher(LimbState, exchanged("limb_state"), STREAM)
    activations.publish(activation(own, 0, 0.5))
    graph.until(lambda: 0 in node.part.inputs, "the first activation")
    for identity, value in (other, 0.9), (own, 0.25):
        activations.publish(activation(identity, 1, value))
        joints.publish(states(identity, 0))
    graph.until(lambda: heard, "a torque")
    assert (node.part.identity, heard[0].run, len(heard)) == (own, own, 1)
    assert node.part.excitation.tolist() == [0.25, 0.25]
    assert (node.part.bad_input, node.part.foreign) == (0, 2)
    joints.publish(states("", 1))
    graph.until(lambda: node.part.foreign == 3, "the message without an identity to be counted")
    assert "its field run" in capfd.readouterr().err


def test_a_recorder_without_an_identity_records_the_run_that_it_hears_of(bench, limb, tmp_path):
    graph = bench()
    ready = graph.listen(Recorded, exchanged("recorded"), STREAM)
    recorder = graph.add(Recorder, limb=limb, rate=1000.0, out=str(tmp_path / "run"))
    gone = graph.add(LimbDynamics, limb=limb, rate=1000.0, await_recorder=True)
    graph.until(lambda: recorder.part.identity == gone.part.identity, "the first run")
    graph.finish(gone)
    dynamics = graph.add(LimbDynamics, limb=limb, rate=1000.0, await_recorder=True)
    for name in "activation_input", "muscle_stack":
        own = {"source": "flexor=0.9,extensor=0", "duration": 0.01} if name == "activation_input" else {}
        graph.add(CLASSES[name], limb=limb, rate=1000.0, **own)
    graph.until(lambda: recorder.finished, "the end of the second run")
    assert {message.run for message in ready} <= {gone.part.identity, dynamics.part.identity}
    assert recorder.part.identity == dynamics.part.identity
    assert recorder.part.missing() == 0
