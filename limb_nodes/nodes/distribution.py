"""What may differ between the distributions of ROS 2: the executor, and what rclpy keeps to itself and we use."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from rclpy.context import Context
from rclpy.executors import Executor, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.subscription import Subscription


def make_executor(context: Context) -> Executor:
    """The events executor, or the single-threaded one if rclpy has no other."""
    try:
        from rclpy.experimental import EventsExecutor
    except ImportError:
        return SingleThreadedExecutor(context=context)
    return EventsExecutor(context=context)


def taken(subscription: Subscription, raw: bool = True) -> Iterator[Any]:
    """The messages that have come on a topic and that no executor has taken; raw: serialised."""
    take, kind = subscription.handle.take_message, subscription.msg_type
    while (message := take(kind, raw)) is not None:
        yield message[0]


def given_parameters(node: Node) -> dict[str, Parameter]:
    """The parameters that whoever starts a node gives it, by name; to change one before it is declared, set it here."""
    return node._parameter_overrides


def parameter_values(node: Node) -> dict[str, Any]:
    """The values of all parameters that a node has declared, by name."""
    return {name: parameter.value for name, parameter in node._parameters.items()}


def subscriptions_of(node: Node) -> list[Subscription]:
    """All subscriptions of a node, those that no executor takes messages of included."""
    return list(node._subscriptions)
