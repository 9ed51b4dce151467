"""Running nodes: start, spin until they have finished or are interrupted, end cleanly."""

from __future__ import annotations

import gc
import os
import re
import signal
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.exceptions import InvalidNamespaceException
from rclpy.executors import Executor, ExternalShutdownException
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions
from rclpy.validate_namespace import validate_namespace

from limb_nodes.edge import guarded
from limb_nodes.errors import FieldError
from limb_nodes.nodes.base import PARENT, STAY
from limb_nodes.nodes.distribution import make_executor
from limb_nodes.nodes.typed import typed_last, typed_parameters

# The executor is asked for one event at a time with a time-out: without one it hangs when idle.
SPIN_TIMEOUT = 0.05
# The signals by which a run is ended in order; the last comes when a terminal is closed.
ENDING = signal.SIGINT, signal.SIGTERM, signal.SIGHUP
# So many runs before the present one, whose last messages may still be on their way, are known.
FORMER = 8
# Ports are numbered by the domain; there are none beyond.
HIGHEST_DOMAIN = 232


def spin(executor: Executor, done: Callable[[], bool]) -> None:
    """Handle events until `done`."""
    with suppress(ExternalShutdownException):
        while not done():
            executor.spin_once(timeout_sec=SPIN_TIMEOUT)


def check_namespace(namespace: str) -> None:
    """Raise FieldError if ROS does not allow a namespace."""
    full = namespace if namespace.startswith("/") else f"/{namespace}"
    try:
        validate_namespace(full)
    except InvalidNamespaceException:
        raise FieldError(
            "namespace",
            f"is {namespace!r}; words of letters, digits and _, none with a digit in front, "
            "with / between them are needed",
        ) from None


class Interrupt:
    """Turns SIGINT, SIGTERM and SIGHUP into a wish to stop, so that no callback is cut in two."""

    def __init__(self) -> None:
        self.wanted = False
        for number in ENDING:
            signal.signal(number, self._want)

    def _want(self, *_: Any) -> None:
        self.wanted = True


def main_of(node_class: Callable[..., Node]) -> Callable[[Sequence[str] | None], None]:
    """The `main` of a node's module."""

    def main(args: Sequence[str] | None = None) -> None:
        sys.exit(run_node(node_class, args))

    return main


def run_node(node_class: Callable[..., Any], args: Sequence[str] | None) -> int:
    """Run one node until it has finished or is interrupted; its exit status."""
    return guarded(lambda: run_guarded(node_class, args))


def run_guarded(node_class: Callable[..., Any], args: Sequence[str] | None) -> int:
    """The same; raises UserError and whatever else goes wrong."""
    interrupt = Interrupt()
    given: dict[str, Any] = {}
    former: tuple[str, ...] = ()
    arguments = list(sys.argv if args is None else args)
    while True:
        # A run has a context of its own: what the middleware has kept for the one before cannot hold it up.
        context = Context()
        try:
            with typed_last(arguments, name_of(node_class)) as all_arguments:
                init_ros(context, all_arguments)
            node = node_class(
                context=context,
                parameter_overrides=[Parameter(key, value=given[key]) for key in given],
                former=former[-FORMER:],
                typed=typed_parameters(arguments),
            )
            given = run_once(node, context, interrupt)
        finally:
            close(context, None, [])
        if not given:
            return 0
        former = (*former, node.part.identity)


def name_of(node_class: Callable[..., Any]) -> str:
    """The name of a node by that of its class: limb_dynamics of LimbDynamics."""
    return re.sub(r"(?<!^)(?=[A-Z])", "_", node_class.__name__).lower()


def run_once(node: Any, context: Context, interrupt: Interrupt) -> dict[str, Any]:
    """Run one node for one run; the parameters with which it begins the run that follows, none if there is no such."""
    executor = make_executor(context)
    try:
        executor.add_node(node)
        # What exists now stays: collecting it again and again would cost ticks.
        gc.unfreeze()
        gc.collect()
        gc.freeze()
        parent = os.environ.get(PARENT)
        if not parent:
            node.serve()
        orphaned = (lambda: str(os.getppid()) != parent) if parent else (lambda: bool(node.leaves))
        stays = bool(os.environ.get(STAY))
        spin(executor, lambda: interrupt.wanted or (node.finished and not stays) or bool(node.failure) or orphaned())
        node.raise_failure()
        # Whoever begins another run hears of it from limb_dynamics there, too.
        if not (interrupt.wanted or node.following):
            linger(executor, node, interrupt)
        return {} if interrupt.wanted or parent or not node.following else node.parameters_of_following()
    finally:
        executor.remove_node(node)
        node.destroy_node()
        executor.shutdown()


def init_ros(context: Context, args: Sequence[str] | None = None) -> None:
    """Begin to use ROS, without files of logs if there is no folder for them.

    Raises FieldError, and an error of rclpy for arguments that it does not take.
    """
    domain = os.environ.get("ROS_DOMAIN_ID", "")
    # With a greater one the middleware ends the process.
    if domain and not (re.fullmatch("[0-9]{1,9}", domain) and int(domain) <= HIGHEST_DOMAIN):
        raise FieldError("ROS_DOMAIN_ID", f"is {domain!r}; a whole number from 0 to {HIGHEST_DOMAIN} is needed")
    given = list(sys.argv if args is None else args)
    if not logs_can_be_kept():
        given += ["--ros-args", "--disable-external-lib-logs"]
    rclpy.init(args=given, context=context, signal_handler_options=SignalHandlerOptions.NO)


def logs_can_be_kept() -> bool:
    """Whether ROS can write its logs, where it would do so."""
    home = os.environ.get("ROS_HOME") or "~/.ros"
    folder = Path(os.path.expanduser(os.environ.get("ROS_LOG_DIR") or f"{home}/log"))
    with suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
    return os.access(folder, os.W_OK | os.X_OK) and bool(os.environ.get("HOME") or os.environ.get("ROS_LOG_DIR"))


def close(context: Context, executor: Executor | None, nodes: Iterable[Node]) -> None:
    """Destroy nodes, so that they leave the graph at once, and end what belongs to them."""
    try:
        for node in nodes:
            if executor is not None:
                executor.remove_node(node)
            node.destroy_node()
    finally:
        with suppress(Exception):
            rclpy.shutdown(context=context)


def linger(executor: Executor, node: Any, interrupt: Interrupt) -> None:
    """Stay until everybody who listens has taken the last messages, 5 s at most."""
    end = time.monotonic() + 5.0
    publishers = [p for p in node.publishers if p.get_subscription_count() > 0]
    for publisher in publishers:
        while not interrupt.wanted and time.monotonic() < end:
            if acknowledged(publisher):
                break
            executor.spin_once(timeout_sec=SPIN_TIMEOUT)


def acknowledged(publisher: Any) -> bool:
    """Whether all messages of a publisher have arrived."""
    return bool(publisher.wait_for_all_acked(Duration(seconds=0.05)))
