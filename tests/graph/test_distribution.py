"""What we use of rclpy's internals is there and does what we take it for, on the distribution that is installed."""

from __future__ import annotations

import rclpy
from rclpy.duration import Duration
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import Header

from limb_nodes.nodes import distribution


def test_the_executor_is_the_fast_one_and_handles_events(bench):
    graph = bench()
    assert type(graph.executor).__name__ == "EventsExecutor"
    heard = graph.listen(Header, "topic", 10)
    graph.publisher(Header, "topic", 10).publish(Header(frame_id="a"))
    graph.until(lambda: heard, "the message")
    assert heard == [Header(frame_id="a")]


def test_messages_are_taken_as_bytes_in_their_order(bench):
    graph = bench()
    subscription = graph.probe.create_subscription(Header, "topic", lambda message: None, 10, raw=True)
    # An executor that has the node would take the messages first.
    graph.executor.remove_node(graph.probe)
    sender = rclpy.create_node("sender", context=graph.context)
    graph.nodes.append(sender)
    publisher = sender.create_publisher(Header, "topic", QoSProfile(depth=10))
    graph.until(publisher.get_subscription_count, "the subscription")
    sent = [Header(frame_id=text) for text in ("a", "b", "c")]
    for message in sent:
        publisher.publish(message)
    heard: list[bytes] = []
    graph.until(lambda: heard.extend(distribution.taken(subscription)) or len(heard) == 3, "the messages")
    assert [deserialize_message(data, Header) for data in heard] == sent
    for data, message in zip(heard, sent, strict=True):
        assert data.startswith(serialize_message(message)[:14])
    assert list(distribution.taken(subscription)) == []


def test_parameters_can_be_changed_before_and_read_after_they_are_declared(bench):
    graph = bench()
    node = rclpy.create_node(
        "node", context=graph.context, parameter_overrides=[Parameter("a", value=1), Parameter("b", value=2)]
    )
    graph.nodes.append(node)
    given = distribution.given_parameters(node)
    assert {name: parameter.value for name, parameter in given.items()} == {"a": 1, "b": 2}
    given["a"] = Parameter("a", value=1.5)
    assert node.declare_parameter("a", 0.0).value == 1.5
    node.declare_parameter("c", "text")
    values = distribution.parameter_values(node)
    assert {name: values.get(name) for name in "abc"} == {"a": 1.5, "b": None, "c": "text"}


def test_an_executor_leaves_alone_what_is_no_subscription_of_its_node(bench):
    """The recorder hides those that it polls."""
    from limb_msgs.msg import MuscleActivation

    class Hiding(rclpy.node.Node):
        @property
        def subscriptions(self):
            return iter(())

    graph = bench()
    node = Hiding("hiding", context=graph.context)
    taken: list[bytes] = []
    subscription = node.create_subscription(MuscleActivation, "topic", taken.append, 10, raw=True)
    graph.nodes.append(node)
    graph.executor.add_node(node)
    graph.publisher(MuscleActivation, "topic", 10).publish(MuscleActivation(tick=3))
    left: list[bytes] = []
    graph.until(lambda: left.extend(distribution.taken(subscription)) or left, "the message")
    assert taken == []


def test_what_has_come_without_the_executors_notice_is_taken_once(bench, until, limb):
    from limb_nodes.nodes.limb_dynamics import LimbDynamics

    graph = bench()
    node = graph.add(LimbDynamics, limb=limb, rate=200.0)
    heard: list[Header] = []
    node.listen(Header, "topic", heard.append, 10)
    publisher = graph.publisher(Header, "topic", 10)
    publisher.publish(Header(frame_id="a"))
    # The executor has no turn.
    until(lambda: publisher.wait_for_all_acked(Duration(seconds=1.0)), "the message to arrive")
    until(lambda: node.take_unnoticed() or heard, "it to be taken")
    publisher.publish(Header(frame_id="b"))
    graph.until(lambda: len(heard) > 1, "the next one, by the executor")
    assert [message.frame_id for message in heard] == ["a", "b"]
