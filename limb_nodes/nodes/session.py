"""A whole run: the four nodes in one process, or each in its own."""

from __future__ import annotations

import gc
import os
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import Int64

from limb_nodes.errors import FieldError, UserError
from limb_nodes.nodes.activation_input import ActivationInput
from limb_nodes.nodes.base import NODES
from limb_nodes.nodes.limb_dynamics import LimbDynamics
from limb_nodes.nodes.muscle_stack import MuscleStack
from limb_nodes.nodes.qos import LATCHED
from limb_nodes.nodes.recorder import Recorder
from limb_nodes.nodes.running import PARENT, Interrupt, check_namespace, close, make_executor

CLASSES = {
    "activation_input": ActivationInput,
    "muscle_stack": MuscleStack,
    "limb_dynamics": LimbDynamics,
    "recorder": Recorder,
}
# How long nodes in processes of their own may take to the first tick (s); a slow machine compiles a limb for minutes.
STARTING = 300.0
# How long they may take to end when asked to: a recorder may have much to write.
ENDING = 60.0
# How long other nodes of the domain may take to be found (s).
DISCOVERY = 1.0
ERROR = "limb: error: "
# How often to look for another run on the same topics (s), and for how long after the first tick: of two runs
# the one that came later gives way.
COMPANY_PERIOD = 0.25
WATCHED = 5.0
# Longest run (s).
LONGEST = 1e9


@dataclass(frozen=True)
class Run:
    """What to run. limb: YAML file. source: of activations, empty for live input. rate: Hz.

    duration: s, 0 for the whole source. namespace: of all nodes. states: topics of states to
    record, every `state_every` ticks.
    """

    limb: str
    source: str
    rate: float
    duration: float
    out: str
    mode: str = "lockstep"
    namespace: str = ""
    states: tuple[str, ...] = ("muscle_state", "motor_unit_state", "sarcomere_state")
    state_every: int = 1
    command: str = ""

    def parameters(self, node: str) -> dict[str, Any]:
        """The ROS parameters of a node."""
        common = {"limb": self.limb, "mode": self.mode, "rate": self.rate}
        own: dict[str, dict[str, Any]] = {
            "activation_input": {"source": self.source, "duration": self.duration},
            "muscle_stack": {
                "state_every": self.state_every,
                **{
                    f"publish_{topic}": topic in self.states
                    for topic in ("muscle_state", "motor_unit_state", "sarcomere_state")
                },
            },
            "limb_dynamics": {"await_recorder": True},
            "recorder": {"out": self.out, "command": self.command},
        }
        return {**common, **own[node]}


@dataclass(frozen=True)
class Outcome:
    """How a run went. ticks: on the topic joint_states; missing: ticks not in the bag, over all topics;
    missed: deadlines in real time; bad_input: messages that could not be used; seconds: wall time.
    """

    ticks: int
    missing: int
    missed: int
    bad_input: int
    seconds: float
    interrupted: bool


Progress = Callable[[int], None]


def run_in_one_process(run: Run, progress: Progress) -> Outcome:
    """Run the nodes in this process. `progress` is called with the newest recorded tick."""
    interrupt = Interrupt()
    context = Context()
    rclpy.init(context=context, signal_handler_options=SignalHandlerOptions.NO)
    executor = make_executor(context)
    nodes: dict[str, Any] = {}
    try:
        refuse_neighbours(context, run.namespace)
        for name in NODES:
            overrides = [Parameter(key, value=value) for key, value in run.parameters(name).items()]
            nodes[name] = CLASSES[name](context=context, parameter_overrides=overrides, namespace=run.namespace or None)
            executor.add_node(nodes[name])
        gc.collect()
        gc.freeze()
        recorder, dynamics = nodes["recorder"], nodes["limb_dynamics"]
        started = None
        shown = -2
        looked = 0.0
        while not (recorder.finished or interrupt.wanted):
            executor.spin_once(timeout_sec=0.05)
            if started is None and dynamics.tick > 0:
                started = time.monotonic()
            if recorder.announced != shown:
                shown = recorder.announced
                progress(shown)
            # Also where nothing gets on: a neighbour's messages may be why.
            if time.monotonic() - looked > COMPANY_PERIOD and watching(started):
                looked = time.monotonic()
                refuse_company(dynamics)
            for node in nodes.values():
                if node.failure:
                    raise UserError(node.failure)
        ended = time.monotonic()
        return Outcome(
            ticks=recorder.counts["joint_states"],
            missing=recorder.missing(),
            missed=dynamics.missed,
            bad_input=sum(node.bad_input for node in nodes.values()),
            seconds=ended - (started or ended),
            interrupted=interrupt.wanted,
        )
    finally:
        close(context, executor, nodes.values())
        gc.unfreeze()


def watching(started: float | None) -> bool:
    """Whether a run that had its first tick then (s), or none yet, looks for others."""
    return started is None or time.monotonic() - started < WATCHED


def refuse_company(node: Any) -> None:
    """Raise FieldError if another limb publishes on the same topics."""
    if node.count_publishers("joint_states") > 1:
        raise FieldError(
            "namespace",
            f"is {node.get_namespace()}, where another run publishes {node.resolve_topic_name('joint_states')} too; "
            "another one, or another ROS_DOMAIN_ID, is needed",
        )


def run_in_processes(run: Run, progress: Progress) -> Outcome:
    """Run each node in a process of its own."""
    interrupt = Interrupt()
    context = Context()
    rclpy.init(context=context, signal_handler_options=SignalHandlerOptions.NO)
    observer = rclpy.create_node("limb_run", context=context, namespace=run.namespace or None)
    recorded = {"tick": -2}
    observer.create_subscription(
        Int64, "recorder_progress", lambda message: recorded.update(tick=message.data), LATCHED
    )
    executor = make_executor(context)
    children: dict[str, Child] = {}
    try:
        refuse_neighbours(context, run.namespace)
        executor.add_node(observer)
        for name in NODES:
            children[name] = Child(run, name)
        begun = time.monotonic()
        started = None
        while children["recorder"].status is None and not interrupt.wanted:
            executor.spin_once(timeout_sec=0.05)
            progress(recorded["tick"])
            if watching(started):
                refuse_company(observer)
            if started is None and recorded["tick"] > 0:
                started = time.monotonic()
            for child in children.values():
                if child.status not in (None, 0):
                    stop(children)
                    raise UserError(child.complaint())
            if started is None and time.monotonic() - begun > STARTING:
                raise UserError(f"no tick within {STARTING:g} s; {why_nothing_comes(observer)}")
        ended = time.monotonic()
        stop(children)
        if interrupt.wanted and not Path(run.out).exists():
            return Outcome(0, 0, 0, 0, 0.0, True)
        if children["recorder"].status != 0:
            raise UserError(children["recorder"].complaint())
        return recorded_outcome(run, ended - (started or ended), interrupt.wanted)
    finally:
        stop(children)
        close(context, executor, [observer])


def why_nothing_comes(observer: Any) -> str:
    """What to look at where a run does not begin."""
    there = {name for name, where in observer.get_node_names_and_namespaces() if where == observer.get_namespace()}
    silent = [name for name in NODES if name not in there]
    if silent:
        return f"not heard of {', '.join(silent)}: does ROS_AUTOMATIC_DISCOVERY_RANGE let nodes find each other?"
    return "all nodes are there: is the machine too busy, or another run using the same topics?"


class Child:
    """A node in a process of its own. What it says goes on to standard error; its errors are kept."""

    def __init__(self, run: Run, name: str) -> None:
        self.name = name
        self.said: deque[str] = deque(maxlen=20)
        arguments = ["--ros-args"]
        if run.namespace:
            arguments += ["-r", f"__ns:={'' if run.namespace.startswith('/') else '/'}{run.namespace}"]
        for key, value in run.parameters(name).items():
            text = str(value).lower() if isinstance(value, bool) else value
            # Quoted, so that a text such as 'yes' or '1' stays a text.
            given = "'" + str(value).replace("'", "''") + "'" if isinstance(value, str) else text
            arguments += ["-p", f"{key}:={given}"]
        self.handle = subprocess.Popen(
            [sys.executable, "-m", f"limb_nodes.nodes.{name}", *arguments],
            stderr=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stdin=subprocess.DEVNULL,
            text=True,
            errors="replace",
            # Ctrl-C goes to this process alone, which then ends the others in order.
            start_new_session=True,
            env={**os.environ, PARENT: str(os.getpid())},
        )
        # Read all the time: a child whose pipe is full would stand still.
        self.reader = threading.Thread(target=self._read, daemon=True)
        self.reader.start()

    def _read(self) -> None:
        assert self.handle.stderr is not None
        for line in self.handle.stderr:
            self.said.append(line.rstrip("\n"))
            if not line.startswith(ERROR):
                print(line, end="", file=sys.stderr)

    @property
    def status(self) -> int | None:
        """The exit status, None while it runs."""
        return self.handle.poll()

    def end(self) -> None:
        """End it by its own handle."""
        if self.status is None:
            self.handle.terminate()
            try:
                self.handle.wait(ENDING)
            except subprocess.TimeoutExpired:
                self.handle.kill()
                self.handle.wait()
        self.reader.join(ENDING)

    def complaint(self) -> str:
        """What a node that failed has said."""
        self.reader.join(ENDING)
        lines = [line.removeprefix(ERROR) for line in self.said if line.startswith(ERROR)]
        return lines[-1] if lines else f"the node {self.name} ended with status {self.status}"


def stop(children: dict[str, Child]) -> None:
    """End all nodes, the recorder last."""
    for name in ("activation_input", "limb_dynamics", "muscle_stack", "recorder"):
        if name in children:
            children[name].end()


def refuse_neighbours(context: Context, namespace: str) -> None:
    """Raise FieldError if nodes of another run use the same topics: each would take the other's messages."""
    full = f"/{namespace.strip('/')}"
    probe = rclpy.create_node("limb_run_probe", context=context, namespace=full, start_parameter_services=False)
    try:
        end = time.monotonic() + DISCOVERY
        while time.monotonic() < end:
            found = [name for name, where in probe.get_node_names_and_namespaces() if name in NODES and where == full]
            # Publishers can be known before the name of their node.
            if not found and probe.count_publishers("joint_states"):
                found = ["limb_dynamics"]
            if found:
                raise FieldError(
                    "namespace",
                    f"is {full}, where a node {found[0]} runs already, perhaps of another run; another one, or another "
                    "ROS_DOMAIN_ID, is needed",
                )
            time.sleep(0.02)
    finally:
        probe.destroy_node()


def recorded_outcome(run: Run, seconds: float, interrupted: bool) -> Outcome:
    """Count what the bag of a run holds."""
    from limb_nodes.bags.read import BagReader

    with BagReader(run.out) as bag:
        ticks = bag.count("joint_states")
        expected = ["activation", "joint_torque", "movement_pattern", *run.states]
        missing = 0
        for topic in expected:
            every = run.state_every if topic in run.states else 1
            missing += max(0, -(-ticks // every) - bag.count(topic))
        missed, bad_input = 0, dict.fromkeys(NODES, 0)
        if bag.has("/diagnostics"):
            nodes = {f"/{run.namespace.strip('/')}/{name}".replace("//", "/"): name for name in NODES}
            for _, message in bag.read_topic("/diagnostics"):
                for status in message.status:
                    if status.name in nodes:
                        values = {pair.key: int(pair.value) for pair in status.values}
                        missed = max(missed, values.get("missed_deadlines", 0))
                        name = nodes[status.name]
                        bad_input[name] = max(bad_input[name], values.get("bad_input", 0))
    return Outcome(ticks, missing, missed, sum(bad_input.values()), seconds, interrupted)


def checked(run: Run) -> tuple[Run, int | None]:
    """Check a run before anything is written; the run with absolute paths and its last tick."""
    from limb_nodes.bags.folder import refuse_existing
    from limb_nodes.model import load_limb
    from limb_nodes.nodes.ticks import Ticks
    from limb_nodes.signals.activation import load_activation

    limb = load_limb(run.limb)
    Ticks(run.rate)
    check_namespace(run.namespace)
    refuse_existing(Path(run.out))
    if run.duration and not 1 / run.rate <= run.duration <= LONGEST:
        raise FieldError(
            "duration", f"is {run.duration:g}; a number from {1 / run.rate:g}, one tick, to {LONGEST:g} in s is needed"
        )
    final = round(run.duration * run.rate) if run.duration else None
    if run.source:
        activation = load_activation(run.source, limb.muscle_names, run.rate, run.duration or None)
        final = len(activation.values) - 1
    elif run.mode == "lockstep":
        raise FieldError("source", "is missing; in lockstep a bag, CSV, waveform YAML or constants are needed")
    source = str(Path(run.source).resolve()) if run.source and Path(run.source).exists() else run.source
    return replace(run, limb=str(Path(run.limb).resolve()), out=str(Path(run.out).resolve()), source=source), final
