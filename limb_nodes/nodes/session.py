"""A whole run: the four nodes in one process, or each in its own."""

from __future__ import annotations

import gc
import math
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import rclpy
from limb_msgs.msg import Recorded
from rclpy.context import Context
from rclpy.executors import Executor
from rclpy.node import Node
from rclpy.parameter import Parameter

from limb_nodes.errors import FieldError, RunError, UserError
from limb_nodes.exchange.recorded import join_parts
from limb_nodes.exchange.watch import LOOK_PERIOD, Watch
from limb_nodes.foundation.topics import NODES, exchanged
from limb_nodes.model import load_limb
from limb_nodes.model.path_remarks import unequal_work
from limb_nodes.nodes.activation_input import ActivationInput
from limb_nodes.nodes.children import Crew
from limb_nodes.nodes.distribution import make_executor
from limb_nodes.nodes.limb_dynamics import LimbDynamics
from limb_nodes.nodes.muscle_stack import MuscleStack
from limb_nodes.nodes.qos import STREAM
from limb_nodes.nodes.recorder import Recorder
from limb_nodes.nodes.running import Interrupt, close, init_ros
from limb_nodes.nodes.settings import Outcome, Progress, RunSettings, recorded_outcome

CLASSES = {
    "activation_input": ActivationInput,
    "muscle_stack": MuscleStack,
    "limb_dynamics": LimbDynamics,
    "recorder": Recorder,
}
# How long nodes in processes of their own may take to the first tick (s); a slow machine compiles a limb for minutes.
STARTING = 300.0
# How much later than its nodes a run gives up waiting, and after which time it says that it waits (s).
SLACK, SOON = 5.0, 3.0
# How long other nodes of the domain may take to be found (s).
DISCOVERY = 1.0
# How long an executor waits for something to happen before the run is looked at again (s).
TURN = 0.05


def run_in_one_process(settings: RunSettings, progress: Progress) -> Outcome:
    """Run the nodes in this process. `progress` is called with the newest recorded tick. Raises UserError."""
    interrupt = Interrupt()
    context = Context()
    init_ros(context)
    executor = make_executor(context)
    nodes: dict[str, Any] = {}
    try:
        refuse_neighbours(context, settings.namespace)
        for name in NODES:
            nodes[name] = make_node(settings, name, context)
            executor.add_node(nodes[name])
        gc.collect()
        gc.freeze()
        seconds = spin_to_the_end(executor, nodes, interrupt, progress)
        recorder, live = nodes["recorder"], nodes["activation_input"].live
        return Outcome(
            ticks=recorder.part.ticks_taken,
            missing=recorder.part.missing(),
            missed=nodes["limb_dynamics"].part.missed,
            bad_input=sum(node.part.bad_input for node in nodes.values()),
            foreign=sum(node.part.foreign for node in nodes.values()),
            conflicts=sum(node.part.conflicts for node in nodes.values()),
            seconds=seconds,
            interrupted=interrupt.wanted,
            live=live.told() if live else "",
            lost=bool(live and live.lost),
            ranges=nodes["muscle_stack"].part.stepper.ranges.told(),
            work=unequal_work(nodes["muscle_stack"].limb),
        )
    finally:
        close(context, executor, nodes.values())
        gc.unfreeze()


def make_node(settings: RunSettings, name: str, context: Context) -> Any:
    """A node of a run in this process."""
    overrides = [Parameter(key, value=value) for key, value in settings.parameters(name).items()]
    return CLASSES[name](context=context, parameter_overrides=overrides, namespace=settings.namespace or None)


def spin_to_the_end(executor: Executor, nodes: Mapping[str, Any], interrupt: Interrupt, progress: Progress) -> float:
    """Spin until the recorder has the last tick or the run is interrupted; the wall time since the first tick (s).

    Raises UserError if a node cannot go on.
    """
    recorder, dynamics = nodes["recorder"], nodes["limb_dynamics"]
    started, shown = None, recorder.announced
    while not (recorder.finished or interrupt.wanted):
        turn = time.monotonic()
        executor.spin_once(timeout_sec=TURN)
        if started is None and dynamics.part.tick > 0:
            started = turn
        if recorder.announced != shown:
            shown = recorder.announced
            progress(shown)
        for node in nodes.values():
            node.raise_failure()
    ended = time.monotonic()
    return ended - (started or ended)


def run_in_processes(settings: RunSettings, progress: Progress) -> Outcome:
    """Run each node in a process of its own. `progress` is called with the newest recorded tick. Raises UserError."""
    interrupt = Interrupt()
    context = Context()
    init_ros(context)
    observer = Observer(settings, context)
    executor = make_executor(context)
    crew = Crew(settings, lambda: observer.recorded)
    try:
        try:
            refuse_neighbours(context, settings.namespace)
            executor.add_node(observer)
            crew.start()
            # While they start; when they have ended, the file may be another.
            work = unequal_work(load_limb(settings.limb, settings.allow_laws))
            seconds = await_the_end(executor, observer, crew, interrupt, progress)
        finally:
            crew.stop()
            join_parts(settings.out)
        if interrupt.wanted and not Path(settings.out).exists():
            return Outcome(0, 0, 0, 0, 0, 0, 0.0, True)
        crew["recorder"].raise_failure()
        return recorded_outcome(settings, seconds, interrupt.wanted, work)
    finally:
        close(context, executor, [observer])


class Observer(Node):
    """Hears how far the nodes of a run are. recorded: the newest tick that is recorded, -1 before the first."""

    def __init__(self, settings: RunSettings, context: Context) -> None:
        super().__init__("limb_run", context=context, namespace=settings.namespace or None)
        self.recorded = -1
        # The nodes themselves say what they wait for, unless those stand still that would.
        limit = settings.stall_limit + SLACK
        self._recording, self._stops = Watch(limit, math.inf, SOON), Watch(limit, math.inf, SOON)
        self._next_look = 0.0
        self._identity = settings.identity
        self.create_subscription(Recorded, exchanged("recorded"), self._on_progress, STREAM)

    def _on_progress(self, message: Recorded) -> None:
        if message.run == self._identity:
            self.recorded = message.tick

    def look(self, crew: Crew) -> None:
        """Say if nothing is recorded or nodes are stopped; raise RunError if that has lasted too long."""
        now = time.monotonic()
        if now < self._next_look:
            return
        self._next_look = now + LOOK_PERIOD
        stopped = crew.stopped()
        for watch, done, awaited, what in (
            (self._recording, self.recorded, "a tick", "no tick has been recorded for {:.0f} s"),
            (self._stops, 1, stopped, f"stopped by somebody: {stopped} for {{:.0f}} s"),
        ):
            said, told = watch.look(now, done, awaited), what.format(watch.waited)
            if watch.given_up:
                raise RunError(told)
            if said:
                print(f"limb: {told}", file=sys.stderr)

    def why_nothing_comes(self) -> str:
        """What to look at if a run does not begin."""
        there = {name for name, space in self.get_node_names_and_namespaces() if space == self.get_namespace()}
        silent = [name for name in NODES if name not in there]
        if silent:
            return f"not heard of {', '.join(silent)}: does ROS_AUTOMATIC_DISCOVERY_RANGE let nodes find each other?"
        return "all nodes are there: is the machine too busy?"


def await_the_end(
    executor: Executor, observer: Observer, crew: Crew, interrupt: Interrupt, progress: Progress
) -> float:
    """Wait until the recorder has ended or the run is interrupted; the wall time since the first tick (s).

    Raises UserError if a node fails or none makes a tick.
    """
    begun, started = time.monotonic(), None
    while crew["recorder"].status != 0 and not interrupt.wanted:
        executor.spin_once(timeout_sec=TURN)
        progress(observer.recorded)
        if started is None and observer.recorded > 0:
            started = time.monotonic()
        crew.look()
        observer.look(crew)
        if started is None and time.monotonic() - begun > STARTING:
            raise UserError(f"no tick within {STARTING:g} s; {observer.why_nothing_comes()}")
    ended = time.monotonic()
    return ended - (started or ended)


def refuse_neighbours(context: Context, namespace: str) -> None:
    """Raise FieldError if nodes of another run are there already, before any of this one is."""
    full = f"/{namespace.strip('/')}"
    probe = rclpy.create_node("limb_run_probe", context=context, namespace=full, start_parameter_services=False)
    try:
        end = time.monotonic() + DISCOVERY
        while time.monotonic() < end:
            there = [name for name, space in probe.get_node_names_and_namespaces() if name in NODES and space == full]
            # Publishers can be known before the name of their node.
            if not there and probe.count_publishers(exchanged("limb_state")):
                there = ["limb_dynamics"]
            if there:
                raise FieldError(
                    "namespace",
                    f"is {full}, in which a node {there[0]} runs already, perhaps of another run; another one, or "
                    "another ROS_DOMAIN_ID, is needed",
                )
            time.sleep(0.02)
    finally:
        probe.destroy_node()
