"""In real time: the movement of the lockstep run, deadlines that are missed are counted, recordings are played live."""

from __future__ import annotations

import re
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from limb_msgs.msg import EmgEnvelope, MuscleActivation
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.signals import SignalHandlerOptions

from limb_nodes.bags.read import BagReader
from limb_nodes.exchange.movement import MOST_AHEAD, TORQUE_FIELDS
from limb_nodes.exchange.ticks import Ticks
from limb_nodes.foundation.topics import exchanged
from limb_nodes.model import load_limb
from limb_nodes.nodes.activation_input import ActivationInput
from limb_nodes.nodes.limb_dynamics import LimbDynamics
from limb_nodes.nodes.muscle_stack import MuscleStack
from limb_nodes.nodes.qos import EVERY, LIVE, STREAM
from limb_nodes.nodes.recorder import Recorder
from limb_nodes.nodes.running import close
from limb_nodes.nodes.session import run_in_one_process
from limb_nodes.nodes.settings import RunSettings, checked
from limb_nodes.solve.stepping import LimbStepper

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
    # The last tick is due 2 s after the first; on a busy machine it may be later, never earlier.
    assert outcome.seconds > 1.9
    live, still = bags.decoded(tmp_path / "run", TOPICS), bags.decoded(lockstep(), TOPICS)
    assert outcome.ticks == 401
    np.testing.assert_array_equal(live["activation"]["activation"], still["activation"]["activation"])
    assert torques_carried(tmp_path / "run", limb, RATE, bags) <= outcome.missed
    differ_little(live, still, outcome.missed)
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
    # Every second all nodes tell how they do; a busy machine may take so long.
    assert names[-1] == "last words"
    assert "/limb_dynamics" in names


@pytest.mark.parametrize("rate", [50.0, 200.0])
def test_a_muscle_stack_that_stands_still(rate, limb, waves, lockstep, processes, bench, bags, tmp_path):
    """Its late ticks are counted, and the limb waits for them: moving on it would be thrown round at 50 Hz."""
    seconds = 4.0
    still = bags.decoded(lockstep(seconds=seconds, rate=rate), TOPICS)
    graph = bench()
    told = graph.listen(DiagnosticArray, "/diagnostics", LIVE)
    common = {"limb": limb, "rate": rate, "mode": "realtime"}
    muscle_stack = processes.node("muscle_stack", **common)
    graph.add(ActivationInput, source=waves, duration=seconds, **common)
    dynamics = graph.add(LimbDynamics, await_recorder=True, **common)
    recorder = graph.add(Recorder, out=str(tmp_path / "run"), **common)
    graph.until(lambda: dynamics.part.tick > 0.5 * rate, "half a second of movement")
    muscle_stack.signal(signal.SIGSTOP)
    resume = dynamics.part.elapsed() + STILL * rate
    graph.until(lambda: dynamics.part.elapsed() > resume, "the stand-still to end")
    muscle_stack.signal(signal.SIGCONT)
    graph.until(lambda: recorder.finished and dynamics.finished, "the end")
    graph.until(lambda: missed_deadlines(told)[-1:] == [dynamics.part.missed], "the last report")
    assert muscle_stack.wait() == 0
    reported = missed_deadlines(told)
    assert reported == sorted(reported)
    # What became due meanwhile, but for the tick that was on its way, the one whose torque was, and rounding.
    assert STILL * rate - 4 <= dynamics.part.missed <= dynamics.part.tick
    graph.finish(recorder)
    found = bags.decoded(tmp_path / "run", (*TOPICS, "joint_torque"))
    ticks = found["joint_torque"]["tick"].tolist()
    assert ticks == list(range(round(seconds * rate) + 1)), "muscle_stack answers every tick, late ones too"
    assert torques_carried(tmp_path / "run", limb, rate, bags) <= dynamics.part.missed
    differ_little(found, still, dynamics.part.missed)
    with BagReader(tmp_path / "run") as bag:
        assert bag.has("/diagnostics")


def test_a_played_recording_moves_the_limb_as_in_lockstep(limb, lockstep, processes, bench, bags, tmp_path):
    """`limb play` and a live `limb run`: the activation is the recording, the movement that of a lockstep run by it."""
    rate = 50.0
    text = Path(limb).read_text()
    assert text.count("angle: 0.5235987755982988") == 1
    # At rest before the recording begins, so that the movement is the recording's alone.
    resting = tmp_path / "resting.yaml"
    resting.write_text(text.replace("angle: 0.5235987755982988", "angle: 0.0"))
    seconds = np.arange(151) / rate
    # No two samples are alike.
    envelope = {
        "flexor": 0.5 - 0.5 * np.cos(0.5 * np.pi * seconds),
        "extensor": 0.5 - 0.5 * np.cos(0.25 * np.pi * seconds),
    }
    recording = np.stack([*envelope.values()], axis=1)
    graph, out = bench(), tmp_path / "run"
    heard = graph.listen(MuscleActivation, exchanged("activation"), STREAM)
    player = processes.limb("play", bags.envelopes(tmp_path / "envelopes", envelope, rate), "--wait", "300")
    live = processes.limb(
        "run", resting, "--mode", "realtime", "--rate", "50", "--out", out, "--state-every", "50", "--silence", "60"
    )
    assert (player.wait(), player.said) == (0, ""), player.said
    messages, took = played(player)
    assert messages == 151
    assert took >= 3.0
    last = [*recording[-1]]
    graph.until(lambda: (heard and [*heard[-1].activation] == last) or not live.running(), "the last envelope")
    live.signal(signal.SIGINT)
    assert live.wait() == 130
    assert "Traceback" not in live.said
    found = bags.decoded(out, (*TOPICS, "emg_envelope"))
    np.testing.assert_array_equal(found["emg_envelope"]["envelope"], recording)
    # Of each tick, the newest sample there was; none returns.
    samples = [np.flatnonzero((recording == row).all(axis=1)).item() for row in found["activation"]["activation"]]
    assert samples == sorted(samples)
    assert (samples[0], samples[-1]) == (0, 150)
    ticks = len(found["joint_states"]["position"])
    still = bags.decoded(lockstep(str(out), (ticks - 1) / rate, str(resting), rate), TOPICS)
    assert np.ptp(still["joint_states"]["position"]) > 0.1
    late = int(re.search(r"deadlines  (\d+) missed", live.printed)[1])
    assert torques_carried(out, str(resting), rate, bags) <= late
    differ_little(found, still, late)


def played(player: Any) -> tuple[int, float]:
    """How many messages `limb play` says that it has published, and the time from the first to the last (s)."""
    messages, seconds = re.match(r"messages  (\d+) of .*\nwall time (\S+) s", player.printed).groups()
    return int(messages), float(seconds)


def missed(path: Path) -> int:
    """Missed deadlines that the limb has reported last."""
    with BagReader(path) as bag:
        return missed_deadlines([message for _, message in bag.read_topic("/diagnostics")])[-1]


def missed_deadlines(told: list[DiagnosticArray]) -> list[int]:
    """What the limb has reported, the only node that has something to say."""
    pairs = [pair for message in told for status in message.status for pair in status.values]
    return [int(pair.value) for pair in pairs if pair.key == "missed_deadlines"]


def torques_carried(path: Path, limb: str, rate: float, bags: Any) -> int:
    """How many ticks of a run went on with an older torque, carried along its slopes.

    Asserts that each tick leads to the next, to the last bit, by its own torque or by one that is younger than
    `MOST_AHEAD`.
    """
    found = bags.decoded(path, ("joint_states", "joint_torque", "movement_pattern"))
    angle, velocity = found["joint_states"]["position"], found["joint_states"]["velocity"]
    accelerations = found["movement_pattern"]["acceleration"]
    rows = np.stack([found["joint_torque"][name] for name in TORQUE_FIELDS], axis=1)
    model, period = load_limb(limb), Ticks(rate).period
    chain, taken, carried = LimbStepper(model), [], 0
    for k, acceleration in enumerate(accelerations):
        for old in range(max(0, k + 1 - len(rows)), min(k + 1, round(MOST_AHEAD * rate))):
            torque = rows[k - old].copy()
            torque[0] += (
                torque[2] * (angle[k] - angle[k - old])
                + torque[3] * (velocity[k] - velocity[k - old])
                + torque[1] * old * period
            )
            if not np.array_equal(chain.acceleration(torque), acceleration):
                continue
            chain.step(torque, period)
            if k + 1 == len(accelerations) or np.array_equal(
                (chain.angle, chain.velocity), (angle[k + 1], velocity[k + 1])
            ):
                break
            # Muscles that are slack pull alike, but differ in their slopes if they are about to pull.
            chain = LimbStepper(model)
            for earlier in taken:
                chain.step(earlier, period)
        else:
            pytest.fail(f"tick {k} has moved on with a torque that is not there")
        taken.append(torque)
        carried += old > 0
    return carried


def differ_little(live: Any, still: Any, late: int) -> None:
    """Assert that a movement is that of the lockstep run, to the last bit if no torque was late.

    Torques that are always as late as the limb takes them, and know nothing of the next activation, make 0.27 rad.
    """
    difference = np.abs(live["joint_states"]["position"] - still["joint_states"]["position"]).max()
    assert difference <= 0.4 * bool(late)


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
        recorder.create_subscription(EmgEnvelope, "emg_envelope", lambda message: None, EVERY)
        until(lambda node=recorder: node.count_publishers("emg_envelope") or not player.running(), "the player")
        close(context, None, [recorder])
    assert player.running(), player.printed
    player.signal(signal.SIGINT)
    assert player.wait() == 130
    assert "messages  0 of" in player.printed


def test_play_repeats_until_interrupted_at_its_pace(processes, bench, bags, tmp_path):
    graph = bench("left")
    heard = graph.listen(EmgEnvelope, "emg_envelope", EVERY)
    # Slow enough for who listens to miss none while it waits for its turn.
    ramp = bags.envelopes(tmp_path / "ramp", {"flexor": np.linspace(0.0, 1.0, 11)}, 10.0)
    player = processes.limb("play", ramp, "--loop", "--rate-factor", "4", "--namespace", "left", "--wait", "300")
    graph.until(lambda: len(heard) > 15 or not player.running(), "the second round")
    player.signal(signal.SIGINT)
    assert (player.wait(), player.said) == (130, "")
    assert "interrupted" in player.printed
    assert "/left/emg_envelope" in player.printed
    messages, took = played(player)
    # Rounded to 0.01 s; on a busy machine it may be later, never earlier.
    assert took >= 0.1 / 4 * (messages - 1) - 0.005
    assert [round(10 * m.envelope[0]) for m in heard[:16]] == [*range(11), *range(5)]
    assert list(heard[5].envelope) == [0.5]
    assert heard[5].header.stamp.nanosec == 500_000_000
