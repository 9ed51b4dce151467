"""In real time: the movement of the lockstep run, deadlines that are missed are counted, recordings are played live."""

from __future__ import annotations

import signal
import time
from pathlib import Path

import numpy as np
import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from limb_msgs.msg import JointTorque, MuscleActivation
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.signals import SignalHandlerOptions

from limb_nodes.bags.read import BagReader
from limb_nodes.nodes.activation_input import ActivationInput
from limb_nodes.nodes.limb_dynamics import LimbDynamics
from limb_nodes.nodes.muscle_stack import MuscleStack
from limb_nodes.nodes.qos import EVERY, LIVE, STREAM
from limb_nodes.nodes.recorder import Recorder
from limb_nodes.nodes.running import close
from limb_nodes.nodes.session import run_in_one_process
from limb_nodes.nodes.settings import RunSettings, checked

RATE, PERIOD_NS = 200.0, 5_000_000
TOPICS = ("activation", "joint_states")
# How long muscle_stack stands still (s).
STILL = 1.5


@pytest.fixture
def lockstep(limb, waves, tmp_path, own_signals):
    """Makes a lockstep run at the real-time rate, to compare with."""

    def make(source: str = waves, seconds: float = 2.0, file: str = limb, rate: float = RATE) -> Path:
        out = tmp_path / "lockstep"
        run, _ = checked(RunSettings(file, source, rate, seconds, str(out)))
        assert run_in_one_process(run, lambda tick: None).missing == 0
        return out

    return make


def test_real_time_follows_the_lockstep_run(limb, waves, lockstep, bags, tmp_path, own_signals):
    run, _ = checked(RunSettings(limb, waves, RATE, 2.0, str(tmp_path / "run"), mode="realtime"))
    outcome = run_in_one_process(run, lambda tick: None)
    assert (outcome.missing, outcome.bad_input) == (0, 0)
    # The last tick is due 2 s after the first; a machine that is busy may be later, never earlier.
    assert outcome.seconds > 1.9
    live, still = bags.decoded(tmp_path / "run"), bags.decoded(lockstep())
    assert outcome.ticks == 401
    np.testing.assert_array_equal(live["activation"]["activation"], still["activation"]["activation"])
    angles = live["joint_states"]["position"], still["joint_states"]["position"]
    # A torque that came too late is carried along its slopes, so that the movement hardly differs; without one that
    # did, it does not differ at all.
    assert np.abs(angles[0] - angles[1]).max() <= 0.02 * outcome.missed
    assert missed(tmp_path / "run") == outcome.missed


def test_what_was_said_when_the_run_ends_is_in_its_bag(limb, waves, bench, until, tmp_path):
    graph = bench()
    common = {"limb": limb, "rate": RATE, "mode": "realtime"}
    for kind, own in (
        (ActivationInput, {"source": waves, "duration": 0.1}),
        (MuscleStack, {}),
        (LimbDynamics, {"await_recorder": True}),
    ):
        graph.add(kind, **common, **own)
    recorder = graph.add(Recorder, out=str(tmp_path / "run"), **common)
    last = DiagnosticArray(status=[DiagnosticStatus(name="last words")])
    teller = graph.publisher(DiagnosticArray, "/diagnostics", LIVE)
    graph.until(lambda: recorder.finished, "the end")
    teller.publish(last)
    until(lambda: teller.wait_for_all_acked(Duration(seconds=1.0)), "the message to arrive")
    # No executor has a turn between the arrival and the end.
    graph.finish(recorder)
    with BagReader(tmp_path / "run") as bag:
        names = [status.name for _, message in bag.read_topic("/diagnostics") for status in message.status]
    assert names == ["/limb_dynamics"] * (len(names) - 1) + ["last words"]
    assert len(names) > 1


@pytest.mark.parametrize("rate", [50.0, 200.0])
def test_a_muscle_stack_that_stands_still(rate, limb, waves, lockstep, processes, bench, bags, tmp_path):
    """Its late ticks are counted, and the limb waits for them: moving on it would be thrown round at 50 Hz."""
    still = bags.decoded(lockstep(seconds=6.0, rate=rate), TOPICS)
    graph = bench()
    told = graph.listen(DiagnosticArray, "/diagnostics", LIVE)
    torques = graph.listen(JointTorque, "joint_torque", STREAM)
    common = {"limb": limb, "rate": rate, "mode": "realtime"}
    muscle_stack = processes.node("muscle_stack", **common)
    graph.add(ActivationInput, source=waves, duration=6.0, **common)
    dynamics = graph.add(LimbDynamics, await_recorder=True, **common)
    recorder = graph.add(Recorder, out=str(tmp_path / "run"), **common)
    graph.until(lambda: dynamics.tick > 0.5 * rate, "half a second of movement")
    muscle_stack.signal(signal.SIGSTOP)
    resume = time.monotonic() + STILL
    graph.until(lambda: time.monotonic() > resume, "the stand-still to end")
    muscle_stack.signal(signal.SIGCONT)
    graph.until(lambda: torques and dynamics.tick - torques[-1].tick <= 2, "muscle_stack to catch up")
    graph.until(lambda: recorder.finished and dynamics.finished, "the end")
    assert muscle_stack.wait() == 0
    reported = [
        int(pair.value)
        for message in told
        for status in message.status
        if status.name == "/limb_dynamics"
        for pair in status.values
        if pair.key == "missed_deadlines"
    ]
    assert reported == sorted(reported)
    assert reported[-1] >= 0.5 * STILL * rate
    assert reported[-1] <= dynamics.missed <= dynamics.tick
    graph.finish(recorder)
    found = bags.decoded(tmp_path / "run")
    ticks = found["joint_torque"]["tick"].tolist()
    assert ticks == list(range(round(6.0 * rate) + 1)), "muscle_stack answers every tick, late ones too"
    assert np.abs(found["joint_states"]["position"] - still["joint_states"]["position"]).max() < 0.1
    with BagReader(tmp_path / "run") as bag:
        assert bag.has("/diagnostics")


def test_a_played_recording_moves_the_limb_as_in_lockstep(limb, lockstep, processes, until, bags, tmp_path):
    """`limb play` against `limb run` live: activation and movement are those of the lockstep run, later by a delay.

    At a rate that a busy machine keeps.
    """
    rate = 50.0
    text = Path(limb).read_text()
    assert text.count("angle: 0.5235987755982988") == 1
    # At rest before the recording begins, so that the movement is the recording's alone.
    resting = tmp_path / "resting.yaml"
    resting.write_text(text.replace("angle: 0.5235987755982988", "angle: 0.0"))
    seconds = np.arange(401) / rate
    envelope = {
        "flexor": 0.5 - 0.5 * np.cos(0.5 * np.pi * seconds),
        "extensor": 0.5 - 0.5 * np.cos(0.25 * np.pi * seconds),
    }
    envelopes = bags.envelopes(tmp_path / "envelopes", envelope, rate)
    out = tmp_path / "run"
    player = processes.limb("play", envelopes, "--wait", "300")
    live = processes.limb("run", resting, "--mode", "realtime", "--rate", "50", "--out", out, "--state-every", "50")
    assert (player.wait(), player.said) == (0, ""), player.said
    assert "401" in player.printed
    # What the limb did until the last envelope is on disk when the run is closed.
    live.signal(signal.SIGINT)
    assert live.wait() == 130
    assert "Traceback" not in live.said
    found, still = bags.decoded(out, TOPICS), bags.decoded(lockstep(envelopes, 8.0, str(resting), rate), TOPICS)
    late, error = delay(found["activation"]["activation"], still["activation"]["activation"])
    assert error < 0.1, "the activation is the recording"
    moved, difference = delay(found["joint_states"]["position"], still["joint_states"]["position"])
    assert abs(moved - late) <= 4, "the movement follows the activation"
    assert np.ptp(still["joint_states"]["position"]) > 0.1
    assert difference < 0.05 * np.ptp(still["joint_states"]["position"])
    with BagReader(out) as bag:
        assert bag.count("emg_envelope") == 401


def missed(path: Path) -> int:
    """Missed deadlines that the limb has reported last."""
    with BagReader(path) as bag:
        told = [status for _, message in bag.read_topic("/diagnostics") for status in message.status]
    assert {status.name for status in told} == {"/limb_dynamics"}
    return {pair.key: int(pair.value) for pair in told[-1].values}["missed_deadlines"]


def delay(live: np.ndarray, still: np.ndarray) -> tuple[int, float]:
    """By how many ticks `live` comes after `still`, and the typical error then."""
    span = min(len(still), 380)
    shifts = range(len(live) - span + 1)
    errors = [float(np.sqrt(np.mean((live[shift : shift + span] - still[:span]) ** 2))) for shift in shifts]
    best = int(np.argmin(errors))
    return best, errors[best]


def test_play_does_not_take_a_recorder_for_a_listener(processes, bench, until, bags, tmp_path):
    """Not even while the graph knows what a node subscribes and not yet its name."""
    ramp = bags.envelopes(tmp_path / "ramp", {"flexor": np.linspace(0.0, 1.0, 11)}, 100.0)
    player = processes.limb("play", ramp, "--wait", "600")
    graph = bench()
    graph.until(lambda: graph.probe.count_publishers("emg_envelope"), "the player")
    for _ in range(10):
        context = Context()
        rclpy.init(context=context, signal_handler_options=SignalHandlerOptions.NO)
        recorder = rclpy.create_node("recorder", context=context, start_parameter_services=False)
        recorder.create_subscription(MuscleActivation, "emg_envelope", lambda message: None, EVERY)
        until(lambda node=recorder: node.count_publishers("emg_envelope") or not player.running(), "the player")
        close(context, None, [recorder])
    assert player.running(), player.printed
    player.signal(signal.SIGINT)
    assert player.wait() == 130
    assert "messages  0 of" in player.printed


def test_play_repeats_until_interrupted_at_its_pace(processes, bench, bags, tmp_path):
    graph = bench("left")
    heard = graph.listen(MuscleActivation, "emg_envelope", EVERY)
    ramp = bags.envelopes(tmp_path / "ramp", {"flexor": np.linspace(0.0, 1.0, 101)}, 100.0)
    player = processes.limb("play", ramp, "--loop", "--rate-factor", "4", "--namespace", "left")
    graph.until(lambda: len(heard) > 150 or not player.running(), "the second round")
    player.signal(signal.SIGINT)
    assert (player.wait(), player.said) == (130, "")
    assert "interrupted" in player.printed
    assert "/left/emg_envelope" in player.printed
    assert [m.tick for m in heard[:120]] == [*range(101), *range(19)]
    assert list(heard[50].activation) == [0.5]
    assert heard[50].header.stamp.nanosec == 500_000_000
