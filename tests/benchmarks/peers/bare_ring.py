"""A bare ring of three rclpy nodes: the messages and topics of the graph in lockstep, and nothing computed.

What remains is the transport: messages are made once, only stamp and tick change.
"""

from __future__ import annotations

from array import array
from typing import Any

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point
from limb_msgs.msg import JointTorque, MovementPattern, MuscleActivation
from rclpy.node import Node
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState

SECOND = 1_000_000_000
PERIOD = 1_000_000


def stamp(message: Any, tick: int) -> None:
    """Set the time of a message."""
    sec, nanosec = divmod(tick * PERIOD, SECOND)
    message.header.stamp = Time(sec=sec, nanosec=nanosec)


class BareInput(Node):
    """On joint_states k sends activation k + 1, and activation 0 before it."""

    def __init__(self, muscles: list[str], joints: list[str], last: int, qos: QoSProfile, **options: Any) -> None:
        super().__init__("bare_input", **options)
        self.last, self.finished, self.sent = last, False, -1
        self.message = MuscleActivation(name=muscles, activation=array("d", [0.5] * len(muscles)))
        self.publisher = self.create_publisher(MuscleActivation, "activation", qos)
        self.create_subscription(JointState, "joint_states", self.on_joint_states, qos)

    def on_joint_states(self, message: JointState) -> None:
        """Send what is needed next."""
        until = (message.header.stamp.sec * SECOND + message.header.stamp.nanosec) // PERIOD + 1
        if until >= self.last:
            until, self.finished = self.last, True
        for tick in range(self.sent + 1, until + 1):
            stamp(self.message, tick)
            self.message.tick = tick
            self.publisher.publish(self.message)
        self.sent = until


class BareMuscles(Node):
    """Answers joint_states k with joint_torque k once the activations k and k + 1 are there."""

    def __init__(self, muscles: list[str], joints: list[str], last: int, qos: QoSProfile, **options: Any) -> None:
        super().__init__("bare_muscles", **options)
        self.last, self.finished = last, False
        self.newest, self.waiting = -1, -1
        zeros = array("d", bytes(8 * len(joints)))
        self.message = JointTorque(
            joint=joints, torque=zeros, slope_angle=zeros, slope_velocity=zeros, slope_time=zeros
        )
        self.publisher = self.create_publisher(JointTorque, "joint_torque", qos)
        self.create_subscription(MuscleActivation, "activation", self.on_activation, qos)
        self.create_subscription(JointState, "joint_states", self.on_joint_states, qos)

    def on_activation(self, message: MuscleActivation) -> None:
        """Note the newest activation."""
        self.newest = message.tick
        self.answer()

    def on_joint_states(self, message: JointState) -> None:
        """Note the tick that waits."""
        self.waiting = (message.header.stamp.sec * SECOND + message.header.stamp.nanosec) // PERIOD
        self.answer()

    def answer(self) -> None:
        """Send the torque that is waited for."""
        tick = self.waiting
        if tick < 0 or self.newest < min(tick + 1, self.last):
            return
        self.waiting = -1
        stamp(self.message, tick)
        self.message.tick = tick
        self.publisher.publish(self.message)
        self.finished = tick == self.last


class BareLimb(Node):
    """Sends joint_states 0, and on joint_torque k movement_pattern k and joint_states k + 1."""

    def __init__(self, muscles: list[str], joints: list[str], last: int, qos: QoSProfile, **options: Any) -> None:
        super().__init__("bare_limb", **options)
        self.last, self.finished, self.tick = last, False, 0
        zeros = array("d", bytes(8 * len(joints)))
        points = [*joints, *(f"{joint}_com" for joint in joints), "tip"]
        self.state = JointState(name=joints, position=zeros, velocity=zeros)
        self.pattern = MovementPattern(
            joint=joints,
            angle=zeros,
            velocity=zeros,
            acceleration=zeros,
            point=points,
            position=[Point() for _ in points],
        )
        self.states = self.create_publisher(JointState, "joint_states", qos)
        self.patterns = self.create_publisher(MovementPattern, "movement_pattern", qos)
        self.create_subscription(JointTorque, "joint_torque", self.on_torque, qos)
        self.states.publish(self.state)

    def on_torque(self, message: JointTorque) -> None:
        """Go on to the next tick."""
        if message.tick != self.tick:
            return
        stamp(self.pattern, self.tick)
        self.pattern.tick = self.tick
        self.patterns.publish(self.pattern)
        if self.tick == self.last:
            self.finished = True
            return
        self.tick += 1
        stamp(self.state, self.tick)
        self.states.publish(self.state)


BARE = {"activation_input": BareInput, "muscle_stack": BareMuscles, "limb_dynamics": BareLimb}
