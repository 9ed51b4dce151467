"""In lockstep the graph is the model, whatever the timing and however the nodes are started."""

from __future__ import annotations

import signal
import sys
from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag2 import Reader

from limb_nodes.bags.read import BagReader
from limb_nodes.cli import main
from limb_nodes.model import load_limb
from limb_nodes.nodes.session import CLASSES, run_in_one_process, run_in_processes
from limb_nodes.nodes.settings import RunSettings, checked
from limb_nodes.signals.activation import load_activation
from limb_nodes.solve.stepping import LimbStepper, MuscleStepper
from limb_nodes.solve.whole import WholeModel
from tests.independent.random_limb import RandomLimb

NODES = ("activation_input", "muscle_stack", "limb_dynamics", "recorder")
TICKS, RATE, PERIOD_NS = 501, 1000.0, 1_000_000


def parameters(node: str, limb: str, source: str, out: Path, seconds: float = 0.5) -> dict[str, object]:
    """What a person gives each node by hand."""
    own: dict[str, dict[str, object]] = {
        "activation_input": {"source": source, "duration": seconds},
        "limb_dynamics": {"await_recorder": True},
        "recorder": {"out": str(out)},
    }
    return {"limb": limb, "rate": RATE, **own.get(node, {})}


def test_every_tick_is_there_once_on_every_topic(reference, bags):
    bags.complete(reference, TICKS, PERIOD_NS)


def test_the_bag_suffices_to_run_again(reference, limb, bags, tmp_path, own_signals):
    with BagReader(reference) as bag:
        info = bag.run_info()
        assert bag.count("robot_description") == 1
    with Reader(reference) as reader:
        assert next(iter(reader.messages()))[0].topic == "/run_info"
    assert info["limb"] == Path(limb).read_text()
    assert set(info["parameters"]) == set(NODES)
    assert info["versions"].keys() >= {"limb_nodes", "python", "numpy", "numba"}
    again = tmp_path / "limb.yaml"
    again.write_text(info["limb"])
    own = info["parameters"]["activation_input"]
    run, _ = checked(RunSettings(str(again), own["source"], own["rate"], own["duration"], str(tmp_path / "again")))
    run_in_one_process(run, lambda tick: None)
    assert bags.differences(reference, tmp_path / "again") == []


def test_four_processes_give_the_same_values(reference, limb, waves, bags, tmp_path, own_signals):
    run, _ = checked(RunSettings(limb, waves, RATE, 0.5, str(tmp_path / "run")))
    seen: list[int] = []
    outcome = run_in_processes(run, seen.append)
    assert (outcome.ticks, outcome.missing, outcome.bad_input) == (TICKS, 0, 0)
    assert outcome.work.startswith("flexor, extensor: shorten by ")
    assert bags.differences(reference, tmp_path / "run") == []


def test_muscles_over_two_joints_in_one_process_and_in_four(bags, tmp_path, own_signals):
    """Also when run again from the bag."""
    leg = str(Path(__file__).parents[1] / "levels" / "two_joint_leg.yaml")
    constant = ",".join(f"{name}={0.3 + 0.05 * place:.2f}" for place, name in enumerate(load_limb(leg).muscle_names))
    one, four = (checked(RunSettings(leg, constant, RATE, 0.3, str(tmp_path / name)))[0] for name in ("one", "four"))
    run_in_one_process(one, lambda tick: None)
    run_in_processes(four, lambda tick: None)
    assert bags.differences(tmp_path / "one", tmp_path / "four") == []
    with BagReader(tmp_path / "one") as bag:
        torque, state = bag.table("joint_torque"), bag.table("muscle_state")
    assert torque["slope_angle"].shape == (301, 9)
    slopes = torque["slope_velocity"][150].reshape(3, 3)
    # The hip's torque and the ankle's do not depend on each other: no muscle crosses both.
    assert slopes[0, 2] == slopes[2, 0] == 0.0
    assert abs(slopes[0, 1]) > 0.0
    on_knee = state["torque_joint"] == "knee"
    np.testing.assert_allclose(state["torque"][:, on_knee].sum(axis=1), torque["torque"][:, 1], rtol=1e-9, atol=1e-9)
    assert main(["rerun", str(tmp_path / "one"), "--out", str(tmp_path / "again")]) == 0
    assert bags.differences(tmp_path / "one", tmp_path / "again") == []


def test_impacts_within_ticks_in_one_process_and_in_four(bags, tmp_path, own_signals):
    """A limb of five joints that meets the ends of its ranges: equal values, and those of the whole model."""
    other = RandomLimb(0)
    file = tmp_path / "limb.yaml"
    file.write_text(other.yaml())
    model = load_limb(file)
    constant = ",".join(f"{name}=0.9" for name in model.muscle_names)
    one, four = (
        checked(RunSettings(str(file), constant, 200.0, 0.6, str(tmp_path / name)))[0] for name in ("one", "four")
    )
    run_in_one_process(one, lambda tick: None)
    run_in_processes(four, lambda tick: None)
    assert bags.differences(tmp_path / "one", tmp_path / "four") == []
    with BagReader(tmp_path / "one") as bag:
        pattern = bag.table("movement_pattern")
        assert not any("impact" in topic for topic in bag.topics)
    assert pattern["impacts"][-1] > 3
    excitation = np.full((121, len(model.muscles)), 0.9)
    whole = WholeModel(model).simulate(excitation, 200.0, observe=False)
    assert np.abs(whole.angle - pattern["angle"]).max() < 5e-4


@pytest.mark.parametrize(
    ("order", "script"),
    [
        (("recorder", "limb_dynamics", "muscle_stack", "activation_input"), False),
        (("muscle_stack", "activation_input", "recorder", "limb_dynamics"), True),
    ],
    ids=["as modules", "as installed scripts"],
)
def test_nodes_started_by_hand_all_at_once(
    order, script, reference, limb, waves, bags, processes, monkeypatch, tmp_path
):
    """By the transport that a user has."""
    monkeypatch.delenv("FASTDDS_BUILTIN_TRANSPORTS")
    if script and not Path(sys.prefix, "lib/limb_nodes/recorder").exists():
        pytest.skip("limb-nodes is not installed in this environment")
    out = tmp_path / "run"
    started = {name: processes.node(name, script=script, **parameters(name, limb, waves, out)) for name in order}
    assert {name: child.wait() for name, child in started.items()} == dict.fromkeys(order, 0)
    assert {name: child.said for name, child in started.items()} == dict.fromkeys(order, "")
    assert bags.differences(reference, out) == []


def test_nodes_started_by_hand_one_after_the_other(reference, limb, waves, bags, processes, bench, tmp_path):
    """Each only when the one before shows in the graph, the recorder last."""
    out, probe = tmp_path / "run", bench()
    started = {}
    for name in "activation_input", "limb_dynamics", "muscle_stack":
        started[name] = processes.node(name, **parameters(name, limb, waves, out))
        probe.until(lambda name=name: name in probe.probe.get_node_names(), f"{name} in the graph")
    # It may be done before it is looked for.
    started["recorder"] = processes.node("recorder", **parameters("recorder", limb, waves, out))
    assert {name: child.wait() for name, child in started.items()} == dict.fromkeys(started, 0)
    assert bags.differences(reference, out) == []


def test_a_node_that_is_started_anew_before_the_run(reference, limb, waves, bags, processes, bench, tmp_path):
    """The recorder has asked it for its parameters while it was loading its limb, and gets no answer."""
    graph, out = bench(), tmp_path / "run"
    given = {name: parameters(name, limb, waves, out) for name in NODES}
    for name in "activation_input", "limb_dynamics":
        graph.add(CLASSES[name], **given[name])
    recorder = graph.add(CLASSES["recorder"], **given["recorder"])
    first = processes.node("muscle_stack", **given["muscle_stack"])
    graph.until(lambda: "muscle_stack" in recorder.asked, "the question")
    first.signal(signal.SIGKILL)
    first.wait()
    assert "muscle_stack" not in recorder.parameters
    second = processes.node("muscle_stack", **given["muscle_stack"])
    graph.until(lambda: recorder.finished, "the end")
    graph.finish(recorder)
    assert second.wait() == 0
    assert bags.differences(reference, out) == []


def test_a_late_recorder_gets_every_tick_within_the_history(limb, waves, bags, bench, tmp_path):
    from limb_nodes.exchange.stream import HISTORY
    from limb_nodes.nodes.activation_input import ActivationInput
    from limb_nodes.nodes.limb_dynamics import LimbDynamics
    from limb_nodes.nodes.muscle_stack import MuscleStack
    from limb_nodes.nodes.recorder import Recorder

    graph = bench()
    common = {"limb": limb, "rate": RATE}
    graph.add(ActivationInput, source=waves, duration=0.4, **common)
    graph.add(MuscleStack, **common)
    dynamics = graph.add(LimbDynamics, **common)
    graph.until(lambda: dynamics.finished, "the run to end without a recorder")
    assert dynamics.part.tick == 400 < HISTORY
    recorder = graph.add(Recorder, out=str(tmp_path / "run"), **common)
    graph.until(lambda: recorder.finished, "the recorder to have every tick")
    assert recorder.part.missing() == 0
    graph.finish(recorder)
    bags.complete(tmp_path / "run", 401, PERIOD_NS)


def test_two_limbs_at_once_do_not_disturb_each_other(reference, limb, waves, bags, bench, until, tmp_path):
    """Both in one domain, tick by tick at the same time, driven differently."""
    from limb_nodes.nodes.session import CLASSES

    graphs, recorders = [], []
    for namespace, source in ("left", waves), ("right", "flexor=0.9,extensor=0"):
        graph = bench(namespace)
        made = {
            name: graph.add(CLASSES[name], **parameters(name, limb, source, str(tmp_path / namespace)))  # type: ignore[arg-type]
            for name in NODES
        }
        graphs.append(graph)
        recorders.append(made["recorder"])

    def turn() -> None:
        for graph in graphs:
            graph.executor.spin_once(timeout_sec=0.001)

    until(lambda: all(recorder.finished for recorder in recorders), "the end of both runs", idle=turn)
    for graph, recorder in zip(graphs, recorders, strict=True):
        graph.finish(recorder)
    assert bags.differences(reference, tmp_path / "left") == []
    left, right = (bags.decoded(tmp_path / name, ("activation", "joint_states")) for name in ("left", "right"))
    assert np.all(right["activation"]["activation"] == [0.9, 0.0])
    assert right["joint_states"]["position"].shape == left["joint_states"]["position"].shape
    assert abs(right["joint_states"]["position"][-1] - left["joint_states"]["position"][-1]) > 0.01
    with BagReader(tmp_path / "right") as bag:
        assert "/right/joint_states" in bag.topics


def test_the_graph_equals_the_steppers(reference, limb, waves, bags):
    """The same numbers to the last bit as without ROS."""
    found = bags.decoded(reference)
    model = load_limb(limb)
    activation = load_activation(waves, model.muscle_names, RATE, 0.5).values
    muscles, chain = MuscleStepper(model), LimbStepper(model)
    period = PERIOD_NS * 1e-9
    drives = [muscles.drive(row) for row in activation]
    before, last = (chain.angle.copy(), chain.velocity.copy()), None
    for k in range(TICKS):
        angle, velocity = chain.angle.copy(), chain.velocity.copy()
        if k:
            muscles.advance(before, (angle, velocity), drives[k - 1], drives[k], period, last)
            last = drives[k - 1]
        rows = muscles.torque(angle, velocity, drives[k], drives[min(k + 1, TICKS - 1)], period, last)
        states, units = muscles.observe(angle, velocity, activation[k])
        expected = {
            "activation.activation": activation[k],
            "joint_states.position": angle,
            "joint_states.velocity": velocity,
            "joint_torque.torque": rows[0],
            "joint_torque.slope_time": rows[1],
            "joint_torque.slope_angle": rows[2],
            "joint_torque.slope_velocity": rows[3],
            "movement_pattern.angle": angle,
            "movement_pattern.acceleration": chain.acceleration(rows),
        }
        for name, value in expected.items():
            topic, field = name.split(".")
            np.testing.assert_array_equal(found[topic][field][k], value, err_msg=f"{name} at tick {k}")
        assert np.isin(found["muscle_state"]["muscle_force"][k], states).all()
        assert np.isin(found["sarcomere_state"]["length"][k], units).all()
        before = angle, velocity
        chain.step(rows, period)


@pytest.mark.parametrize("name", ["reference_joint", "reference_joint_tendon"])
def test_the_graph_follows_the_whole_model(name, limb, waves, bags, tmp_path, own_signals):
    file = str(Path(limb).with_name(f"{name}.yaml"))
    run, _ = checked(RunSettings(file, waves, RATE, 2.0, str(tmp_path / "run"), states=()))
    assert run_in_one_process(run, lambda tick: None).missing == 0
    model = load_limb(file)
    movement = WholeModel(model).simulate(load_activation(waves, model.muscle_names, RATE, 2.0).values, RATE)
    graph = bags.decoded(tmp_path / "run", ("joint_states",))["joint_states"]["position"]
    assert np.abs(graph - movement.angle).max() < 2e-5


def test_states_every_few_ticks_or_not_at_all(reference, limb, waves, bags, tmp_path, own_signals):
    run, _ = checked(
        RunSettings(limb, waves, RATE, 0.2, str(tmp_path / "few"), states=("muscle_state",), state_every=50)
    )
    outcome = run_in_one_process(run, lambda tick: None)
    assert (outcome.ticks, outcome.missing) == (201, 0)
    full = bags.decoded(reference)
    few = bags.decoded(tmp_path / "few", ("joint_states", "muscle_state"))
    np.testing.assert_array_equal(few["muscle_state"]["tick"], np.arange(0, 201, 50))
    np.testing.assert_array_equal(few["muscle_state"]["torque"], full["muscle_state"]["torque"][:201:50])
    with BagReader(tmp_path / "few") as bag:
        assert not bag.has("motor_unit_state")


@pytest.mark.parametrize(("every", "ticks"), [(1000, 4), (1, 2)])
def test_the_shortest_runs_are_complete(every, ticks, limb, waves, bags, tmp_path, own_signals):
    """Shorter than one interval of states, and one tick long."""
    run, _ = checked(RunSettings(limb, waves, RATE, (ticks - 1) / RATE, str(tmp_path / "run"), state_every=every))
    outcome = run_in_one_process(run, lambda tick: None)
    assert (outcome.ticks, outcome.missing) == (ticks, 0)
    found = bags.decoded(tmp_path / "run")
    assert [len(found[topic]["time"]) for topic in ("activation", "joint_torque", "movement_pattern")] == [ticks] * 3
    assert len(found["muscle_state"]["time"]) == -(-ticks // every)


def test_a_run_of_one_tick_in_processes(limb, waves, bags, tmp_path, own_signals):
    run, _ = checked(RunSettings(limb, waves, RATE, 1 / RATE, str(tmp_path / "run")))
    assert run_in_processes(run, lambda tick: None).ticks == 2
    bags.complete(tmp_path / "run", 2, PERIOD_NS)
