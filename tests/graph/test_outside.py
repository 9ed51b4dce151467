"""What acts on a limb from outside: loads on its tip, torques that a controller commands."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import Vector3, Wrench, WrenchStamped
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message, serialize_message
from rosbags.rosbag2 import Reader
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from limb_nodes.exchange.ticks import SECOND, Ticks
from limb_nodes.model import load_limb
from limb_nodes.nodes.activation_input import ActivationInput
from limb_nodes.nodes.limb_dynamics import LimbDynamics
from limb_nodes.nodes.messages import stamp_at, tick_of
from limb_nodes.nodes.muscle_stack import MuscleStack
from limb_nodes.nodes.outside import command_of, load_of
from limb_nodes.nodes.qos import EVERY, LIVE
from limb_nodes.nodes.recorder import Recorder

NAN = float("nan")
RATE = 500.0
TICKS = Ticks(RATE)
# As most drivers of sensors publish.
SENSOR = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=5,
    reliability=ReliabilityPolicy.BEST_EFFORT,
    durability=DurabilityPolicy.VOLATILE,
)


@pytest.fixture(scope="module")
def arm() -> Any:
    return load_limb("params/arm.yaml")


def load(frame: str = "", **parts: float) -> WrenchStamped:
    """A load whose parts are named by vector and axis, as force_x."""
    force = Vector3(**{axis: parts.get(f"force_{axis}", 0.0) for axis in "xyz"})
    torque = Vector3(**{axis: parts.get(f"torque_{axis}", 0.0) for axis in "xyz"})
    return WrenchStamped(header=Header(frame_id=frame), wrench=Wrench(force=force, torque=torque))


@pytest.mark.parametrize(("frame", "turn"), [("", 0.0), ("base", 0.0), ("left/base", 0.0), ("left/upper_arm", 0.3)])
def test_a_load_is_turned_from_its_frame(frame, turn, arm):
    angle = np.array([0.3 - arm.base_angle, 0.4])
    values = load_of(load(frame, force_x=2.0, force_y=1.0, torque_z=0.5), arm, angle, "left/")
    expected = complex(2.0, 1.0) * complex(math.cos(turn), math.sin(turn))
    np.testing.assert_allclose(values, [expected.real, expected.imag, 0.5], rtol=1e-15)


def test_a_load_in_the_frame_of_the_last_segment_turns_with_all_joints(arm):
    angle = np.array([0.3, 0.4])
    values = load_of(load("forearm_and_hand", force_x=1.0), arm, angle, "")
    turn = arm.base_angle + 0.7
    np.testing.assert_allclose(values, [math.cos(turn), math.sin(turn), 0.0], atol=1e-15)


@pytest.mark.parametrize(
    ("message", "said"),
    [
        (load(force_z=1.0), "force.z is 1; the limb moves in the plane x, y, and 0 is needed"),
        (load(force_x=5.0, torque_x=-0.1), "torque.x is -0.1"),
        (load(torque_y=2.0, torque_z=1.0), "torque.y is 2"),
        (load(force_x=NAN), "not finite"),
        (load(force_x=1e9), "a force or torque is 1e.09; 1e.06 in N or N m at most is needed"),
        (load(torque_z=-2e6), "a force or torque is 2e.06"),
        (load(force_z=NAN), "not finite"),
        (load("tool0", force_x=1.0), "frame_id is tool0; one of base, upper_arm, forearm_and_hand is needed"),
        (load("upper_arm\n", force_x=1.0), "frame_id is"),
    ],
    ids=str,
)
def test_a_load_that_a_limb_in_the_plane_cannot_take_is_refused(message, said, arm):
    with pytest.raises(ValueError, match=said):
        load_of(message, arm, np.zeros(2), "")


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"name": ["elbow"], "effort": []}, "has no efforts; a limb is commanded by torques alone"),
        ({"name": ["elbow", "elbow"], "effort": [1.0, 2.0]}, "names elbow a second time; each joint once is needed"),
        ({"name": ["elbow"], "effort": [1e7]}, "an effort is 1e.07; 1e.06 N m at most is needed"),
        ({"name": [], "effort": []}, "0 names and 0 efforts"),
        ({"name": ["elbow"], "effort": [1.0, 2.0]}, "1 names and 2 efforts"),
        ({"name": ["wrist"], "effort": [1.0]}, "names wrist; one of shoulder, elbow is needed"),
        ({"name": ["elbow"], "effort": [NAN]}, "not finite"),
        ({"name": ["elbow"], "position": [1.0]}, "has no efforts; a limb is commanded by torques alone"),
    ],
    ids=str,
)
def test_a_command_that_is_none_is_refused(fields, said, arm):
    with pytest.raises(ValueError, match=said):
        command_of(JointState(**fields), arm)


def test_joints_are_commanded_by_name_in_any_order(arm):
    assert command_of(JointState(name=["elbow", "shoulder"], effort=[1.0, 2.0]), arm).tolist() == [2.0, 1.0]
    assert command_of(JointState(name=["elbow"], effort=[1.0]), arm).tolist() == [0.0, 1.0]


def run_of(graph: Any, limb: str, out: Any, waves: str, duration: float = 0.4, **parameters: Any) -> dict[str, Any]:
    """The nodes of a run in lockstep."""
    common = {"limb": limb, "rate": RATE}
    return {
        "limb_dynamics": graph.add(LimbDynamics, await_recorder=True, **common, **parameters),
        "muscle_stack": graph.add(MuscleStack, **common),
        "activation_input": graph.add(ActivationInput, source=waves, duration=duration, **common),
        "recorder": graph.add(Recorder, out=str(out), **common),
    }


def test_loads_and_commands_of_best_effort_publishers_act_until_they_are_too_old(bench, limb):
    graph = bench()
    node = graph.add(LimbDynamics, limb=limb, rate=RATE, await_recorder=True, load_timeout=0.1, command_timeout=0.2)
    for kind, topic, message, values in (
        (WrenchStamped, "external_load", load(force_x=3.0), node.part.stepper.load),
        (JointState, "joint_command", JointState(name=["joint"], effort=[0.5]), node.part.stepper.command),
    ):
        publisher = graph.publisher(kind, topic, SENSOR)

        def came(publisher: Any = publisher, message: Any = message, values: Any = values) -> bool:
            publisher.publish(message)
            graph.spin()
            return bool(values.any())

        graph.until(came, topic)
    rows = np.zeros((4, 1))
    for _ in range(50):
        assert node.part.stepper.load[0] == 3.0
        node.part.step(rows)
    node.part.step(rows)
    assert (node.part.stepper.load[0], node.part.stepper.command[0]) == (0.0, 0.5)
    told = graph.listen(DiagnosticArray, "/diagnostics", LIVE)

    def level_of(name: str) -> Any:
        found = [status.level for message in told for status in message.status if status.name.endswith(name)]
        return found[-1] if found else None

    graph.until(lambda: level_of("external_load") == DiagnosticStatus.STALE, "that the load is too old")
    graph.until(lambda: level_of("joint_command") == DiagnosticStatus.OK, "that the command acts")


def test_a_command_acts_as_a_torque_of_the_muscles(bench, limb, waves, bags, tmp_path):
    """A constant command and a load that makes the same torque move the limb alike."""
    for name in "command", "load", "neither":
        graph = bench(name)
        nodes = run_of(graph, limb, tmp_path / name, waves, load_timeout=0.0, command_timeout=0.0)
        dynamics = nodes["limb_dynamics"]
        if name == "command":
            dynamics.on_command(JointState(name=["joint"], effort=[0.4]))
        elif name == "load":
            # A torque on the tip of a single segment is one on its joint.
            dynamics.on_load(load(torque_z=0.4))
        graph.until(lambda nodes=nodes: nodes["recorder"].finished, "the end of the run")
        graph.finish(nodes["recorder"])
    found = {
        name: bags.decoded(tmp_path / name, ("joint_states", "joint_torque")) for name in ("command", "load", "neither")
    }
    angle = {name: of["joint_states"]["position"] for name, of in found.items()}
    np.testing.assert_allclose(angle["command"], angle["load"], atol=1e-9)
    assert np.abs(angle["command"] - angle["neither"]).max() > 0.01
    # The effort of a joint is the torque of its muscles and of the command.
    for name, command in ("command", 0.4), ("load", 0.0):
        effort, torque = found[name]["joint_states"]["effort"], found[name]["joint_torque"]["torque"]
        np.testing.assert_array_equal(effort, torque + command)


def play_controller(graph: Any, node: Any) -> list[float]:
    """A controller with a spring and a damper, which answers each joint_states; the torques that it commands."""
    sent: list[float] = []
    commands = graph.probe.create_publisher(JointState, "joint_command", EVERY)

    def answer(state: JointState) -> None:
        sent.append(-3.0 * state.position[0] - 0.3 * state.velocity[0])
        header = Header(stamp=state.header.stamp)
        commands.publish(JointState(header=header, name=list(state.name), effort=[sent[-1]]))

    graph.probe.create_subscription(JointState, "joint_states", answer, EVERY)
    graph.until(lambda: node.count_publishers("joint_command") and commands.get_subscription_count() > 1, "controller")
    return sent


def test_lockstep_waits_for_a_controller(bench, limb, waves, bags, tmp_path):
    """The same values in every run, and those of a controller that acts at once."""
    runs = []
    for number in range(2):
        graph = bench(f"run{number}")
        nodes = run_of(graph, limb, tmp_path / f"run{number}", waves, command_every=1)
        sent = play_controller(graph, nodes["limb_dynamics"])
        graph.until(lambda nodes=nodes: nodes["recorder"].finished, "the end of the run")
        graph.finish(nodes["recorder"])
        # The answer to the last tick comes when nobody needs it.
        runs.append(sent[:200])
        assert nodes["limb_dynamics"].part.bad_input == 0
    assert runs[0] == runs[1]
    assert len(runs[0]) == 200
    assert bags.differences(tmp_path / "run0", tmp_path / "run1") == []
    pattern = bags.decoded(tmp_path / "run0", ("movement_pattern",))["movement_pattern"]
    np.testing.assert_array_equal(pattern["command"][1:, 0], runs[0])


def test_who_waits_for_a_controller_says_so(bench, limb, waves, tmp_path, capfd):
    graph = bench()
    nodes = run_of(graph, limb, tmp_path / "run", waves, command_every=5, stall_limit=2.0)
    graph.until(lambda: nodes["limb_dynamics"].failure, "it to give up")
    assert "has waited 2 s for joint_command of tick 0 from a controller" in nodes["limb_dynamics"].failure[0]
    assert "waits for joint_command of tick 0 from a controller" in capfd.readouterr().err


def test_who_comes_late_gets_the_newest_joint_states(bench, limb, waves, tmp_path):
    graph = bench()
    nodes = run_of(graph, limb, tmp_path / "run", waves, duration=600.0)
    dynamics = nodes["limb_dynamics"]
    graph.until(lambda: dynamics.part.tick > 100, "the first ticks")
    heard: list[tuple[int, int]] = []

    def hear(state: JointState) -> None:
        heard.append((tick_of(state.header.stamp, TICKS), dynamics.part.tick))

    graph.probe.create_subscription(JointState, "joint_states", hear, EVERY)
    graph.until(lambda: heard, "joint states")
    assert heard[0][0] >= heard[0][1] - 10
    (info,) = graph.probe.get_publishers_info_by_topic("joint_states")
    assert info.qos_profile.durability == DurabilityPolicy.VOLATILE
    hidden = [name for name, _ in graph.probe.get_topic_names_and_types() if "/_run/" in name]
    assert "/_run/limb_state" in hidden


def test_joint_states_have_frame_effort_and_time(bench, limb, waves, tmp_path):
    graph = bench("left")
    nodes = run_of(graph, limb, tmp_path / "run", waves, publish_clock=True)
    states, clock = graph.listen(JointState, "joint_states", EVERY), graph.listen(Clock, "/clock", EVERY)
    graph.until(lambda: nodes["recorder"].finished, "the end of the run")
    graph.until(lambda: states and tick_of(states[-1].header.stamp, TICKS) == 200, "the last joint states")
    assert {state.header.frame_id for state in states} == {"left/base"}
    assert all(len(state.effort) == 1 for state in states)
    graph.until(lambda: clock and clock[-1].clock == stamp_at(200, TICKS), "the last time")
    times = [message.clock.sec * SECOND + message.clock.nanosec for message in clock]
    assert times == sorted(times)


@pytest.mark.parametrize(
    ("other", "said"),
    [
        ({"rate": 200.0}, "has the rate 500; the parameter rate is 200, and the same is needed"),
        ({"mode": "realtime"}, "has the mode lockstep; the parameter mode is realtime, and the same is needed"),
        ({"limb": "params/reference_joint.yaml"}, "has another limb than params/reference_joint.yaml"),
    ],
    ids=["rate", "mode", "limb"],
)
def test_nodes_that_do_not_fit_together_are_told_so_before_the_first_tick(other, said, bench, limb):
    graph = bench()
    dynamics = graph.add(LimbDynamics, limb=limb, rate=RATE)
    node = graph.add(MuscleStack, **{"limb": limb, "rate": RATE, **other})
    graph.until(lambda: node.failure, "the node to be told")
    assert f"muscle_stack: the run in place, {dynamics.part.identity[:8]}..., {said}" in node.failure[0]
    assert (dynamics.failure, dynamics.part.tick) == (None, 0)


def test_diagnostics_are_ok_again_after_a_while(bench, limb, monkeypatch):
    from limb_nodes.nodes import health

    graph = bench()
    told = graph.listen(DiagnosticArray, "/diagnostics", LIVE)
    node = graph.add(LimbDynamics, limb=limb, rate=RATE, stall_limit=1e6)

    def newest() -> Any:
        return told[-1].status[0] if told else None

    graph.until(lambda: newest() and newest().level == DiagnosticStatus.OK, "the first report")
    assert newest().hardware_id == node.limb.name
    assert {pair.key: pair.value for pair in newest().values}["run"] == node.part.identity
    now = health.time.monotonic()
    monkeypatch.setattr(health.time, "monotonic", lambda: now)
    node.part.refuse("joint_command: nothing")
    node.report()
    graph.until(lambda: (newest().level == DiagnosticStatus.WARN and "lately") or "last 10 s" in newest().message, "it")
    graph.until(lambda: {pair.key: pair.value for pair in newest().values}.get("last_refused"), "what was refused")
    assert {pair.key: pair.value for pair in newest().values}["last_refused"] == "joint_command: nothing"
    now += health.WINDOW + 1.0
    node.report()
    monkeypatch.undo()
    graph.until(lambda: newest().level == DiagnosticStatus.OK, "that all is well again")
    assert {pair.key: pair.value for pair in newest().values}["bad_input"] == "1"


def test_bytes_of_joint_states_are_those_of_ros(bench, limb):
    """What is made without rclpy is read by it, and the other way round."""
    graph = bench()
    node = graph.add(LimbDynamics, limb=limb, rate=RATE)
    data = bytes(node.part.joint_states.form.data)
    message = deserialize_message(data, JointState)
    assert list(message.name) == ["joint"]
    assert len(serialize_message(message)) - len(data) in range(4)


def test_a_bag_offers_its_topics_as_they_are_offered_live(bench, limb, waves, tmp_path):
    """So that who subscribes a limb that is played gets what it gets of one that runs."""
    graph = bench()
    nodes = run_of(graph, limb, tmp_path / "run", waves)
    graph.until(lambda: nodes["recorder"].finished, "the end")
    live = {end.topic_name: end.qos_profile for node in nodes.values() for end in node.publishers}
    graph.finish(nodes["recorder"])
    compared = []
    with Reader(tmp_path / "run") as bag:
        for connection in bag.connections:
            if (profile := live.get(connection.topic)) is None:
                continue
            (offered,) = connection.ext.offered_qos_profiles
            for field in "history", "reliability", "durability":
                assert getattr(offered, field).name == getattr(profile, field).name, f"{connection.topic}: {field}"
            assert offered.depth == profile.depth, connection.topic
            compared.append(connection.topic)
    public = {"/activation", "/joint_states", "/joint_torque", "/movement_pattern", "/muscle_state", "/diagnostics"}
    assert public | {"/motor_unit_state", "/sarcomere_state", "/robot_description"} == set(compared)
