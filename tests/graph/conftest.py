"""Real nodes in a ROS domain of this process's own: no launch files, no sleeping, every process ended by its handle."""

from __future__ import annotations

import gc
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
# Children run the checkout's package, as this process does, whatever is installed and wherever they start.
os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH"))))
TICKED = (
    "activation",
    "joint_states",
    "joint_torque",
    "movement_pattern",
    "muscle_state",
    "motor_unit_state",
    "sarcomere_state",
)
WAITING = r"\]: waits for .* since [\d.]+ s$|^limb: no tick has been recorded for"
# Longest wait for anything that must happen; only a failing test waits so long.
DEADLINE = 300.0


def wait_until(
    condition: Callable[[], Any], what: str, deadline: float = DEADLINE, idle: Callable[[], Any] | None = None
):
    """Wait for a condition and return its value; `idle` is called in between."""
    end = time.monotonic() + deadline
    while not (value := condition()):
        assert time.monotonic() < end, f"waited {deadline:g} s in vain: {what}"
        idle() if idle else time.sleep(0.01)
    return value


@pytest.fixture(scope="session")
def until() -> Callable[..., Any]:
    return wait_until


class Process:
    """A child with its outputs in files, so that no pipe can fill up."""

    def __init__(self, arguments: list[str], folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self.out, self.err = folder / "stdout", folder / "stderr"
        with self.out.open("w") as out, self.err.open("w") as err:
            # Unbuffered, so that what it has said is there when it is looked at.
            environment = {**os.environ, "PYTHONUNBUFFERED": "1"}
            self.handle = subprocess.Popen(
                arguments, stdout=out, stderr=err, stdin=subprocess.DEVNULL, cwd=ROOT, env=environment
            )

    def signal(self, number: signal.Signals) -> None:
        self.handle.send_signal(number)

    def wait(self, deadline: float = DEADLINE) -> int:
        """Its exit status."""
        return self.handle.wait(deadline)

    def running(self) -> bool:
        return self.handle.poll() is None

    @property
    def all_said(self) -> str:
        """What is on its standard error so far, but for remarks of Fast DDS, which tries another port then."""
        lines = self.err.read_text().splitlines(keepends=True)
        return "".join(line for line in lines if "RTPS_TRANSPORT_SHM" not in line)

    @property
    def said(self) -> str:
        """The same, but for what nodes say that wait for each other on a busy machine."""
        lines = self.all_said.splitlines(keepends=True)
        return "".join(line for line in lines if not re.search(WAITING, line))

    @property
    def printed(self) -> str:
        return self.out.read_text()

    def report(self) -> str:
        """For a test that fails: what it is, how it stands and what it has said."""
        return f"{self.handle.args}\n  exit status {self.handle.poll()}\n{self.printed[-2000:]}{self.all_said[-2000:]}"

    def end(self) -> None:
        """End it, whatever state it is in."""
        if self.running():
            self.handle.send_signal(signal.SIGCONT)
            self.handle.terminate()
            try:
                self.handle.wait(10.0)
            except subprocess.TimeoutExpired:
                self.handle.kill()
                self.handle.wait()


def children_of(pid: int) -> list[int]:
    return [int(text) for text in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


class Processes:
    """Starts children; all are ended when the test is over."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.all: list[Process] = []

    def start(self, *arguments: str, on: str = "") -> Process:
        """A program of Python; on: the network namespace that it is to be in, if it is another one."""
        there = ["ip", "netns", "exec", on] if on else []
        child = Process([*there, sys.executable, *arguments], self.folder / f"process{len(self.all)}")
        self.all.append(child)
        return child

    def limb(self, *arguments: str) -> Process:
        """The command `limb`."""
        return self.start("-m", "limb_nodes.cli", *map(str, arguments))

    def node(self, name: str, namespace: str = "", script: bool = False, on: str = "", **parameters: Any) -> Process:
        """One node, as a person starts it; script: the installed one that `ros2 run` takes."""
        how = [str(Path(sys.prefix, "lib/limb_nodes", name))] if script else ["-m", f"limb_nodes.nodes.{name}"]
        given = ["--ros-args"]
        if namespace:
            given += ["-r", f"__ns:=/{namespace}"]
        for key, value in parameters.items():
            given += ["-p", f"{key}:={str(value).lower() if isinstance(value, bool) else value}"]
        return self.start(*how, *given, on=on)


@pytest.fixture(scope="session", autouse=True)
def _own_logs(tmp_path_factory: pytest.TempPathFactory) -> None:
    """A folder for the logs of ROS; the domain is the one that this process has reserved."""
    os.environ["ROS_LOG_DIR"] = str(tmp_path_factory.mktemp("ros"))


@pytest.fixture
def processes(tmp_path: Path) -> Iterator[Processes]:
    started = Processes(tmp_path)
    yield started
    for child in started.all:
        print(child.report())
        child.end()


@contextmanager
def undisturbed() -> Iterator[None]:
    """Leave signal handlers and the garbage collector as they were: a run in this process changes them."""
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        gc.unfreeze()


@pytest.fixture
def own_signals() -> Iterator[None]:
    with undisturbed():
        yield


class Bench:
    """Nodes in a context of their own on one executor, and a probe that publishes and listens."""

    def __init__(self, namespace: str = "") -> None:
        import rclpy
        from rclpy.context import Context
        from rclpy.signals import SignalHandlerOptions

        from limb_nodes.nodes.distribution import make_executor

        self.namespace = namespace
        self.context = Context()
        rclpy.init(context=self.context, signal_handler_options=SignalHandlerOptions.NO)
        self.executor = make_executor(self.context)
        self.nodes: list[Any] = []
        self.probe = rclpy.create_node("probe", context=self.context, namespace=namespace or None)
        self._add(self.probe)

    def _add(self, node: Any) -> None:
        self.executor.add_node(node)
        self.nodes.append(node)

    def add(self, kind: Callable[..., Any], **parameters: Any) -> Any:
        """Create a node of a class."""
        from rclpy.parameter import Parameter

        overrides = [Parameter(name, value=value) for name, value in parameters.items()]
        node = kind(context=self.context, parameter_overrides=overrides, namespace=self.namespace or None)
        self._add(node)
        return node

    def listen(self, kind: type, topic: str, profile: Any) -> list[Any]:
        """A list that grows with the messages of a topic."""
        heard: list[Any] = []
        self.probe.create_subscription(kind, topic, heard.append, profile)
        return heard

    def publisher(self, kind: type, topic: str, profile: Any, listeners: int = 1) -> Any:
        """A publisher that has found its listeners."""
        publisher = self.probe.create_publisher(kind, topic, profile)
        self.until(lambda: publisher.get_subscription_count() >= listeners, f"a subscriber of {topic}")
        return publisher

    def finish(self, node: Any) -> None:
        """Destroy a node before the others, so that what it has written can be read."""
        self.nodes.remove(node)
        self.executor.remove_node(node)
        node.destroy_node()

    def spin(self) -> None:
        self.executor.spin_once(timeout_sec=0.02)

    def until(self, condition: Callable[[], Any], what: str, deadline: float = DEADLINE) -> Any:
        """Handle events until a condition holds."""
        return wait_until(condition, what, deadline, self.spin)

    def close(self) -> None:
        from limb_nodes.nodes.running import close

        close(self.context, self.executor, self.nodes)


@pytest.fixture
def bench() -> Iterator[Callable[..., Bench]]:
    """Makes benches, closed when the test is over."""
    with ExitStack() as stack:

        def make(namespace: str = "") -> Bench:
            made = Bench(namespace)
            stack.callback(made.close)
            return made

        yield make


@pytest.fixture(scope="session")
def limb() -> str:
    """The limb of these tests: one joint, two muscles with tendons."""
    return str(ROOT / "params" / "reference_joint_tendon.yaml")


@pytest.fixture(scope="session")
def waves() -> str:
    """Its activation: sine and cosine."""
    return str(ROOT / "params" / "activation_sine_cosine.yaml")


class Bags:
    """Reads bags for comparison, and writes envelopes."""

    @staticmethod
    def decoded(path: Path | str, topics: tuple[str, ...] = TICKED) -> dict[str, dict[str, np.ndarray]]:
        """Every number and name of each topic, as arrays over the ticks."""
        from limb_nodes.bags.read import BagReader

        with BagReader(path) as bag:
            return {topic: bag.table(topic) for topic in topics}

    @staticmethod
    def differences(one: Path | str, other: Path | str) -> list[str]:
        """The fields in which two bags differ, by exact comparison of decoded values."""
        first, second = Bags.decoded(one), Bags.decoded(other)
        return [
            f"{topic}.{field}"
            for topic in TICKED
            for field in {*first[topic], *second[topic]} - {"run"}
            if not np.array_equal(first[topic].get(field), second[topic].get(field))  # type: ignore[arg-type]
        ]

    @staticmethod
    def complete(path: Path | str, ticks: int, period_ns: int) -> None:
        """Assert that every tick is there once on every topic, with its stamp."""
        from limb_nodes.bags.read import BagReader

        wanted = np.arange(ticks) * period_ns
        with BagReader(path) as bag:
            for topic in TICKED:
                rows = list(bag.read_topic(topic))
                stamps = [m.header.stamp.sec * 1_000_000_000 + m.header.stamp.nanosec for _, m in rows]
                np.testing.assert_array_equal(stamps, wanted, err_msg=topic)
                np.testing.assert_array_equal([time for time, _ in rows], wanted, err_msg=topic)
                if topic != "joint_states":
                    assert [m.tick for _, m in rows] == list(range(ticks)), topic

    @staticmethod
    def envelopes(path: Path, values: dict[str, np.ndarray], rate: float) -> str:
        """A bag of envelopes."""
        from limb_nodes.bags.types import make_message
        from limb_nodes.bags.write import BagWriter

        period = round(1e9 / rate)
        columns = np.stack(list(values.values()), axis=1)
        with BagWriter(path, {"rate": rate}) as bag:
            for k, row in enumerate(columns):
                message = make_message("limb_msgs/msg/EmgEnvelope", k * period, name=list(values), envelope=row)
                bag.write("emg_envelope", k * period, message)
        return str(path)


@pytest.fixture(scope="session")
def bags() -> type[Bags]:
    return Bags


@pytest.fixture(scope="session")
def reference(limb: str, waves: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A lockstep run in this process: 0.5 s at 1 kHz."""
    from limb_nodes.nodes.session import run_in_one_process
    from limb_nodes.nodes.settings import RunSettings, checked

    out = tmp_path_factory.mktemp("reference") / "run"
    ready, _ = checked(RunSettings(limb=limb, source=waves, rate=1000.0, duration=0.5, out=str(out)))
    with undisturbed():
        outcome = run_in_one_process(ready, lambda tick: None)
    assert (outcome.ticks, outcome.missing, outcome.bad_input, outcome.interrupted) == (501, 0, 0, False)
    return out
