"""Node muscle_stack: from activations and joint states to joint torques."""

from __future__ import annotations

from typing import Any

import numpy as np
from limb_msgs.msg import JointTorque, MotorUnitState, MuscleActivation, MuscleState, SarcomereState
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from limb_nodes.nodes.base import LimbNode, finite, floats
from limb_nodes.nodes.qos import STREAM
from limb_nodes.nodes.running import main_of
from limb_nodes.solve.outputs import (
    MUSCLE_FIELDS,
    MUSCLE_OUTPUTS,
    SARCOMERE_FIELDS,
    UNIT_FIELDS,
    UNIT_OUTPUTS,
)
from limb_nodes.solve.stepping import MuscleStepper


class MuscleStack(LimbNode):
    """Answers joint_states k with joint_torque k once it holds the activations k and k + 1.

    Subscribes `activation` and `joint_states`; publishes `joint_torque`, and on request every
    `state_every` ticks `muscle_state`, `motor_unit_state` and `sarcomere_state`.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__("muscle_stack", **options)
        self.state_every = self.whole("state_every", 1, "publish the states every so many ticks", 1, 1_000_000)
        self.state_publishers = {
            topic: self.create_publisher(kind, topic, STREAM)
            for topic, kind in (
                ("muscle_state", MuscleState),
                ("motor_unit_state", MotorUnitState),
                ("sarcomere_state", SarcomereState),
            )
            if self.switch(f"publish_{topic}", True, f"whether to publish {topic}")
        }
        self.stepper = MuscleStepper(self.limb)
        self.muscles = self.limb.muscle_names
        self.owners = [muscle.name for muscle in self.limb.muscles for _ in muscle.units]
        self.units = [unit.name for muscle in self.limb.muscles for unit in muscle.units]
        n = len(self.limb.segments)
        self.tick = -1
        self.angle, self.velocity = np.zeros(n), np.zeros(n)
        self.drive = self.stepper.drive(np.zeros(len(self.muscles)))
        self.last_drive: np.ndarray | None = None
        self.excitation = np.zeros(len(self.muscles))
        self.inputs: dict[int, tuple[np.ndarray, np.ndarray]] = {}
        self.last: int | None = None
        self.waiting: tuple[int, np.ndarray, np.ndarray] | None = None
        self.torque_publisher = self.create_publisher(JointTorque, "joint_torque", STREAM)
        self.create_subscription(MuscleActivation, "activation", self.on_activation, STREAM)
        self.create_subscription(JointState, "joint_states", self.on_joint_states, STREAM)

    def on_activation(self, message: MuscleActivation) -> None:
        """Keep the activation of a tick."""
        if message.last:
            self.last = message.tick
        if message.tick <= self.tick or message.tick in self.inputs:
            return
        if message.name == self.muscles:
            values = np.array(message.activation)
        else:
            given = dict(zip(message.name, message.activation, strict=False))
            values = np.array([given.get(name, np.nan) for name in self.muscles])
        good = (values >= 0.0) & (values <= 1.0)
        if not good.all():
            name = self.muscles[int(np.flatnonzero(~good)[0])]
            self.complain(f"activation of tick {message.tick}: {name} is not a number from 0 to 1")
            values = np.where(good, values, self.excitation)
        self.excitation = values
        self.inputs[message.tick] = values, self.stepper.drive(values)
        self.answer()

    def on_joint_states(self, message: JointState) -> None:
        """Keep the joint states; in real time the ones before are answered first, with what is there."""
        tick = self.ticks.tick(message.header.stamp)
        if tick <= self.tick or (self.waiting is not None and tick <= self.waiting[0]):
            return
        if message.name == self.limb.joint_names:
            angle, velocity = message.position, message.velocity
        else:
            place = {name: index for index, name in enumerate(message.name)}
            if not place.keys() >= set(self.limb.joint_names):
                self.complain(f"joint_states of tick {tick}: a joint of {', '.join(self.limb.joint_names)} is missing")
                return
            angle = [message.position[place[name]] for name in self.limb.joint_names]
            velocity = [message.velocity[place[name]] for name in self.limb.joint_names]
        if not finite(angle, velocity):
            self.complain(f"joint_states of tick {tick}: an angle or velocity is not finite")
            return
        if self.waiting is not None and self.mode == "realtime":
            self.send(None)
        self.waiting = tick, np.array(angle), np.array(velocity)
        self.answer()

    def answer(self) -> None:
        """Send the torque that is waited for, if its activations are there."""
        if self.waiting is None:
            return
        tick = self.waiting[0]
        if tick in self.inputs and (tick == self.last or tick + 1 in self.inputs):
            self.send(self.inputs.get(tick + 1))

    def send(self, following: tuple[np.ndarray, np.ndarray] | None) -> None:
        """Advance to the tick that waits and publish its torque and states."""
        assert self.waiting is not None
        tick, angle, velocity = self.waiting
        self.waiting = None
        excitation, drive = self.inputs.get(tick, (self.excitation, self.drive))
        if self.tick >= 0:
            period = (tick - self.tick) * self.ticks.period
            before, after = (self.angle, self.velocity), (angle, velocity)
            self.stepper.advance(before, after, self.drive, drive, period, self.last_drive)
        self.last_drive = self.drive if tick == self.tick + 1 and self.tick >= 0 else None
        self.tick, self.angle, self.velocity, self.drive = tick, angle, velocity, drive
        next_drive = drive if following is None else following[1]
        rows = self.stepper.torque(angle, velocity, drive, next_drive, self.ticks.period, self.last_drive)
        header = Header(stamp=self.ticks.stamp(tick))
        if tick % self.state_every == 0 and self.state_publishers:
            self.publish_states(header, tick, excitation)
        self.torque_publisher.publish(
            JointTorque(
                header=header,
                tick=tick,
                joint=self.limb.joint_names,
                torque=floats(rows[0]),
                slope_angle=floats(rows[1]),
                slope_velocity=floats(rows[2]),
                slope_time=floats(rows[3]),
                last=tick == self.last,
            )
        )
        self.finished = tick == self.last
        for old in [key for key in self.inputs if key < tick]:
            del self.inputs[old]

    def publish_states(self, header: Header, tick: int, excitation: np.ndarray) -> None:
        """Publish what muscles, motor units and sarcomeres show at a tick."""
        muscles, units = self.stepper.observe(self.angle, self.velocity, excitation)
        muscle = {name: muscles[:, index] for index, name in enumerate(MUSCLE_OUTPUTS)}
        unit = {name: units[:, index] for index, name in enumerate(UNIT_OUTPUTS)}
        for topic, kind, names, fields, columns in (
            ("muscle_state", MuscleState, {"name": self.muscles}, MUSCLE_FIELDS, muscle),
            ("motor_unit_state", MotorUnitState, {"muscle": self.owners, "unit": self.units}, UNIT_FIELDS, unit),
            ("sarcomere_state", SarcomereState, {"muscle": self.owners, "unit": self.units}, SARCOMERE_FIELDS, unit),
        ):
            if topic in self.state_publishers:
                values = {field: floats(columns[name]) for field, name in fields.items()}
                self.state_publishers[topic].publish(kind(header=header, tick=tick, **names, **values))


main = main_of(MuscleStack)

if __name__ == "__main__":
    main()
