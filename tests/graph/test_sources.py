"""Live sources made with plain rclpy: each is heard, whatever it offers, and what is wrong with one is told."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from limb_msgs.msg import EmgEnvelope, LimbState, MuscleActivation
from rclpy.context import Context
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, Header, MultiArrayDimension, MultiArrayLayout, String

from limb_nodes import cli
from limb_nodes.bags.read import BagReader
from limb_nodes.exchange.identity import new_identity
from limb_nodes.exchange.ticks import Ticks
from limb_nodes.foundation.topics import exchanged
from limb_nodes.nodes import live_source
from limb_nodes.nodes.activation_input import ActivationInput
from limb_nodes.nodes.distribution import make_executor
from limb_nodes.nodes.limb_dynamics import LimbDynamics
from limb_nodes.nodes.live_readers import EnvelopeReader, RawReader
from limb_nodes.nodes.live_settings import LiveSettings
from limb_nodes.nodes.messages import stamp_at, tick_of
from limb_nodes.nodes.muscle_stack import MuscleStack
from limb_nodes.nodes.qos import EVERY, LIVE, STREAM
from limb_nodes.nodes.recorder import Recorder
from limb_nodes.nodes.running import close
from limb_nodes.nodes.session import run_in_one_process
from limb_nodes.nodes.settings import RunSettings, checked
from limb_nodes.signals.activation import load_activation
from limb_nodes.signals.emg import envelopes
from limb_nodes.signals.options import EnvelopeOptions
from limb_nodes.signals.recording import read_recording

RATE = 50.0
TICKS = Ticks(RATE)
RUN = new_identity()
MUSCLES = ["flexor", "extensor"]
BEST_EFFORT = QoSProfile(depth=50, reliability=ReliabilityPolicy.BEST_EFFORT, durability=DurabilityPolicy.VOLATILE)
RELIABLE = QoSProfile(depth=50, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.VOLATILE)
LATCHED = QoSProfile(depth=50, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
QUALITIES = {"best effort": BEST_EFFORT, "reliable": RELIABLE, "latched": LATCHED}
# A source is told to be silent after this by default, and at most so much later than it is (s).
SILENCE, LATEST = 0.5, 1.0
# Longer than what a test does meanwhile takes on a busy machine (s).
LONG_SILENCE = 3.0


@contextmanager
def stranger(namespace: str = "") -> Iterator[Any]:
    """A node that shares no context with those of the limb."""
    context = Context()
    rclpy.init(context=context, signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node("stranger", context=context, namespace=namespace or None)
    try:
        yield node
    finally:
        close(context, None, [node])


@pytest.fixture
def foreign() -> Iterator[Callable[..., Any]]:
    """Makes publishers of strangers."""
    with ExitStack() as stack:

        def make(kind: type, topic: str, quality: QoSProfile) -> Any:
            return stack.enter_context(stranger()).create_publisher(kind, topic, quality)

        yield make


def envelope(values: Any, names: list[str] = MUSCLES, seconds: float = 1.0) -> EmgEnvelope:
    stamp = stamp_at(round(seconds * 1e3), Ticks(1e3))
    return EmgEnvelope(header=Header(stamp=stamp), name=names, envelope=[float(value) for value in values])


def limb_state(header: Header, tick: int) -> LimbState:
    return LimbState(header=header, run=RUN, tick=tick, joint=["joint"], angle=[0.0], velocity=[0.0])


class Live:
    """A live activation_input alone, with the joint states of a limb made by hand."""

    def __init__(self, graph: Any, limb: str, **parameters: Any) -> None:
        self.graph = graph
        self.told = graph.listen(DiagnosticArray, "/diagnostics", LIVE)
        self.heard = graph.listen(MuscleActivation, exchanged("activation"), STREAM)
        self.node = graph.add(ActivationInput, limb=limb, rate=RATE, mode="realtime", identity=RUN, **parameters)
        self.live = self.node.live
        self.joints = graph.publisher(LimbState, exchanged("limb_state"), STREAM)
        self.tick = -1
        # The node begins to listen when the limb moves.
        self.step()
        self.step()

    def step(self) -> list[float]:
        """Let the limb move by a tick; the activations that are sent for the next."""
        self.tick += 1
        header = Header(stamp=stamp_at(self.tick, TICKS))
        self.joints.publish(limb_state(header, self.tick))
        self.graph.until(
            lambda: self.heard and self.heard[-1].tick == self.tick + 1 and self.heard[-1],
            f"activation {self.tick + 1}",
        )
        return list(self.heard[-1].activation)

    def first(self, publisher: Any, message: Any) -> None:
        """Publish until a message has come: a best-effort source does not know when who listens has found it."""

        def heard() -> bool:
            publisher.publish(message)
            self.graph.spin()
            return bool(self.live.messages)

        self.graph.until(heard, "the first message")
        # Those that were under way.
        self.graph.until(lambda: self.settled(), "the last of the first messages")

    def settled(self) -> bool:
        before = self.live.messages
        for _ in range(5):
            self.graph.spin()
        return self.live.messages == before

    def send(self, publisher: Any, message: Any) -> None:
        """Publish a message that comes."""
        count = self.live.messages + 1
        publisher.publish(message)
        self.graph.until(lambda: self.live.messages >= count, f"message {count}")

    def reports(self) -> list[dict[str, str]]:
        """What the node has told of its source so far."""
        return [report for report in reports(self.told, "/activation_input") if "input" in report]


def reports(messages: list[Any], node: str) -> Iterator[dict[str, str]]:
    for status in (status for message in messages for status in message.status if status.name == node):
        yield {
            "message": status.message,
            "level": str(status.level),
            **{pair.key: pair.value for pair in status.values},
        }


# Replay


@dataclass(frozen=True)
class Player:
    """How a stranger plays a recording. rate: of the recording, Hz; pace: recorded seconds per second; every: ticks
    between two moments at which it sends what is due; late: ticks before it starts."""

    quality: str = "reliable"
    rate: float = RATE
    pace: float = 1.0
    every: int = 1
    late: int = 0
    names: tuple[str, ...] = ("flexor", "extensor")


PLAYERS = {
    "as recorded": Player(),
    "best effort": Player(quality="best effort"),
    "latched": Player(quality="latched"),
    "faster": Player(pace=2.0),
    "slower": Player(pace=0.5),
    "in steps": Player(every=7, quality="best effort"),
    "at a high rate": Player(rate=130.0, quality="best effort"),
    "at a low rate": Player(rate=12.5),
    "in another order": Player(names=("extensor", "other", "flexor"), quality="best effort"),
    "late": Player(late=20, quality="best effort"),
}
SPAN = 60


def recording(seconds: Any) -> dict[str, np.ndarray]:
    """Envelopes whose slope is at most pi / 2 per second."""
    return {
        "flexor": 0.5 - 0.5 * np.cos(np.pi * seconds),
        "extensor": 0.5 - 0.5 * np.cos(0.5 * np.pi * seconds),
        "other": 0.5 + 0.0 * seconds,
    }


@pytest.mark.parametrize("player", PLAYERS.values(), ids=PLAYERS)
def test_a_replay_gives_the_activations_of_the_bag(player, bench, limb, bags, foreign, tmp_path):
    """Tick by tick, to the step between two samples."""
    times = np.arange(0.0, player.pace * (SPAN + 1) / RATE + 1.0 / player.rate, 1.0 / player.rate)
    values = recording(times)
    bag = bags.envelopes(tmp_path / "bag", values, player.rate)
    live = Live(bench(), limb, silence=60.0)
    publisher = foreign(EmgEnvelope, "emg_envelope", QUALITIES[player.quality])
    start, sent, found = live.tick, 0, []
    for k in range(SPAN):
        if k >= player.late and (k - player.late) % player.every == 0:
            now = player.pace * (k - player.late) / RATE + 1e-9
            while times[sent] <= now:
                message = envelope([values[name][sent] for name in player.names], list(player.names), times[sent] + 1)
                (live.send if sent else live.first)(publisher, message)
                sent += 1
        found.append(live.step())
    assert live.tick == start + SPAN
    wanted = load_activation(bag, MUSCLES, RATE / player.pace).values[: SPAN - player.late]
    # A sample holds until the next one comes.
    step = player.pace * max(1.0 / player.rate, player.every / RATE) if player.rate >= RATE else 1.0 / player.rate
    played = np.array(found)
    assert np.abs(played[player.late :] - wanted).max() <= 0.5 * np.pi * (step + player.pace / RATE)
    assert not played[: player.late].any()
    assert np.ptp(played[:, 0]) > 0.5
    assert live.live.used == live.live.messages


def test_a_foreign_player_moves_the_limb_as_the_bag_does(bench, limb, bags, tmp_path, own_signals):
    """The whole graph in real time against lockstep runs; best effort, other names, another order, a late start."""
    text = Path(limb).read_text()
    assert text.count("angle: 0.5235987755982988") == 1
    # At rest before the recording begins, so that the movement is the recording's alone.
    resting = tmp_path / "resting.yaml"
    resting.write_text(text.replace("angle: 0.5235987755982988", "angle: 0.0"))
    count, start = 100, 20
    values = recording(np.arange(count + 1) / RATE)
    bag = bags.envelopes(tmp_path / "bag", values, RATE)
    with stranger("live") as player:
        graph = bench("live")
        common = {"limb": str(resting), "rate": RATE, "mode": "realtime"}
        node = graph.add(ActivationInput, duration=3.5, channels="EMG 1=flexor,EMG 2=extensor", **common)
        graph.add(MuscleStack, **common)
        dynamics = graph.add(LimbDynamics, await_recorder=True, **common)
        publisher = player.create_publisher(EmgEnvelope, "emg_envelope", BEST_EFFORT)
        graph.until(lambda: node.count_publishers("emg_envelope"), "the player")
        graph.until(lambda: "activation_input" in player.get_node_names(), "the limb")
        recorder = graph.add(Recorder, out=str(tmp_path / "run"), **common)

        def on_states(message: JointState) -> None:
            k = min(tick_of(message.header.stamp, TICKS) - start, count)
            if k >= 0:
                publisher.publish(envelope([values["extensor"][k], values["flexor"][k]], ["EMG 2", "EMG 1"]))

        graph.probe.create_subscription(JointState, "joint_states", on_states, EVERY)
        graph.until(lambda: recorder.finished, "the end")
        missed = dynamics.part.missed
        graph.finish(recorder)
    found = bags.decoded(tmp_path / "run", ("activation", "joint_states"))
    played = found["activation"]["activation"]
    distances = np.abs(played[:, None, :] - np.stack([values[name] for name in MUSCLES], axis=1)[None])
    samples = distances.max(axis=2).argmin(axis=1)
    assert distances.max(axis=2).min(axis=1).max() == 0.0, "each activation is one of the recording's"
    assert (np.diff(samples) >= 0).all(), "in its order"
    assert samples[-1] == count
    late = np.arange(len(samples)) - start - samples
    late = late[(samples > 0) & (samples < count)]
    assert late.min() >= 1
    with BagReader(tmp_path / "run") as reader:
        assert reader.count("emg_envelope") > 0, "the recorder hears it too"

    def lockstep(name: str, source: str) -> np.ndarray:
        run, _ = checked(RunSettings(str(resting), source, RATE, 0.0, str(tmp_path / name)))
        assert run_in_one_process(run, lambda tick: None).missing == 0
        return bags.decoded(tmp_path / name, ("joint_states",))["joint_states"]["position"][:, 0]

    live, again, still = (
        found["joint_states"]["position"][:, 0],
        lockstep("again", str(tmp_path / "run")),
        lockstep("still", bag),
    )
    assert np.ptp(still) > 0.1
    # A torque that came too late is carried along its slopes.
    assert np.abs(live - again).max() <= 1e-12 + 0.02 * missed
    shift = start + int(np.median(late))
    span = min(len(still), len(live) - shift)
    difference = np.abs(live[shift : shift + span] - still[:span]).max()
    assert difference <= (0.05 + 0.05 * np.ptp(late)) * np.ptp(still) + 0.02 * missed, "to the step between samples"


# Raw EMG


@pytest.mark.parametrize("quality", QUALITIES.values(), ids=QUALITIES)
def test_raw_emg_is_filtered_as_limb_emg_does(quality, bench, limb, foreign, tmp_path):
    """Chunks of any length, with the layout or without, a channel that is not used, values that are missing."""
    rate, samples = 1000.0, 600
    random = np.random.default_rng(1)
    raw = random.normal(0.0, 1.0, (samples, 3)) * [0.2, 1.0, 50.0] + [0.3, -0.1, 7.0]
    (tmp_path / "emg.csv").write_text(
        "\n".join(["EMG 1 (mV),EMG 2 (mV)", *(f"{a!r},{b!r}" for a, _, b in raw.tolist())]) + "\n"
    )
    maximum = {"EMG 1": 0.2, "EMG 2": 40.0}
    options = EnvelopeOptions(causal=True, mains=50.0, band=(30.0, 400.0), low_pass=8.0, maximum=maximum)
    wanted = envelopes(read_recording(str(tmp_path / "emg.csv"), rate=rate), options).values
    live = Live(
        bench(), limb, emg_rate=rate, channels="EMG 1=extensor,ACC,EMG 2=flexor", maximum="EMG 1=0.2,EMG 2=40",
        mains=50.0, band="30,400", low_pass=8.0, silence=60.0,
    )  # fmt: skip
    publisher = foreign(Float64MultiArray, "emg", quality)
    # Without a value: nothing has begun yet.
    live.first(publisher, Float64MultiArray())
    assert not live.live.used
    row = 0
    for size in [1, 1, 2, 30, 200, 7, 1, 358]:
        block = raw[row : row + size]
        shape = [MultiArrayDimension(size=len(block)), MultiArrayDimension(size=3)] if size % 2 == 0 else []
        live.send(publisher, Float64MultiArray(layout=MultiArrayLayout(dim=shape), data=block.ravel().tolist()))
        row += size
        np.testing.assert_allclose(live.node.newest, wanted[row - 1, ::-1], atol=1e-9)
    assert row == samples
    assert wanted[-1].min() > 0.1
    assert live.step() == live.node.newest.tolist()
    bad = live.node.part.bad_input
    for data in ([1.0, 2.0], [], [float("nan")] * 3, [1e300] * 3):
        live.send(publisher, Float64MultiArray(data=data))
        bad += 1
        assert live.node.part.bad_input == bad
    live.send(publisher, Float64MultiArray(data=[float("inf"), 0.0, 1.0]))
    assert np.isfinite(live.node.newest).all()


REFUSED_LIVE = {
    "no maximum": ({"emg_rate": 1000.0}, "maximum", "flexor"),
    "a maximum of 0": ({"emg_rate": 1000.0, "maximum": "flexor=0,extensor=1"}, "maximum", "flexor"),
    "a maximum that is no number": ({"emg_rate": 1000.0, "maximum": "flexor=a,extensor=1"}, "maximum", "a"),
    "a maximum without a value": ({"emg_rate": 1000.0, "maximum": "flexor,extensor=1"}, "maximum", "missing"),
    "a maximum of no channel": ({"emg_rate": 1000.0, "maximum": "flexor=1,extensor=1,x=1"}, "maximum", "x"),
    "maxima of envelopes": ({"maximum": "flexor=1"}, "emg-rate", "samples per second"),
    "a muscle without a channel": ({"emg_rate": 1000.0, "channels": "a=flexor", "maximum": "a=1"}, "channels", "ext"),
    "two channels of a muscle": ({"channels": "a=flexor,b=flexor"}, "channels", "several"),
    "a channel twice": ({"channels": "a=flexor,a=extensor"}, "channels", "twice"),
    "no muscle": ({"channels": "a=knee"}, "channels", "knee"),
    "no name": ({"channels": "=flexor"}, "channels", "CHANNEL=MUSCLE"),
    "a band above half the rate": ({"emg_rate": 500.0, "maximum": "flexor=1,extensor=1"}, "band-pass", "250"),
    "one edge": ({"emg_rate": 1000.0, "band": "20", "maximum": "flexor=1,extensor=1"}, "band-pass", "LOW,HIGH"),
    "mains of no grid": ({"emg_rate": 1000.0, "mains": 55.0, "maximum": "flexor=1,extensor=1"}, "mains", "55"),
    "a negative rate": ({"emg_rate": -1.0}, "emg-rate", "-1"),
    "a silence of 0": ({"silence": 0.0}, "silence", "0.05"),
}
OPTIONS = {"band": "band-pass", "emg_rate": "emg-rate"}


@pytest.mark.parametrize(("given", "option", "part"), REFUSED_LIVE.values(), ids=REFUSED_LIVE)
def test_live_settings_that_cannot_be(given, option, part, limb, tmp_path, capfd):
    options = [f"--{OPTIONS.get(name, name)}={value}" for name, value in given.items()]
    assert cli.main(["run", limb, "--mode=realtime", "--rate=50", f"--out={tmp_path / 'run'}", *options]) == 2
    said = capfd.readouterr().err
    assert re.fullmatch(rf"limb: error: --{option} .*{re.escape(part)}.*\n", said), said
    assert not (tmp_path / "run").exists()


def test_live_settings_need_a_live_source(limb, tmp_path, capfd):
    out = f"--out={tmp_path / 'run'}"
    assert cli.main(["run", limb, "--activation=flexor=1,extensor=0", "--duration=1", "--on-silence=hold", out]) == 2
    assert re.fullmatch(r"limb: error: --on-silence is hold; .*live.*\n", capfd.readouterr().err)


def test_a_node_names_its_parameter(bench, limb):
    with pytest.raises(Exception, match=r"activation_input: the parameter maximum of flexor is missing; .* needed"):
        bench().add(ActivationInput, limb=limb, mode="realtime", emg_rate=1000.0)


def test_every_option_is_a_parameter_of_the_node(bench, limb):
    node = bench().add(ActivationInput, limb=limb, mode="realtime")
    defaults = LiveSettings()
    for name, value in vars(defaults).items():
        assert node.get_parameter(name).value == value


@pytest.mark.parametrize(("made", "channels"), [(EnvelopeReader, "a=flexor"), (RawReader, "a=flexor,x,extensor")])
def test_a_channel_takes_the_place_of_a_muscle(made, channels):
    settings = LiveSettings(channels=channels, emg_rate=1000.0, maximum="a=1,extensor=1", band="", low_pass=0.0)
    messages = {
        EnvelopeReader: envelope([0.9, 0.25, 0.5], ["flexor", "a", "extensor"]),
        RawReader: Float64MultiArray(data=[0.25, 0.9, 0.5]),
    }
    assert made(MUSCLES, settings).read(messages[made]).tolist() == [0.25, 0.5]


# What is told


@pytest.mark.parametrize(("on_silence", "left"), [("hold", [0.25, 0.75]), ("zero", [0.0, 0.0])])
def test_a_source_that_falls_silent_and_comes_back(on_silence, left, bench, limb, foreign, capfd):
    live = Live(bench(), limb, on_silence=on_silence, silence=LONG_SILENCE)
    publisher = foreign(EmgEnvelope, "emg_envelope", BEST_EFFORT)
    live.first(publisher, envelope([0.25, 0.75]))
    assert live.step() == [0.25, 0.75]
    live.graph.until(lambda: live.live.silent, "silence to be noticed")
    assert live.step() == left
    live.send(publisher, envelope([0.5, 0.5]))
    assert live.step() == [0.5, 0.5]
    assert not live.live.lost
    live.graph.until(lambda: [report["input"] for report in live.reports()][-1:] == ["heard"], "that it is back")
    assert "silent" in [report["input"] for report in live.reports()]
    said = capfd.readouterr().err
    assert said.index("emg_envelope: stopped") < said.index("emg_envelope: heard after")


def test_a_silent_source_stops_the_run_if_asked(bench, limb, foreign):
    live = Live(bench(), limb, on_silence="stop", silence=LONG_SILENCE)
    publisher = foreign(EmgEnvelope, "emg_envelope", RELIABLE)
    live.first(publisher, envelope([0.25, 0.75]))
    live.step()
    assert live.heard[-1].last_tick == -1
    live.graph.until(lambda: live.live.silent, "silence to be noticed")
    live.step()
    last = live.heard[-1].last_tick
    assert live.tick < last <= live.tick + 0.5 * RATE
    while live.heard[-1].tick < last:
        live.step()
    assert not live.node.finished
    # Too late: the nodes know of the end.
    publisher.publish(envelope([0.5, 0.5]))
    header = Header(stamp=stamp_at(last, TICKS))
    live.joints.publish(limb_state(header, last))
    live.graph.until(lambda: live.node.finished, "the end")
    assert list(live.heard[-1].activation) == [0.25, 0.75]
    assert live.live.lost


def test_a_source_that_never_comes_stops_the_run_if_asked(bench, limb, monkeypatch):
    """Later than it is told: the nodes may not have found each other."""
    live = Live(bench(), limb, on_silence="stop")
    now = live_source.time.monotonic()
    monkeypatch.setattr(live_source.time, "monotonic", lambda: now)
    told = None
    while not live.live.gone:
        now += 0.05
        live.live.look()
        told = told or (live.live.age if live.live.silent else None)
    assert SILENCE <= told <= LATEST
    assert live.live.age == pytest.approx(live_source.PATIENCE, abs=0.1)
    monkeypatch.undo()
    assert live.heard[-1].last_tick == -1
    live.step()
    assert live.heard[-1].last_tick > live.tick


def test_sources_of_both_kinds_are_heard_together(bench, limb, foreign):
    """Also if the best-effort one comes last."""
    live = Live(bench(), limb, silence=60.0)
    reliable = foreign(EmgEnvelope, "emg_envelope", RELIABLE)
    live.first(reliable, envelope([0.1, 0.1]))
    best_effort = foreign(EmgEnvelope, "emg_envelope", BEST_EFFORT)

    def heard(publisher: Any, value: float) -> bool:
        publisher.publish(envelope([value, value]))
        live.graph.spin()
        return bool(live.node.newest[0] == value)

    live.graph.until(lambda: heard(best_effort, 0.2), "the best-effort source")
    live.graph.until(lambda: heard(reliable, 0.3), "the reliable source")


def test_a_source_of_another_type_is_named(bench, limb, foreign):
    foreign(String, "emg_envelope", RELIABLE)
    live = Live(bench(), limb)
    live.graph.until(lambda: "std_msgs/msg/String" in live.live.told(), "the type")
    live.graph.until(lambda: live.reports(), "a report")
    assert live.live.told().endswith("stranger publishes std_msgs/msg/String; limb_msgs/msg/EmgEnvelope is needed")


def test_a_pause_of_the_node_is_no_silence(bench, limb, monkeypatch):
    """What comes meanwhile waits for it."""
    live = Live(bench(), limb)
    now = live_source.time.monotonic() + 100.0
    before = live.live.age
    monkeypatch.setattr(live_source.time, "monotonic", lambda: now)
    live.live.look()
    assert 0.0 < live.live.age - before < SILENCE
    assert live.live.silent == (live.live.age >= SILENCE)


# Runs


@dataclass(frozen=True)
class Case:
    """A source beside a run. lasts: how long it sends (s), 0 for one that never comes."""

    lasts: float = 1e9
    quality: str = "reliable"
    names: tuple[str, ...] = ("flexor", "extensor")
    stamped: bool = True
    options: tuple[str, ...] = ()

    @property
    def duration(self) -> str:
        """Long enough for the source to be found late, on a busy machine too, and to stop."""
        return "14" if 0.0 < self.lasts < 14.0 else "8"


# The machine may be busy: those that go on to the end must not be taken for silent.
PATIENT = ("--silence", "60")
CASES = {
    "never": Case(lasts=0.0),
    "best_effort": Case(quality="best effort", options=PATIENT),
    "stops": Case(lasts=2.3, quality="best effort"),
    "stops_hold": Case(lasts=2.3, options=("--on-silence", "hold", "--processes")),
    "stops_stop": Case(lasts=2.3, options=("--on-silence", "stop", "--duration", "600")),
    "names": Case(names=("left", "right")),
    "unstamped": Case(stamped=False, options=PATIENT),
}


@dataclass(frozen=True)
class Run:
    status: int
    printed: str
    said: str
    bag: Path
    reports: list[dict[str, str]]

    @property
    def live(self) -> str:
        """The line of the summary."""
        (line,) = re.findall(r"^live input (.*)$", self.printed, re.MULTILINE)
        return line


@pytest.fixture(scope="module")
def runs(limb, until, tmp_path_factory) -> dict[str, Run]:
    """The runs of all cases, beside each other, with a source each that goes by the ticks of its limb."""
    from tests.graph.conftest import Processes

    folder = tmp_path_factory.mktemp("runs")
    processes = Processes(folder)
    with ExitStack() as stack:
        nodes = {name: stack.enter_context(stranger(name)) for name in CASES}
        executors = [make_executor(node.context) for node in nodes.values()]
        children = {}
        for (name, case), executor in zip(CASES.items(), executors, strict=True):
            executor.add_node(nodes[name])
            play_beside(nodes[name], case)
            children[name] = processes.limb(
                "run", limb, "--mode", "realtime", "--rate", "50", "--duration", case.duration, "--state-every", "50",
                "--namespace", name, "--out", folder / name, *case.options,
            )  # fmt: skip
            stack.callback(children[name].end)

        def turn() -> None:
            for executor in executors:
                executor.spin_once(timeout_sec=0.0)
            executors[0].spin_once(timeout_sec=0.005)

        until(lambda: not any(child.running() for child in children.values()), "the runs to end", idle=turn)
        for executor, node in zip(executors, nodes.values(), strict=True):
            executor.remove_node(node)
    result = {}
    for name, child in children.items():
        with BagReader(folder / name) as bag:
            told = [message for _, message in bag.read_topic("/diagnostics")]
        found = list(reports(told, f"/{name}/activation_input"))
        result[name] = Run(child.wait(), child.printed, child.said, folder / name, found)
    return result


def play_beside(node: Any, case: Case) -> None:
    """Publish after every tick of the limb."""
    if not case.lasts:
        return
    publisher = node.create_publisher(EmgEnvelope, "emg_envelope", QUALITIES[case.quality])

    begun: list[float] = []

    def on_states(message: JointState) -> None:
        seconds = tick_of(message.header.stamp, TICKS) / RATE
        # activation_input and recorder.
        if not begun and publisher.get_subscription_count() < 2:
            return
        begun.append(seconds)
        if seconds - begun[0] < case.lasts:
            publisher.publish(envelope([0.25, 0.75], list(case.names), 100.0 + seconds if case.stamped else 0.0))

    node.create_subscription(JointState, "joint_states", on_states, EVERY)


def test_a_source_that_never_comes(runs):
    run = runs["never"]
    assert run.status == 3
    assert of_source(run)[0]["input"] == "never came"
    assert first_silence(run) <= LATEST
    assert re.search(r"emg_envelope: nothing has come in 0\.[56]", run.said)
    assert re.fullmatch(r"emg_envelope: nothing has come in [\d.]+ s; nobody publishes it", run.live)
    assert run.reports[-1]["messages"] == "0"


def test_a_source_that_is_best_effort(runs):
    run = runs["best_effort"]
    assert run.status == 0
    assert re.fullmatch(r"emg_envelope: (\d+) of \1 messages used", run.live)
    assert [float(value) for value in last_activation(run)] == [0.25, 0.75]
    with BagReader(run.bag) as bag:
        assert bag.count("emg_envelope") > 0
    assert "emg_envelope" not in run.said


@pytest.mark.parametrize(
    ("name", "left"), [("stops", [0.0, 0.0]), ("stops_hold", [0.25, 0.75]), ("stops_stop", [0.25, 0.75])]
)
def test_a_source_that_stops(name, left, runs):
    run = runs[name]
    assert run.status == 3
    first = next(report for report in of_source(run) if report["input"] == "silent")
    assert SILENCE <= float(first["age"]) <= LATEST
    assert re.search(r"emg_envelope: stopped 0\.[56]", run.said)
    assert re.fullmatch(r"emg_envelope: stopped [\d.]+ s ago; (\d+) of \1 messages used", run.live)
    assert of_source(run)[-1]["input"] == "silent"
    assert last_activation(run) == left
    assert "missing    0\n" in run.printed
    if name == "stops_stop":
        # The middleware may print lines of its own before.
        ticks = int(re.findall(r"^ticks +(\d+)", run.printed, re.MULTILINE)[0])
        assert ticks < 300 * RATE


def of_source(run: Run) -> list[dict[str, str]]:
    """What was told of the source; before it is listened to, nothing is."""
    return [report for report in run.reports if "input" in report]


def first_silence(run: Run) -> float:
    """The age (s) with which a source was first told to be silent; what is told every second may come before."""
    return next(age for age in (float(report.get("age", 0.0)) for report in run.reports) if age >= SILENCE)


def last_activation(run: Run) -> list[float]:
    with BagReader(run.bag) as bag:
        return bag.table("activation")["activation"][-1].tolist()


def test_a_source_with_other_names(runs):
    run = runs["names"]
    assert run.status == 3
    expected = "emg_envelope: has left, right; flexor, extensor, muscles of the limb, are needed too"
    assert any(expected in report["message"] for report in run.reports)
    assert expected in run.said
    assert "never came" in [report.get("input") for report in run.reports]
    assert first_silence(run) <= LATEST
    assert "no message that can be used" in run.live
    assert "left, right" in run.live
    assert "0 of" in run.live
    assert re.search(r"^bad input +\d+ messages", run.printed, re.MULTILINE)


def test_a_source_without_stamps(runs):
    run = runs["unstamped"]
    assert run.status == 0
    assert "emg_envelope: stamps are 0" in run.said
    assert next(count for report in of_source(run) if (count := int(report["unstamped"]))) == 1, "told with the first"
    assert re.search(r"stamps are 0 in \d+ messages", run.live)
