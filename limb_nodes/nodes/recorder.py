"""Node recorder: writes every topic of a run to a bag that suffices to run it again."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from functools import partial
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import WrenchStamped
from limb_msgs.msg import Claim, EmgEnvelope, Recorded
from rclpy.clock import Clock, ClockType
from rclpy.parameter import parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient
from rclpy.qos import ReliabilityPolicy
from rclpy.serialization import serialize_message
from rclpy.subscription import Subscription
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String

from limb_nodes.bags.folder import next_free, refuse_existing
from limb_nodes.bags.versions import versions
from limb_nodes.bags.write import BagWriter
from limb_nodes.errors import UserError
from limb_nodes.exchange.identity import is_identity
from limb_nodes.exchange.recorded import copy
from limb_nodes.exchange.recording import RecordingPart
from limb_nodes.exchange.stream import RECORDER_LAG
from limb_nodes.foundation.topics import LATCHED_TOPICS, NODES, RECORDED, TOPIC_TYPES, exchanged
from limb_nodes.nodes.base import LimbNode
from limb_nodes.nodes.distribution import parameter_values, taken
from limb_nodes.nodes.live_source import LOOK_PERIOD, QUIET, quality_for
from limb_nodes.nodes.messages import class_of
from limb_nodes.nodes.qos import BEST_EFFORT, EVERY, LATCHED, STREAM
from limb_nodes.nodes.running import main_of

# Of sources, which may offer best effort alone.
SOURCES = {
    "emg": Float64MultiArray, "emg_envelope": EmgEnvelope, "external_load": WrenchStamped, "joint_command": JointState
}  # fmt: skip
OTHERS = {**SOURCES, "/diagnostics": DiagnosticArray}
# How often the topics are emptied (s). An executor would take three times as long for each message.
POLL_PERIOD = 0.005
# So many ticks at least are brought to the disk at once.
FLUSHED = RECORDER_LAG // 4
# How long to wait for the other nodes to tell their parameters once messages flow (s).
PATIENCE = 5.0
# How long to wait for a node's answer before it is asked again (s).
ASK_AGAIN = 1.0
# A run that another one follows has no more messages if none has come for so long (s).
SETTLED = 0.2


class Recorder(LimbNode):
    """Subscribes every topic and writes each tick once.

    Tells limb_dynamics when it is ready, and then the newest tick that is on the disk on every topic. Finished when the
    last tick of the run is in the bag on every topic.
    """

    part: RecordingPart

    def __init__(self, **options: Any) -> None:
        super().__init__("recorder", **options)
        out = self.text("out", "", "folder of the bag, which must not exist")
        self.command = self.text("command", "", "the command that started the run, for the record")
        self.copies = self.switch("copies", True, "copy the bag of resume into the new one")
        if not out:
            raise UserError("recorder: the parameter out is empty; the folder of a new bag is needed")
        self.path = out
        refuse_existing(Path(out))
        self.writer: BagWriter | None = None
        # What has come before the bag is open.
        self.early: dict[str, list[bytes]] = {topic: [] for topic in (*RECORDED, *OTHERS)}
        self.announced = -2
        # What is being brought to the disk, and up to which tick.
        self.flushed: tuple[Future[None], int] | None = None
        self.parameters: dict[str, dict[str, Any]] = {"recorder": parameter_values(self)}
        self.askers: dict[str, AsyncParameterClient] = {}
        self.asked: dict[str, float] = {}
        self.first_message: float | None = None
        self.last_message = -math.inf
        self.progress = self.create_publisher(Recorded, exchanged("recorded"), LATCHED)
        self.ticked = {
            topic: self.create_subscription(class_of(topic), exchanged(topic), refuse, STREAM, raw=True)
            for topic in RECORDED
        }
        self.others = {
            topic: self.create_subscription(
                kind, topic, refuse, EVERY, raw=True, event_callbacks=QUIET if topic in SOURCES else None
            )
            for topic, kind in OTHERS.items()
        }
        self.create_timer(LOOK_PERIOD, self.suit_sources, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self.create_timer(POLL_PERIOD, self.on_poll, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self.description: str | None = None
        self.listen(String, "robot_description", self.on_description, LATCHED)
        self.carry(RecordingPart(**self.common), listen=False)
        self.asking = self.create_timer(0.05, self.ask)

    def suit_sources(self) -> None:
        """Subscribe as best-effort sources need it, once there is one."""
        for topic, kind in SOURCES.items():
            if self.others[topic].qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT:
                continue
            if (quality := quality_for(self, topic)) is BEST_EFFORT:
                self.destroy_subscription(self.others[topic])
                self.others[topic] = self.create_subscription(
                    kind, topic, refuse, quality, raw=True, event_callbacks=QUIET
                )

    def on_claim(self, claim: Claim) -> None:
        """Without an identity of its own, record the run that was heard of last, until its first message is there."""
        new = claim.run != self.part.identity and is_identity(claim.run)
        if new and not self.given_identity and self.first_message is None:
            self.part.join(claim.run)
            self.announced = -2
            self.announce()
        super().on_claim(claim)

    @property
    def leaves(self) -> bool:
        """Not before the last messages of the run have come."""
        return super().leaves and time.monotonic() - self.last_message > SETTLED

    def parameters_of_following(self) -> dict[str, Any]:
        """The run that follows has a bag of its own."""
        return {**super().parameters_of_following(), "out": str(next_free(Path(self.path)))}

    def on_description(self, message: String) -> None:
        """Write the robot description, or keep it until the bag is open."""
        if self.description is None:
            self.description = message.data
            if self.writer is not None:
                self.write("robot_description", 0, message)

    def ask(self) -> None:
        """Ask the other nodes for their parameters until all have told them; then open the bag."""
        present = set(self.get_node_names_and_namespaces())
        now = time.monotonic()
        for name in NODES:
            if name in self.parameters or (name, self.get_namespace()) not in present:
                continue
            if name not in self.askers:
                self.askers[name] = AsyncParameterClient(self, name)
            client = self.askers[name]
            # An answer may be lost: the node is started anew, or has not found the one who asks yet.
            if now - self.asked.get(name, -math.inf) > ASK_AGAIN and client.services_are_ready():
                self.asked[name] = now
                client.list_parameters(callback=partial(self.on_names, name, client))
        self.part.unknown = [name for name in NODES if name not in self.parameters]
        waited = self.first_message is not None and now - self.first_message > PATIENCE
        if set(self.parameters) >= set(NODES) or waited:
            self.asking.cancel()
            self.part.unknown = []
            try:
                self.open()
            except UserError as error:
                self.fail(error)

    def on_look(self) -> None:
        """Also say again that the run may start, until it does: whoever has missed it would wait for ever."""
        super().on_look()
        if self.announced == -1 and self.first_message is None:
            self.progress.publish(Recorded(run=self.part.identity, tick=self.announced))

    def on_names(self, node: str, client: AsyncParameterClient, future: Any) -> None:
        """Ask for the values of a node's parameters."""
        names = list(future.result().result.names)
        client.get_parameters(names, callback=partial(self.on_values, node, names))

    def on_values(self, node: str, names: list[str], future: Any) -> None:
        """Keep the values of a node's parameters."""
        values = [parameter_value_to_python(value) for value in future.result().values]
        parameters = dict(zip(names, values, strict=True))
        # If a node of another run has answered, the node is asked again.
        if parameters.get("identity") in (self.given_identity, self.part.identity):
            self.parameters[node] = parameters

    def open(self) -> None:
        """Make the bag, write what has come so far, and say that the run may start."""
        self.part.expect_states(self.parameters.get("muscle_stack", {}))
        self.part.ready = set(self.parameters) >= set(NODES)
        self.writer = BagWriter(self.path, self.run_info(), namespace=self.get_namespace(), latched=LATCHED_TOPICS)
        self.writer.expect(
            {topic: TOPIC_TYPES[topic] for topic in ("joint_states", "/diagnostics", *self.part.expected)}
        )
        if self.description is not None:
            self.write("robot_description", 0, String(data=self.description))
        if self.resume and self.copies:
            copy(self.recorded_run().up_to(self.part.complete), self.writer)
        self.announce()

    def write(self, topic: str, stamp: int, message: Any) -> None:
        """Write a message of rclpy."""
        assert self.writer is not None
        self.writer.write_raw(topic, stamp, serialize_message(message), TOPIC_TYPES[topic])

    def run_info(self) -> dict[str, Any]:
        """What is needed to run again what the bag holds."""
        return {
            "limb": self.limb.text,
            "limb_file": self.limb.file,
            "laws": self.limb.code.sources,
            "command": self.command,
            "rate": self.ticks.rate,
            "period_ns": self.ticks.nanoseconds,
            "parameters": self.parameters,
            "versions": versions(),
            # Nothing in a run is random; recordings made with noise would name theirs here.
            "seed": None,
        }

    @property
    def subscriptions(self) -> Iterator[Subscription[Any]]:
        """Those of which an executor takes the messages."""
        polled = [*self.ticked.values(), *self.others.values()]
        return (subscription for subscription in super().subscriptions if subscription not in polled)

    def on_poll(self) -> None:
        """Write what has come; what cannot be written ends the node, in one line."""
        try:
            self.poll()
        except UserError as error:
            self.fail(error)

    def poll(self) -> None:
        """Write what has come on every topic, and say how far the ticks are complete."""
        come = {
            topic: list(taken(subscription)) for topic, subscription in (*self.ticked.items(), *self.others.items())
        }
        if self.first_message is None and any(come[topic] for topic in RECORDED):
            self.first_message = time.monotonic()
        if self.writer is None:
            for topic, messages in come.items():
                self.early[topic] += messages
            return
        for topic in self.ticked:
            if messages := self.part.drain(topic, [*self.early.pop(topic, ()), *come[topic]]):
                self.last_message = time.monotonic()
                self.writer.write_many(topic, messages, TOPIC_TYPES[topic])
                if topic == "movement_pattern":
                    states = self.part.joint_states(messages)
                    self.writer.write_many("joint_states", states, TOPIC_TYPES["joint_states"])
        # After the ticks: what a node says before its last one is there when that one is.
        now = max(0, self.part.newest("movement_pattern")) * self.ticks.nanoseconds
        for topic in self.others:
            if others := [(now, data) for data in (*self.early.pop(topic, ()), *come[topic])]:
                self.writer.write_many(topic, others, TOPIC_TYPES[topic])
        self.announce()

    def announce(self) -> None:
        """Publish the newest tick that is on the disk on every topic."""
        part = self.part
        if self.writer is None or not part.identity:
            return
        complete = part.complete
        part.finished = 0 <= part.last_tick <= complete
        if self.flushed is None and complete >= self.announced + (FLUSHED if self.announced >= 0 else 1):
            self.flushed = self.writer.flush(), complete
        if self.flushed is not None and self.flushed[0].done():
            (_, self.announced), self.flushed = self.flushed, None
            self.progress.publish(Recorded(run=part.identity, tick=self.announced))

    def destroy_node(self) -> None:
        """Close the bag, so that it is readable however the run ended."""
        try:
            if not self.failure:
                if self.writer is None and any(self.early[topic] for topic in RECORDED):
                    self.open()
                self.poll()
        finally:
            if self.writer is not None:
                self.writer.close()
            super().destroy_node()


def refuse(message: bytes) -> None:
    """The callback of a topic that is polled."""
    raise AssertionError("an executor has taken a message of the recorder")


main: Callable[..., None] = main_of(Recorder)

if __name__ == "__main__":
    main()
