"""Message types by name, and times of messages."""

from __future__ import annotations

import importlib

from builtin_interfaces.msg import Time

from limb_nodes.exchange.ticks import SECOND, Ticks
from limb_nodes.foundation.topics import TOPIC_TYPES


def type_name(kind: type) -> str:
    """The name of a message class, such as limb_msgs/msg/JointTorque."""
    package, folder, *_ = kind.__module__.split(".")
    return f"{package}/{folder}/{kind.__name__}"


def class_of(topic: str) -> type:
    """The message class of a topic."""
    package, folder, name = TOPIC_TYPES[topic].split("/")
    kind: type = getattr(importlib.import_module(f"{package}.{folder}"), name)
    return kind


def stamp_at(tick: int, ticks: Ticks) -> Time:
    """The time of a tick."""
    sec, nanosec = divmod(tick * ticks.nanoseconds, SECOND)
    return Time(sec=sec, nanosec=nanosec)


def tick_of(stamp: Time, ticks: Ticks) -> int:
    """The tick of a time."""
    return round((stamp.sec * SECOND + stamp.nanosec) / ticks.nanoseconds)
