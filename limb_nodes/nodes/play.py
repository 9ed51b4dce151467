"""Playing a recording of envelopes to the nodes, at the pace at which it was recorded."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import count
from typing import Any

import rclpy
from builtin_interfaces.msg import Time
from limb_msgs.msg import EmgEnvelope
from rclpy.context import Context
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.serialization import serialize_message
from std_msgs.msg import Header

from limb_nodes.bags.read import BagReader
from limb_nodes.errors import FieldError, UserError
from limb_nodes.foundation.parameter import Parameter
from limb_nodes.nodes.qos import EVERY
from limb_nodes.nodes.running import Interrupt, acknowledged, check_namespace, init_ros

TOPIC = "emg_envelope"
TYPE = "limb_msgs/msg/EmgEnvelope"
# What bags of former versions have in its place.
FORMER = "limb_msgs/msg/MuscleActivation"
PACE = Parameter("pace", "1", "recorded seconds per second", above=0.0)
WAIT = Parameter("wait", "s", "how long to wait for a subscriber", minimum=0.0)
# Longest sleep, so that Ctrl-C is heard soon (s).
NAP = 0.05
# How long the last message may take to arrive (s).
FAREWELL = 2.0
# Who is no listener: the recorder, and a node whose name is not known yet, for it may be the recorder.
NO_LISTENERS = {"recorder", "_NODE_NAME_UNKNOWN_"}


@dataclass(frozen=True)
class TimedMessages:
    """Serialised messages and when to publish them.

    topic: its name in the bag. times: s after the first message [messages]. messages: CDR.
    """

    topic: str
    times: Sequence[float]
    messages: Sequence[bytes]


@dataclass(frozen=True)
class Played:
    """How it went. messages: published. seconds: wall time from first to last. latest: how late the
    latest message was, s.
    """

    messages: int
    seconds: float
    latest: float
    interrupted: bool


def read_messages(bag: str, topic: str = TOPIC) -> TimedMessages:
    """The messages of a bag's topic. Raises UserError."""
    with BagReader(bag) as reader:
        rows = list(reader.read_raw(topic))
        name = next(name for name in reader.topics if name.endswith(f"/{topic.lstrip('/')}"))
        kind = reader.topics[name]
        former = list(reader.read_topic(topic)) if kind == FORMER else []
    if kind == FORMER:
        rows = [(stamp, serialize_message(envelope_of(message))) for stamp, message in former]
    elif kind != TYPE:
        raise UserError(f"{bag}: topic {name} has type {kind}; {TYPE} is needed")
    if not rows:
        raise UserError(f"{bag}: topic {name} has no message")
    start = rows[0][0]
    return TimedMessages(name, [(stamp - start) * 1e-9 for stamp, _ in rows], [data for _, data in rows])


def envelope_of(message: Any) -> EmgEnvelope:
    """The envelopes of a message of a former version."""
    stamp = message.header.stamp
    header = Header(stamp=Time(sec=stamp.sec, nanosec=stamp.nanosec))
    return EmgEnvelope(header=header, name=list(message.name), envelope=[float(value) for value in message.activation])


def play(
    recording: TimedMessages,
    *,
    pace: float = 1.0,
    loop: bool = False,
    wait: float = 10.0,
    namespace: str = "",
    progress: Callable[[float], None] = lambda seconds: None,
) -> Played:
    """Publish a recording on `emg_envelope`.

    pace: recorded seconds per second. wait: for a subscriber, s; 0 starts at once. progress: called with the
    recorded time reached. Raises FieldError if pace or wait are out of range, or if nobody subscribes in time.
    """
    PACE.check(pace)
    WAIT.check(wait)
    check_namespace(namespace)
    interrupt = Interrupt()
    context = Context()
    init_ros(context)
    node = None
    try:
        node = Node("play", context=context, namespace=namespace or None, start_parameter_services=False)
        publisher = node.create_publisher(EmgEnvelope, TOPIC, EVERY)
        if wait:
            await_listener(node, publisher, wait, interrupt)
        start = time.monotonic()
        # One message interval between the end and the next beginning.
        lap = recording.times[-1] + (recording.times[-1] / max(1, len(recording.times) - 1))
        published, latest = 0, 0.0
        for offset in (lap * round_ for round_ in (count() if loop else range(1))):
            for at, data in zip(recording.times, recording.messages, strict=True):
                due = start + (offset + at) / pace
                while not interrupt.wanted and (left := due - time.monotonic()) > 0.0:
                    time.sleep(min(left, NAP))
                if interrupt.wanted:
                    return Played(published, time.monotonic() - start, latest, True)
                latest = max(latest, time.monotonic() - due)
                publisher.publish(data)
                published += 1
                progress(offset + at)
        seconds = time.monotonic() - start
        while not (interrupt.wanted or acknowledged(publisher)) and time.monotonic() - start < seconds + FAREWELL:
            pass
        return Played(published, seconds, latest, False)
    finally:
        if node is not None:
            node.destroy_node()
        with suppress(Exception):
            rclpy.shutdown(context=context)


def await_listener(node: Node, publisher: Publisher, wait: float, interrupt: Interrupt) -> None:
    """Wait until somebody other than a recorder subscribes, and all who do are connected."""
    end, topic = time.monotonic() + wait, publisher.topic_name
    while not interrupt.wanted:
        listeners = [info.node_name for info in node.get_subscriptions_info_by_topic(topic)]
        if set(listeners) - NO_LISTENERS and publisher.get_subscription_count() >= len(listeners):
            return
        if time.monotonic() > end:
            raise FieldError(
                "wait",
                f"is {wait:g}, and nobody subscribes {topic} within {wait:g} s; nodes in mode realtime without a "
                "source are needed, or 0 to play at once",
            )
        time.sleep(NAP)
