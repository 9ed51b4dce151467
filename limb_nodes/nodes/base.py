"""What every node of the limb has: parameters with ranges, its limb, and a count of bad input."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from std_msgs.msg import Header

from limb_nodes.errors import UserError
from limb_nodes.model import Limb, load_limb
from limb_nodes.nodes.distribution import given_parameters
from limb_nodes.nodes.identity import FORM, FRAME, frame_of, identity_of, is_identity
from limb_nodes.nodes.qos import LIVE, STREAM
from limb_nodes.nodes.ticks import Ticks
from limb_nodes.nodes.wire import Outgoing

MODES = ("lockstep", "realtime")
NODES = ("activation_input", "muscle_stack", "limb_dynamics", "recorder")
# Topics that muscle_stack publishes on request.
STATES = ("muscle_state", "motor_unit_state", "sarcomere_state")


class LimbNode(Node):
    """A node of one limb at one rate.

    identity: of the run that the node belongs to; empty until it is known. finished: whether the node has done its
    part of the run. failure: why it cannot go on, for whoever spins it; a text, because an error would keep the node
    and all that it knows alive. bad_input: messages that could not be used.
    """

    def __init__(self, name: str, **options: Any) -> None:
        super().__init__(name, **options)
        self.identity = ""
        self._frame = b""
        self._outgoing: list[Outgoing] = []
        self.finished = False
        self.failure = ""
        self.bad_input = 0
        self._last_complaint = -math.inf
        self._told = 0
        self.diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", LIVE)
        path = self.text("limb", "", "the limb's YAML file")
        if not path:
            raise UserError(f"{name}: the parameter limb is empty; the path of a limb's YAML file is needed")
        self.limb: Limb = load_limb(path)
        self.mode = self.choice("mode", MODES, "lockstep: tick after tick as fast as possible; realtime: by the clock")
        self.ticks = Ticks(self.number("rate", 1000.0, "ticks per second of simulation time", 0.0, 100_000.0))
        self.given_identity = self.text(
            "identity", "", f"identity of the run, {FORM}; empty: a new one (limb_dynamics), that of the run (others)"
        )
        if self.given_identity:
            if not is_identity(self.given_identity):
                raise UserError(f"{name}: the parameter identity is {self.given_identity!r}; {FORM} are needed")
            self.join(self.given_identity)

    def join(self, identity: str) -> None:
        """Belong to a run from now on."""
        self.identity, self._frame = identity, frame_of(identity)
        for messages in self._outgoing:
            messages.identify(self._frame)

    def owns(self, data: bytes) -> bool:
        """Whether a serialised message belongs to the node's run.

        A node without a run joins that of the first message that it asks about.
        """
        frame = data[FRAME]
        if frame == self._frame:
            return True
        identity = identity_of(frame)
        if identity and not self.identity:
            self.join(identity)
            return True
        if not identity:
            self.complain("a message has no identity of a run in header.frame_id")
        return False

    def outgoing(self, topic: str, example: Any) -> Outgoing:
        """The messages of the run that the node publishes on a topic, all like an example."""
        publisher = self.create_publisher(type(example), topic, STREAM)
        messages = Outgoing(publisher, example, self.ticks.nanoseconds)
        if self.identity:
            messages.identify(self._frame)
        self._outgoing.append(messages)
        return messages

    def listen_to_run(self, kind: type, topic: str, callback: Callable[[bytes], None]) -> None:
        """Subscribe a topic of the run; the callback gets serialised messages, of this run alone."""

        def own(data: bytes) -> None:
            if self.owns(data):
                callback(data)

        self.listen(kind, topic, own, STREAM, raw=True)

    def text(self, name: str, default: str, meaning: str) -> str:
        """A parameter that holds a text, fixed at the start."""
        descriptor = ParameterDescriptor(description=meaning, read_only=True)
        return str(self._declare(name, default, descriptor, "a text"))

    def choice(self, name: str, allowed: Sequence[str], meaning: str) -> str:
        """A parameter that holds one of some texts, the first by default."""
        value = self.text(name, allowed[0], f"{meaning} (one of {', '.join(allowed)})")
        if value not in allowed:
            raise UserError(
                f"{self.get_name()}: the parameter {name} is {value!r}; one of {', '.join(allowed)} is needed"
            )
        return value

    def number(self, name: str, default: float, meaning: str, lowest: float, highest: float) -> float:
        """A parameter that holds a number within a range."""
        span = FloatingPointRange(from_value=lowest, to_value=highest)
        descriptor = ParameterDescriptor(description=meaning, read_only=True, floating_point_range=[span])
        given = given_parameters(self)
        if name in given and given[name].type_ == Parameter.Type.INTEGER:
            # ROS tells 200 from 200.0; a person does not.
            given[name] = Parameter(name, value=float(given[name].value))
        allowed = f"a number from {lowest:g} to {highest:g}"
        value = float(self._declare(name, default, descriptor, allowed))
        if not lowest <= value <= highest:
            raise UserError(f"{self.get_name()}: the parameter {name} is {value:g}; {allowed} is needed")
        return value

    def whole(self, name: str, default: int, meaning: str, lowest: int, highest: int) -> int:
        """A parameter that holds a whole number within a range."""
        span = IntegerRange(from_value=lowest, to_value=highest, step=1)
        descriptor = ParameterDescriptor(description=meaning, read_only=True, integer_range=[span])
        return int(self._declare(name, default, descriptor, f"a whole number from {lowest} to {highest}"))

    def switch(self, name: str, default: bool, meaning: str) -> bool:
        """A parameter that is true or false."""
        descriptor = ParameterDescriptor(description=meaning, read_only=True)
        return bool(self._declare(name, default, descriptor, "true or false"))

    def _declare(self, name: str, default: Any, descriptor: ParameterDescriptor, allowed: str) -> Any:
        try:
            return self.declare_parameter(name, default, descriptor).value
        except Exception as problem:
            given = given_parameters(self).get(name)
            value = f"is {given.value!r}" if given is not None else f"cannot be read ({problem})"
            raise UserError(f"{self.get_name()}: the parameter {name} {value}; {allowed} is needed") from None

    def complain(self, what: str) -> None:
        """Count a message that cannot be used, and say so once per second at most."""
        self.bad_input += 1
        now = time.monotonic()
        if now - self._last_complaint >= 1.0:
            self._last_complaint = now
            self.get_logger().warning(f"{what}; kept the last good value ({self.bad_input} so far)")
            self.diagnose(what, bad=True)

    def diagnose(self, message: str, bad: bool, **values: object) -> None:
        """Publish on `/diagnostics` how the node does."""
        self._told = self.bad_input
        status = DiagnosticStatus(
            level=DiagnosticStatus.WARN if bad else DiagnosticStatus.OK,
            name=self.get_fully_qualified_name(),
            message=message,
            values=[KeyValue(key=key, value=str(value)) for key, value in values.items()]
            + [KeyValue(key="bad_input", value=str(self.bad_input))],
        )
        stamp = self.get_clock().now().to_msg()
        self.diagnostics.publish(DiagnosticArray(header=Header(stamp=stamp), status=[status]))

    def listen(self, kind: type, topic: str, callback: Callable[[Any], None], qos: QoSProfile, **options: Any) -> Any:
        """Subscribe a topic; what the callback cannot do ends the node, in one line."""

        def guarded(message: Any) -> None:
            try:
                callback(message)
            except UserError as error:
                self.failure = self.failure or str(error)

        return self.create_subscription(kind, topic, guarded, qos, **options)

    def destroy_node(self) -> None:
        """Tell the last count of bad input."""
        if self.bad_input > self._told:
            self.diagnose(f"{self.bad_input} messages could not be used", bad=True)
        super().destroy_node()
