"""Node limb_dynamics: from joint torques to joint states and the movement pattern."""

from __future__ import annotations

import inspect
import time
from collections import OrderedDict
from typing import Any

import numpy as np
from geometry_msgs.msg import Point, WrenchStamped
from limb_msgs.msg import JointTorque, MovementPattern
from rclpy.clock import Clock, ClockType
from sensor_msgs.msg import JointState
from std_msgs.msg import Header, String

from limb_nodes.errors import UserError
from limb_nodes.model.points import point_names, points
from limb_nodes.nodes.base import LimbNode
from limb_nodes.nodes.identity import comes_before, new_claim, new_identity
from limb_nodes.nodes.qos import LATCHED, LIVE, RECORDER_LAG, STREAM
from limb_nodes.nodes.running import main_of
from limb_nodes.nodes.urdf import urdf
from limb_nodes.nodes.wire import Incoming, Outgoing
from limb_nodes.solve.small import finite
from limb_nodes.solve.stepping import LimbStepper

TORQUE_FIELDS = ("torque", "slope_angle", "slope_velocity", "slope_time")
REMEMBERED = 1000
# How long the limb goes on with a torque in real time (s). Farther its slopes say nothing.
MOST_AHEAD = 0.05
REPORT_PERIOD = 1.0


class LimbDynamics(LimbNode):
    """Offers joint_states 0, then steps from tick to tick.

    In lockstep joint_torque k leads to joint_states k + 1. In real time a wall timer at the fixed
    rate does, with the newest torque; ticks whose torque is not there in time are counted.
    It claims the namespace for its run, and ends if another run's claim comes before.
    Subscribes `joint_torque`, `external_load` and `run_identity`; publishes `run_identity`, `joint_states`,
    `movement_pattern`, `robot_description` and `/diagnostics`.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__("limb_dynamics", **options)
        self.awaits_recorder = self.switch(
            "await_recorder", False, "start with the recorder and never run farther ahead than it can take"
        )
        if not self.identity:
            self.join(new_identity())
        self.stepper = LimbStepper(self.limb)
        self.joints = self.limb.joint_names
        self.tick = 0
        self.most_ahead = max(1, round(MOST_AHEAD / self.ticks.period))
        self.behind = False
        self.missed = 0
        self.told = 0
        self.recorded = -1
        self.pending: bytes | None = None
        self.newest: tuple[int, np.ndarray] | None = None
        self.history: OrderedDict[int, tuple[np.ndarray, np.ndarray]] = OrderedDict()
        self.started_at: float | None = None
        self.last_report = 0.0
        self.last_tick = -1
        self.joint_states, self.pattern = self.messages()
        self.torque = Incoming(JointTorque, "joint", self.ticks.nanoseconds)
        zeros = [0.0] * len(self.joints)
        self.torque.expect(JointTorque(joint=self.joints, **dict.fromkeys(TORQUE_FIELDS, zeros)))
        self.description = self.create_publisher(String, "robot_description", LATCHED)
        self.description.publish(String(data=urdf(self.limb)))
        self.claims = self.create_publisher(Header, "run_identity", LATCHED)
        self.claim = new_claim(self.identity)
        self.claims.publish(self.claim)
        self.listen(Header, "run_identity", self.on_claim, STREAM)
        self.listen_to_run(JointTorque, "joint_torque", self.on_torque)
        self.listen(WrenchStamped, "external_load", self.on_load, LIVE)
        if self.awaits_recorder:
            self.listen(Header, "recorder_progress", self.on_recorded, STREAM)
        else:
            self.offer()
        if self.mode == "realtime":
            # The first warning would look through all modules for its caller, which takes as long as many ticks.
            inspect.getmodule(inspect.currentframe())
            steady = Clock(clock_type=ClockType.STEADY_TIME)
            self.create_timer(self.ticks.period, self.on_timer, clock=steady)

    def messages(self) -> tuple[Outgoing, Outgoing]:
        """The messages of joint states and of the movement pattern."""
        zeros, points_of = [0.0] * len(self.joints), point_names(self.limb)
        states = JointState(name=self.joints, position=zeros, velocity=zeros)
        pattern = MovementPattern(
            joint=self.joints,
            angle=zeros,
            velocity=zeros,
            acceleration=zeros,
            point=points_of,
            position=[Point() for _ in points_of],
        )
        return self.outgoing("joint_states", states), self.outgoing("movement_pattern", pattern)

    def offer(self) -> None:
        """Publish the joint states of the current tick."""
        values = self.joint_states.values
        values["position"][:], values["velocity"][:] = self.stepper.angle, self.stepper.velocity
        self.joint_states.publish(self.tick)

    def on_claim(self, other: Header) -> None:
        """Give way to a run that claimed before; tell one that did not again whose the namespace is."""
        if other.frame_id == self.identity:
            return
        if comes_before(other, self.claim):
            raise UserError(
                f"namespace is {self.get_namespace()}, in which the run {other.frame_id} is in place; another "
                "namespace, or another ROS_DOMAIN_ID, is needed"
            )
        self.claims.publish(self.claim)

    def on_recorded(self, message: Header) -> None:
        """The recorder has every tick up to this one; -1 when it is ready."""
        if message.frame_id != self.identity:
            return
        first = self.recorded < 0 and self.tick == 0 and not self.history
        self.recorded = self.ticks.tick(message.stamp)
        if first and self.recorded < 0:
            self.history[-1] = self.stepper.angle.copy(), self.stepper.velocity.copy()
            self.offer()
        elif self.pending is not None and self.tick - self.recorded <= RECORDER_LAG:
            held, self.pending = self.pending, None
            self.on_torque(held)

    def on_load(self, message: WrenchStamped) -> None:
        """Take over force and torque on the tip."""
        force, torque = message.wrench.force, message.wrench.torque
        values = np.array([force.x, force.y, torque.z])
        if finite(values):
            self.stepper.load[:] = values
        else:
            self.complain("external_load: a force or torque is not finite")

    def on_torque(self, data: bytes) -> None:
        """Take over a torque; in lockstep also step."""
        message = self.torque
        try:
            tick = message.read(data)
        except ValueError as problem:
            self.complain(f"joint_torque: {problem}")
            return
        rows = np.empty((4, len(self.joints)))
        fields = [message[name] for name in TORQUE_FIELDS]
        if message.names == self.joints and all(len(field) == len(self.joints) for field in fields):
            rows[:] = fields
        else:
            rows[:] = np.nan
        if not finite(rows.reshape(-1)):
            self.complain(f"joint_torque of tick {tick}: finite numbers for {', '.join(self.joints)} are needed")
            return
        self.last_tick = int(message["last_tick"][0])
        if self.mode == "realtime":
            if self.newest is None or tick > self.newest[0]:
                self.newest = tick, rows
            if self.behind:
                self.catch_up(int(self.elapsed()))
            return
        if tick != self.tick or self.finished:
            return
        if self.awaits_recorder and self.tick - self.recorded > RECORDER_LAG:
            self.pending = data
            return
        self.step(rows)

    def on_timer(self) -> None:
        """Step as far as the wall clock has gone; what cannot be solved ends the node, in one line."""
        if self.newest is None or self.finished:
            return
        now = time.monotonic()
        if self.started_at is None:
            self.started_at = now - self.ticks.period
        try:
            self.catch_up(self.due())
        except UserError as error:
            self.failure = self.failure or str(error)
        if now - self.last_report >= REPORT_PERIOD:
            self.last_report = now
            self.report()

    def catch_up(self, due: int) -> None:
        """Step to the tick that is due, with the newest torque.

        A tick on time makes do with the torque of one before. A late one waits for its own: muscles that are behind
        would answer a movement that went on without them, and throw the limb about.
        """
        self.behind = False
        while self.tick < due and not self.finished:
            assert self.newest is not None
            tick, rows = self.newest
            late = self.tick + 1 < due
            if tick != self.tick and (late or self.tick - tick >= self.most_ahead):
                self.behind = True
                break
            # Each tick that came a whole period late, or without its own torque, is one missed deadline.
            self.missed += late or tick != self.tick
            if tick != self.tick:
                rows = self.carried(tick, rows)
            self.step(rows)

    def elapsed(self) -> float:
        """How many ticks the wall clock has gone."""
        assert self.started_at is not None
        return (time.monotonic() - self.started_at) / self.ticks.period

    def due(self) -> int:
        """How many ticks are due when the timer fires."""
        assert self.started_at is not None
        elapsed = self.elapsed()
        early = self.tick + 1 - elapsed
        if 0.0 < early < 0.5:
            # The timer keeps its phase; when it was taken, the call was late.
            self.started_at -= early * self.ticks.period
            return self.tick + 1
        return int(elapsed)

    def carried(self, tick: int, rows: np.ndarray) -> np.ndarray:
        """The torque of an older tick, carried to the current state along its slopes."""
        if tick not in self.history:
            return rows
        angle, velocity = self.history[tick]
        carried = rows.copy()
        carried[0] += (
            rows[1] * (self.stepper.angle - angle)
            + rows[2] * (self.stepper.velocity - velocity)
            + rows[3] * (self.tick - tick) * self.ticks.period
        )
        return carried

    def step(self, rows: np.ndarray) -> None:
        """Publish the movement pattern of this tick and go on to the next."""
        self.finished = 0 <= self.last_tick <= self.tick
        if self.finished and self.mode == "realtime":
            # Before the message with which the recording ends.
            self.report()
        self.publish_pattern(self.stepper.acceleration(rows))
        if self.finished:
            return
        if self.mode == "realtime":
            self.history[self.tick] = self.stepper.angle.copy(), self.stepper.velocity.copy()
            if len(self.history) > REMEMBERED:
                self.history.popitem(last=False)
        self.stepper.step(rows, self.ticks.period)
        self.tick += 1
        self.offer()

    def publish_pattern(self, acceleration: np.ndarray) -> None:
        """Publish angles, velocities, accelerations and points of this tick."""
        values = self.pattern.values
        values["angle"][:], values["velocity"][:] = self.stepper.angle, self.stepper.velocity
        values["acceleration"][:] = acceleration
        values["position"][:, :2] = points(self.limb, self.stepper.angle)
        self.pattern.publish(self.tick)

    def report(self) -> None:
        """Publish how real time is kept."""
        message = f"{self.missed} missed deadlines in {self.tick} ticks"
        self.diagnose(message, bad=bool(self.missed), ticks=self.tick, missed_deadlines=self.missed)
        if self.missed > self.told:
            self.told = self.missed
            self.get_logger().warning(message)

    def destroy_node(self) -> None:
        """Tell how real time was kept if the run is ended before its last tick."""
        if self.started_at is not None and not self.finished:
            self.report()
        super().destroy_node()


main = main_of(LimbDynamics)

if __name__ == "__main__":
    main()
