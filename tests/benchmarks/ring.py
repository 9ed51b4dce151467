"""Rings of three nodes in lockstep, bare or the product's, in one process or each node in its own.

Run as a module it is one node of a ring in its own process.
"""

from __future__ import annotations

import gc
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from tests.benchmarks.timing import Spent

NODES = ("activation_input", "muscle_stack", "limb_dynamics")
STATES = ("muscle_state", "motor_unit_state", "sarcomere_state")
# Ticks before the clock starts: discovery and the first calls are no part of the rate.
WARM = 20
ROOT = Path(__file__).resolve().parents[2]
PATIENCE = 120.0


@dataclass(frozen=True)
class Ring:
    """A ring. kind: "bare" or "product". limb: its file. ticks: how many."""

    kind: str
    limb: str
    ticks: int


def bare_node(ring: Ring, name: str, context: Any) -> Any:
    """A node that only passes messages on."""
    from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

    from limb_nodes.model import load_limb
    from tests.benchmarks.peers.bare_ring import BARE

    qos = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    limb = load_limb(ring.limb)
    return BARE[name](limb.muscle_names, limb.joint_names, ring.ticks, qos, context=context)


def product_node(ring: Ring, name: str, context: Any) -> Any:
    """A node of the graph without recorder, states switched off."""
    from rclpy.parameter import Parameter

    from limb_nodes.nodes.session import CLASSES

    own: dict[str, dict[str, Any]] = {
        "activation_input": {"source": waves(ring), "duration": ring.ticks / 1000.0},
        "muscle_stack": {f"publish_{topic}": False for topic in STATES},
        "limb_dynamics": {"await_recorder": False},
    }
    given = {"limb": ring.limb, "rate": 1000.0, **own[name]}
    return CLASSES[name](context=context, parameter_overrides=[Parameter(k, value=v) for k, v in given.items()])


def waves(ring: Ring) -> str:
    """The activation: the sine and cosine of the reference joint."""
    from limb_nodes.model.shipped import shipped

    return str(shipped("activation_sine_cosine.yaml"))


def spin(ring: Ring, names: Sequence[str]) -> Spent:
    """Run some nodes of a ring in this process until they have done their part."""
    import rclpy
    from rclpy.context import Context
    from rclpy.signals import SignalHandlerOptions

    from limb_nodes.nodes.distribution import make_executor
    from limb_nodes.nodes.running import linger

    make: Callable[[Ring, str, Any], Any] = bare_node if ring.kind == "bare" else product_node
    context = Context()
    rclpy.init(context=context, signal_handler_options=SignalHandlerOptions.NO)
    nodes: list[Any] = []
    try:
        executor = make_executor(context)
        for name in names:
            nodes.append(make(ring, name, context))
            executor.add_node(nodes[-1])
        gc.collect()
        gc.freeze()
        last = nodes[-1]
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end and not last.finished and getattr(last, "tick", WARM) < WARM:
            executor.spin_once(timeout_sec=0.05)
        first = getattr(last, "tick", WARM)
        wall, cpu = time.perf_counter(), time.process_time()
        while not last.finished:
            executor.spin_once(timeout_sec=0.05)
        wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
        if len(names) < len(NODES):
            patient: Any = Patient()
            linger(executor, last, patient)
        # Spent per tick, so that the ticks before the clock do not count.
        ticks = ring.ticks - first
        return Spent(wall / ticks, cpu / ticks)
    finally:
        for node in nodes:
            node.destroy_node()
        with suppress(Exception):
            rclpy.shutdown(context=context)
        gc.unfreeze()


class Patient:
    """Nobody interrupts."""

    wanted = False


def in_one_process(ring: Ring) -> Spent:
    """Seconds per tick of all nodes in this process."""
    return spin(ring, NODES)


def in_three_processes(ring: Ring) -> Spent:
    """Seconds per tick of each node in its own process."""
    children = []
    try:
        for name in NODES:
            command = [sys.executable, "-m", "tests.benchmarks.ring", json.dumps({**asdict(ring), "node": name})]
            pipe = subprocess.PIPE
            children.append(subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True, env=os.environ, cwd=ROOT))
        answers = []
        for child in children:
            out, complaint = child.communicate(timeout=PATIENCE)
            if child.returncode != 0:
                raise RuntimeError(complaint.strip().splitlines()[-1] if complaint.strip() else "a node has failed")
            answers.append(Spent(*json.loads(out.splitlines()[-1])))
    finally:
        for child in children:
            if child.poll() is None:
                child.kill()
                child.wait()
    return Spent(answers[-1].wall, sum(answer.cpu for answer in answers))


def recorded(ring: Ring) -> Spent:
    """Seconds per tick of the product's graph with its recorder and all topics of every tick."""
    from limb_nodes.nodes.session import run_in_one_process
    from limb_nodes.nodes.settings import RunSettings, checked

    with tempfile.TemporaryDirectory() as folder:
        seconds = ring.ticks / 1000.0
        ready, _ = checked(RunSettings(ring.limb, waves(ring), rate=1000.0, duration=seconds, out=f"{folder}/bag"))
        cpu = time.process_time()
        outcome = run_in_one_process(ready, lambda tick: None)
        cpu = time.process_time() - cpu
        gc.unfreeze()
        if outcome.missing or outcome.ticks != ring.ticks + 1:
            raise RuntimeError(f"{outcome.missing} ticks are missing in the bag")
    # The start-up of the nodes is in the processor time alone.
    return Spent(outcome.seconds / ring.ticks, cpu / ring.ticks)


if __name__ == "__main__":
    asked = json.loads(sys.argv[1])
    node = asked.pop("node")
    spent = spin(Ring(**asked), [node])
    print(json.dumps([spent.wall, spent.cpu]))
