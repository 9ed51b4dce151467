"""Nodes among strangers: what cannot be used is kept out, counted, and said once per second at most."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Vector3, Wrench, WrenchStamped
from limb_msgs.msg import EmgEnvelope, JointTorque, LimbState, MuscleActivation
from rclpy.duration import Duration
from rclpy.serialization import serialize_message
from std_msgs.msg import Header

from limb_nodes.bags.read import BagReader
from limb_nodes.exchange.identity import new_identity
from limb_nodes.exchange.ticks import Ticks
from limb_nodes.foundation.topics import exchanged
from limb_nodes.nodes.activation_input import ActivationInput
from limb_nodes.nodes.limb_dynamics import LimbDynamics
from limb_nodes.nodes.messages import stamp_at
from limb_nodes.nodes.muscle_stack import MuscleStack
from limb_nodes.nodes.qos import LIVE, STREAM
from limb_nodes.nodes.recorder import Recorder

NAN, INF = float("nan"), float("inf")
RATE = 200.0
TICKS = Ticks(RATE)
# The identity of the run that the hand-made messages belong to.
RUN = new_identity()
MUSCLES, JOINTS = ["flexor", "extensor"], ["joint"]

BAD_ACTIVATIONS = {
    "NaN": {"activation": [NAN, 0.5]},
    "infinite": {"activation": [0.5, INF]},
    "negative": {"activation": [-0.1, 0.5]},
    "above 1": {"activation": [0.5, 1.5]},
    "a muscle missing": {"name": ["flexor"], "activation": [0.5]},
    "other muscles": {"name": ["left", "right"], "activation": [0.5, 0.5]},
    "a value missing": {"activation": [0.5]},
    "no value": {"activation": []},
    "nothing": {"name": [], "activation": []},
}
BAD_STATES = {
    "NaN angle": {"angle": [NAN]},
    "infinite velocity": {"velocity": [INF]},
    "other joint": {"joint": ["knee"]},
    "no velocity": {"velocity": []},
    "no angle": {"angle": []},
    "too many": {"angle": [0.1, 0.2]},
    "nothing": {"joint": [], "angle": [], "velocity": []},
}
BAD_TORQUES = {
    "NaN": {"torque": [NAN]},
    "infinite slope": {"slope_angle": [INF]},
    "NaN slope": {"slope_time": [NAN]},
    "other joint": {"joint": ["knee"]},
    "ragged": {"slope_velocity": [0.0, 0.0]},
    "a slope missing": {"slope_velocity": []},
    "nothing": {"joint": [], "torque": [], "slope_angle": [], "slope_velocity": [], "slope_time": []},
}


def header(tick: int) -> Header:
    return Header(stamp=stamp_at(tick, TICKS))


def activation(tick: int, **fields: Any) -> MuscleActivation:
    given = {"name": MUSCLES, "activation": [0.5, 0.5], **fields}
    return MuscleActivation(header=header(tick), run=RUN, tick=tick, **given)


def envelope(tick: int, **fields: Any) -> EmgEnvelope:
    given = {"name": MUSCLES, "activation": [0.5, 0.5], **fields}
    return EmgEnvelope(header=header(tick), name=given["name"], envelope=given["activation"])


def states(tick: int, **fields: Any) -> LimbState:
    given = {"joint": JOINTS, "angle": [0.5], "velocity": [0.0], **fields}
    return LimbState(header=header(tick), run=RUN, tick=tick, **given)


def torque(tick: int, **fields: Any) -> JointTorque:
    zeros = {key: [0.0] for key in ("torque", "slope_angle", "slope_velocity", "slope_time")}
    return JointTorque(header=header(tick), run=RUN, tick=tick, **{"joint": JOINTS, **zeros, **fields})


def warnings(said: str, node: str) -> list[str]:
    return [line for line in said.splitlines() if "[WARN]" in line and f"[{node}]" in line]


def once_per_second(lines: list[str], begun: float) -> None:
    """Assert that something was said, and at most once per second since a time (s, of the monotonic clock)."""
    assert 1 <= len(lines) <= time.monotonic() - begun + 1, lines


def test_activation_input_keeps_the_last_good_envelope(bench, limb, capfd):
    graph = bench()
    told = graph.listen(DiagnosticArray, "/diagnostics", LIVE)
    heard = graph.listen(MuscleActivation, exchanged("activation"), STREAM)
    node = graph.add(ActivationInput, limb=limb, mode="realtime", rate=RATE)
    joints = graph.publisher(LimbState, exchanged("limb_state"), STREAM)
    graph.until(lambda: node.diagnostics.get_subscription_count(), "who listens to diagnostics")
    for tick in 0, 1:
        joints.publish(states(tick))
    envelopes = graph.publisher(EmgEnvelope, "emg_envelope", LIVE)
    envelopes.publish(envelope(0, activation=[0.25, 0.75]))
    graph.until(lambda: node.newest.tolist() == [0.25, 0.75], "the good envelope")
    begun = time.monotonic()
    for count, fields in enumerate([*BAD_ACTIVATIONS.values()] * 10, 1):
        envelopes.publish(envelope(count, **fields))
        graph.until(lambda count=count: node.part.bad_input == count, f"envelope {count} to be counted")
    once_per_second(warnings(capfd.readouterr().err, "activation_input"), begun)
    for tick in 2, 3, 4, 5, 6, 7:
        joints.publish(states(tick))
    graph.until(lambda: heard and heard[-1].tick == 8, "activation 8")
    assert list(heard[-1].activation) == [0.25, 0.75]
    graph.until(lambda: told, "a diagnostic")
    assert told[0].status[0].name == "/activation_input"
    # More muscles than needed, in another order, are good.
    envelopes.publish(envelope(0, name=["other", "extensor", "flexor"], activation=[NAN, 0.1, 0.2]))
    graph.until(lambda: node.newest.tolist() == [0.2, 0.1], "the envelope of three muscles")
    assert node.part.bad_input == 90


@pytest.mark.parametrize("fields", BAD_ACTIVATIONS.values(), ids=BAD_ACTIVATIONS)
def test_muscle_stack_waits_for_a_good_activation(fields, bench, limb):
    node = bench().add(MuscleStack, limb=limb, rate=RATE)
    good = activation(0, activation=[0.25, 0.75]), activation(1, activation=[0.5, 0.5])
    for message in good[0], activation(1, **fields), good[1]:
        node.part.receive("activation", serialize_message(message))
    assert node.part.bad_input == 1
    assert {tick: values.tolist() for tick, (values, _) in node.part.inputs.items()} == {0: [0.25, 0.75], 1: [0.5, 0.5]}


def test_muscle_stack_waits_for_good_joint_states(bench, limb, capfd):
    graph = bench()
    heard = graph.listen(JointTorque, exchanged("joint_torque"), STREAM)
    node = graph.add(MuscleStack, limb=limb, rate=RATE)
    activations = graph.publisher(MuscleActivation, exchanged("activation"), STREAM)
    joints = graph.publisher(LimbState, exchanged("limb_state"), STREAM)
    for tick in range(3):
        activations.publish(activation(tick))
    joints.publish(states(0))
    graph.until(lambda: [m.tick for m in heard] == [0], "torque 0")
    begun = time.monotonic()
    for count, fields in enumerate(BAD_STATES.values(), 1):
        joints.publish(states(1, **fields))
        graph.until(lambda count=count: node.part.bad_input == count, f"joint states {count} to be counted")
    assert [m.tick for m in heard] == [0]
    joints.publish(states(1))
    graph.until(lambda: [m.tick for m in heard] == [0, 1], "torque 1")
    assert np.isfinite(heard[1].torque[0])
    once_per_second(warnings(capfd.readouterr().err, "muscle_stack"), begun)


@pytest.mark.parametrize("mode", ["lockstep", "realtime"])
def test_limb_dynamics_keeps_bad_torques_out(mode, bench, limb, capfd):
    graph = bench()
    heard = graph.listen(LimbState, exchanged("limb_state"), STREAM)
    node = graph.add(LimbDynamics, limb=limb, rate=RATE, mode=mode, identity=RUN)
    torques = graph.publisher(JointTorque, exchanged("joint_torque"), STREAM)
    graph.until(lambda: heard, "joint states 0")
    begun = time.monotonic()
    for count, fields in enumerate(BAD_TORQUES.values(), 1):
        torques.publish(torque(0, **fields))
        graph.until(lambda count=count: node.part.bad_input == count, f"torque {count} to be counted")
    assert node.part.tick == 0
    torques.publish(torque(0))
    graph.until(lambda: node.part.tick >= 1 and len(heard) >= 2, "joint states 1")
    assert np.isfinite([*heard[1].angle, *heard[1].velocity]).all()
    lines = warnings(capfd.readouterr().err, "limb_dynamics")
    once_per_second([line for line in lines if "it is not taken" in line], begun)


@pytest.mark.parametrize("bad", [NAN, INF, -INF])
def test_limb_dynamics_keeps_the_last_good_load(bad, bench, limb):
    graph = bench()
    node = graph.add(LimbDynamics, limb=limb, rate=RATE, await_recorder=True)
    loads = graph.publisher(WrenchStamped, "external_load", LIVE)
    loads.publish(load(3.0, -2.0, 0.5))
    graph.until(lambda: node.part.stepper.load.tolist() == [3.0, -2.0, 0.5], "the load")
    for count, values in enumerate(((bad, 0.0, 0.0), (0.0, bad, 0.0), (0.0, 0.0, bad)), 1):
        loads.publish(load(*values))
        graph.until(lambda count=count: node.part.bad_input == count, "a bad load to be counted")
    assert node.part.stepper.load.tolist() == [3.0, -2.0, 0.5]


def load(x: float, y: float, turning: float) -> WrenchStamped:
    return WrenchStamped(wrench=Wrench(force=Vector3(x=x, y=y), torque=Vector3(z=turning)))


def test_a_load_acts_as_the_limb_s_own_tip_force(bench, limb, waves, bags, tmp_path):
    """The same movement, value for value, as with force and torque in the limb's file."""
    text = Path(limb).read_text()
    assert text.count("tip_force: [0.0, 0.0]") == text.count("tip_torque: 0.0") == 1
    loaded = tmp_path / "loaded.yaml"
    loaded.write_text(
        text.replace("tip_force: [0.0, 0.0]", "tip_force: [3.0, -2.0]").replace("tip_torque: 0.0", "tip_torque: 0.5")
    )
    for name, file in ("plain", limb), ("message", limb), ("file", str(loaded)):
        graph = bench(name)
        common = {"limb": file, "rate": 1000.0}
        dynamics = graph.add(LimbDynamics, await_recorder=True, **common)
        graph.add(MuscleStack, **common)
        graph.add(ActivationInput, source=waves, duration=0.2, **common)
        recorder = graph.add(Recorder, out=str(tmp_path / name), **common)
        if name == "message":
            # Before the recorder lets the run begin: nothing is handled until the bench spins.
            dynamics.on_load(load(3.0, -2.0, 0.5))
        graph.until(lambda recorder=recorder: recorder.finished, "the end of the run")
        graph.finish(recorder)
    names = "plain", "message", "file"
    angles = {name: bags.decoded(tmp_path / name, ("joint_states",))["joint_states"] for name in names}
    np.testing.assert_array_equal(angles["message"]["position"], angles["file"]["position"])
    assert np.abs(angles["message"]["position"] - angles["plain"]["position"]).max() > 0.01


def test_a_load_is_recorded(bench, limb, until, tmp_path):
    graph = bench()
    recorder = graph.add(Recorder, limb=limb, out=str(tmp_path / "run"), rate=RATE)
    torques = graph.publisher(JointTorque, exchanged("joint_torque"), STREAM)
    loads = graph.publisher(WrenchStamped, "external_load", LIVE)
    torques.publish(torque(0))
    graph.until(lambda: recorder.part.counts["joint_torque"], "a torque")
    loads.publish(load(3.0, -2.0, 0.5))
    until(lambda: loads.wait_for_all_acked(Duration(seconds=1.0)), "the load to arrive")
    graph.finish(recorder)
    with BagReader(tmp_path / "run") as bag:
        ((_, message),) = bag.read_topic("external_load")
    assert message.wrench.force.x == 3.0
