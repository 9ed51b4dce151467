"""Node muscle_stack: from activations and joint states to joint torques."""

from __future__ import annotations

from typing import Any

import numpy as np
from limb_msgs.msg import JointTorque, MotorUnitState, MuscleActivation, MuscleState, SarcomereState
from sensor_msgs.msg import JointState

from limb_nodes.nodes.base import LimbNode
from limb_nodes.nodes.running import main_of
from limb_nodes.nodes.wire import Incoming, Outgoing
from limb_nodes.solve.outputs import (
    MUSCLE_FIELDS,
    MUSCLE_OUTPUTS,
    SARCOMERE_FIELDS,
    UNIT_FIELDS,
    UNIT_OUTPUTS,
)
from limb_nodes.solve.small import finite, within_unit
from limb_nodes.solve.stepping import MuscleStepper


class MuscleStack(LimbNode):
    """Answers joint_states k with joint_torque k once it holds the activations k and k + 1.

    Subscribes `activation` and `joint_states`; publishes `joint_torque`, and on request every
    `state_every` ticks `muscle_state`, `motor_unit_state` and `sarcomere_state`.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__("muscle_stack", **options)
        self.state_every = self.whole("state_every", 1, "publish the states every so many ticks", 1, 1_000_000)
        self.stepper = MuscleStepper(self.limb)
        self.muscles = self.limb.muscle_names
        n = len(self.limb.segments)
        self.tick = -1
        self.angle, self.velocity = np.zeros(n), np.zeros(n)
        self.drive = self.stepper.drive(np.zeros(len(self.muscles)))
        self.last_drive: np.ndarray | None = None
        self.excitation = np.zeros(len(self.muscles))
        self.inputs: dict[int, tuple[np.ndarray, np.ndarray]] = {}
        self.last_tick = -1
        self.waiting: tuple[int, np.ndarray, np.ndarray] | None = None
        joints = self.limb.joint_names
        zeros = [0.0] * n
        example = JointTorque(joint=joints, torque=zeros, slope_angle=zeros, slope_velocity=zeros, slope_time=zeros)
        nanoseconds = self.ticks.nanoseconds
        self.torque = self.outgoing("joint_torque", example)
        self.states = self.state_topics()
        self.activation = Incoming(MuscleActivation, "name", nanoseconds)
        self.activation.expect(MuscleActivation(name=self.muscles, activation=[0.0] * len(self.muscles)))
        self.joint_states = Incoming(JointState, "name", nanoseconds)
        self.joint_states.expect(JointState(name=joints, position=zeros, velocity=zeros))
        self.listen_to_run(MuscleActivation, "activation", self.on_activation)
        self.listen_to_run(JointState, "joint_states", self.on_joint_states)

    def state_topics(self) -> list[tuple[Outgoing, list[tuple[np.ndarray, np.ndarray]]]]:
        """The topics of states that are switched on: messages, and pairs of target and source to copy."""
        muscles, units = self.stepper.shown
        of_unit = {
            "muscle": [muscle.name for muscle in self.limb.muscles for _ in muscle.units],
            "unit": [unit.name for muscle in self.limb.muscles for unit in muscle.units],
        }
        topics = []
        for topic, kind, texts, fields, outputs, shown in (
            ("muscle_state", MuscleState, {"name": self.muscles}, MUSCLE_FIELDS, MUSCLE_OUTPUTS, muscles),
            ("motor_unit_state", MotorUnitState, of_unit, UNIT_FIELDS, UNIT_OUTPUTS, units),
            ("sarcomere_state", SarcomereState, of_unit, SARCOMERE_FIELDS, UNIT_OUTPUTS, units),
        ):
            if not self.switch(f"publish_{topic}", True, f"whether to publish {topic}"):
                continue
            example = kind(**texts, **{field: [0.0] * len(shown) for field in fields})
            message = self.outgoing(topic, example)
            copies = [(message.values[field], shown[:, outputs.index(name)]) for field, name in fields.items()]
            topics.append((message, copies))
        return topics

    def on_activation(self, data: bytes) -> None:
        """Keep the activation of a tick."""
        message = self.activation
        try:
            tick = message.read(data)
        except ValueError as problem:
            self.complain(f"activation: {problem}")
            return
        self.last_tick = int(message["last_tick"][0])
        if tick <= self.tick or tick in self.inputs:
            return
        values = in_order(message, "activation", self.muscles)
        if not within_unit(values):
            good = (values >= 0.0) & (values <= 1.0)
            name = self.muscles[int(np.flatnonzero(~good)[0])]
            self.complain(f"activation of tick {tick}: {name} is not a number from 0 to 1")
            values = np.where(good, values, self.excitation)
        self.excitation = values
        self.inputs[tick] = values, self.stepper.drive(values)
        self.answer()

    def on_joint_states(self, data: bytes) -> None:
        """Keep the joint states; in real time the ones before are answered first, with what is there."""
        message = self.joint_states
        try:
            tick = message.read(data)
        except ValueError as problem:
            self.complain(f"joint_states: {problem}")
            return
        if tick <= self.tick or (self.waiting is not None and tick <= self.waiting[0]):
            return
        angle = in_order(message, "position", self.limb.joint_names)
        velocity = in_order(message, "velocity", self.limb.joint_names)
        if not (finite(angle) and finite(velocity)):
            self.complain(
                f"joint_states of tick {tick}: finite angles and velocities of "
                f"{', '.join(self.limb.joint_names)} are needed"
            )
            return
        if self.waiting is not None and self.mode == "realtime":
            self.send(None)
        self.waiting = tick, angle, velocity
        self.answer()

    def answer(self) -> None:
        """Send the torque that is waited for, if its activations are there."""
        if self.waiting is None:
            return
        tick = self.waiting[0]
        if tick in self.inputs and (tick == self.last_tick or tick + 1 in self.inputs):
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
        if self.states and tick % self.state_every == 0:
            self.stepper.observe(angle, velocity, excitation)
            for states, copies in self.states:
                for target, source in copies:
                    target[:] = source
                states.publish(tick)
        values = self.torque.values
        values["torque"][:], values["slope_angle"][:] = rows[0], rows[1]
        values["slope_velocity"][:], values["slope_time"][:] = rows[2], rows[3]
        values["last_tick"][...] = self.last_tick
        self.torque.publish(tick)
        self.finished = 0 <= self.last_tick <= tick
        for old in [key for key in self.inputs if key < tick]:
            del self.inputs[old]


def in_order(message: Incoming, field: str, names: list[str]) -> np.ndarray:
    """Numbers of a message in the order of `names`, NaN for those that it lacks, or all if it is malformed."""
    values = message[field]
    if len(values) != len(message.names):
        return np.full(len(names), np.nan)
    if message.names == names:
        return values.astype(np.float64)
    given = dict(zip(message.names, values, strict=True))
    return np.array([given.get(name, np.nan) for name in names])


main = main_of(MuscleStack)

if __name__ == "__main__":
    main()
