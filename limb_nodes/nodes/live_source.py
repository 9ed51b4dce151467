"""A live source: heard whatever quality of service it offers, counted, and aged."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.clock import Clock, ClockType
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy

from limb_nodes.errors import clean
from limb_nodes.nodes.live_readers import EnvelopeReader, RawReader
from limb_nodes.nodes.live_settings import HEARD, NEVER_CAME, SILENT
from limb_nodes.nodes.messages import type_name
from limb_nodes.nodes.qos import BEST_EFFORT, EVERY

if TYPE_CHECKING:
    from limb_nodes.nodes.activation_input import ActivationInput

# How often a source is looked at (s).
LOOK_PERIOD = 0.05
# The longest time between two looks that counts as silence (s): what comes while the node itself stands still waits.
LONGEST_LOOK = 2 * LOOK_PERIOD
OK, WARN, STALE = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.STALE
# How long a source may take to come (s): nodes may take seconds to find each other.
PATIENCE = 10.0
# Without rclpy's warning that a quality of service does not fit: another is taken then.
QUIET = SubscriptionEventCallbacks(use_default_callbacks=False)


def quality_for(node: Node, topic: str) -> QoSProfile:
    """How to subscribe a topic of sources: reliably, unless one of them offers best effort alone.

    A reliable subscription loses nothing, which filters of raw EMG need, and would never hear a best-effort source;
    a best-effort one hears both.
    """
    offered = (info.qos_profile.reliability for info in node.get_publishers_info_by_topic(topic))
    return BEST_EFFORT if ReliabilityPolicy.BEST_EFFORT in offered else EVERY


class LiveSource:
    """What comes on the topic of a reader.

    values: the newest activations [muscles], 0 at first. messages: that have come; used: that could be used;
    unstamped: that came with the time 0, after one that did too. age: time since the last one that was used, or since
    listening began (s), as far as the node could hear. silent: whether this is too long. closed: whether what comes is
    not taken any more.
    """

    def __init__(self, node: ActivationInput, reader: EnvelopeReader | RawReader, silence: float, muscles: int) -> None:
        self.values = np.zeros(muscles)
        self.messages = self.used = self.unstamped = 0
        self.age, self.silent = 0.0, False
        self.closed = False
        # When the newest message came that no activation was sent of; 0 if there is none (s of the monotonic clock).
        self.arrived = 0.0
        self.subscription: Any = None
        self._node, self._reader, self._silence = node, reader, silence
        self._topic = reader.topic
        self._problem = ""
        self._zero_before = False
        self._looked = 0.0

    def open(self) -> None:
        """Begin to listen."""
        self._looked = time.monotonic()
        self._subscribe(quality_for(self._node, self._topic))
        self._node.create_timer(LOOK_PERIOD, self._on_timer, clock=Clock(clock_type=ClockType.STEADY_TIME))

    @property
    def gone(self) -> bool:
        """Whether it is no use to wait any longer."""
        return self.silent and (self.used > 0 or self.age >= PATIENCE)

    @property
    def lost(self) -> bool:
        """Whether nothing that can be used has come, or comes any more."""
        return self.silent or not self.used

    def look(self) -> None:
        """Age what has come; say if the source has become silent."""
        now = time.monotonic()
        self.age += min(now - self._looked, LONGEST_LOOK)
        self._looked = now
        if self.age >= self._silence and not self.silent:
            self.silent = True
            self._node.get_logger().warning(clean(self.told()))
            self.report()

    def report(self) -> None:
        """Publish the state on `/diagnostics`."""
        state = (SILENT if self.used else NEVER_CAME) if self.lost else HEARD
        bad = state == NEVER_CAME or self.unstamped or self._problem
        self._node.diagnose(
            self.told(), STALE if state == SILENT else WARN if bad else OK, input=state, messages=self.messages,
            used=self.used, unstamped=self.unstamped, age=f"{self.age:.3f}", **self._node.steps.told("step"),
            **self._node.latency.told("latency"),
        )  # fmt: skip

    def told(self) -> str:
        """The state in words."""
        count = f"{self.used} of {self.messages} messages used"
        if not self.messages:
            what = f"nothing has come in {self.age:.2f} s; {self._publishers()}"
        elif self._problem and self.lost:
            what = f"no message that can be used in {self.age:.2f} s, {count}; the last one {self._problem}"
        elif self.silent:
            what = f"stopped {self.age:.2f} s ago; {count}"
        else:
            what = count
        stamps = f"; stamps are 0 in {self.unstamped} messages" if self.unstamped else ""
        return f"{self._topic}: {what}{stamps}"

    def _publishers(self) -> str:
        wanted = type_name(self._reader.kind)
        found = self._node.get_publishers_info_by_topic(self._topic)
        for info in found:
            if info.topic_type != wanted:
                return f"{info.node_name} publishes {info.topic_type}; {wanted} is needed"
        return f"{found[0].node_name} is there and silent" if found else "nobody publishes it"

    def _subscribe(self, quality: QoSProfile) -> None:
        self.subscription = self._node.listen(
            self._reader.kind, self._topic, self._on_message, quality, event_callbacks=QUIET
        )

    def _on_timer(self) -> None:
        self.look()
        if self.subscription.qos_profile.reliability != ReliabilityPolicy.BEST_EFFORT:
            quality = quality_for(self._node, self._topic)
            if quality is BEST_EFFORT:
                self._node.destroy_subscription(self.subscription)
                self._subscribe(quality)

    def _on_message(self, message: Any) -> None:
        if self.closed:
            return
        self.messages += 1
        self._look_at_stamp(self._reader.stamp(message))
        try:
            self.values = self._reader.read(message)
        except ValueError as problem:
            self._problem = str(problem)
            self._node.part.refuse(f"{self._topic}: {problem}")
            return
        self.used += 1
        self._problem = ""
        silence, self.age, self._looked = self.age, 0.0, time.monotonic()
        self.arrived = self._looked
        if self.silent:
            self.silent = False
            self._node.get_logger().info(f"{self._topic}: heard after {silence:.2f} s")
            self.report()

    def _look_at_stamp(self, stamp: tuple[int, int] | None) -> None:
        zero = stamp == (0, 0)
        if zero and self._zero_before:
            self.unstamped += 1
            if self.unstamped == 1:
                self._node.get_logger().warning(
                    f"{self._topic}: stamps are 0; the time of each sample in header.stamp is needed"
                )
                self.report()
        self._zero_before = zero
