"""Node limb_dynamics: from joint torques to joint states and the movement pattern."""

from __future__ import annotations

import inspect
import time
from typing import Any

import numpy as np
from geometry_msgs.msg import WrenchStamped
from rclpy.clock import Clock, ClockType
from std_msgs.msg import Header, String

from limb_nodes.errors import UserError
from limb_nodes.exchange.identity import new_identity
from limb_nodes.exchange.movement import LimbPart
from limb_nodes.nodes.base import LimbNode
from limb_nodes.nodes.claims import comes_before, new_claim
from limb_nodes.nodes.messages import tick_of
from limb_nodes.nodes.qos import LATCHED, LIVE, STREAM
from limb_nodes.nodes.running import main_of
from limb_nodes.nodes.urdf import urdf
from limb_nodes.solve.small import finite

REPORT_PERIOD = 1.0


class LimbDynamics(LimbNode):
    """Offers joint_states 0, then steps from tick to tick.

    In lockstep joint_torque k leads to joint_states k + 1. In real time a wall timer at the fixed
    rate does, with the newest torque; ticks whose torque is not there in time are counted.
    It claims the namespace for its run, and ends if another run's claim comes before.
    Subscribes `joint_torque`, `external_load` and `run_identity`; publishes `run_identity`, `joint_states`,
    `movement_pattern`, `robot_description` and `/diagnostics`.
    """

    part: LimbPart

    def __init__(self, **options: Any) -> None:
        super().__init__("limb_dynamics", **options)
        awaits = self.switch(
            "await_recorder", False, "start with the recorder and never run farther ahead than it can take"
        )
        part = LimbPart(**self.common, awaits_recorder=awaits)
        part.before_the_end = self.report
        if not part.identity:
            part.join(new_identity())
        self.told = 0
        self.last_report = 0.0
        self.carry(part)
        self.description = self.create_publisher(String, "robot_description", LATCHED)
        self.description.publish(String(data=urdf(self.limb)))
        self.claims = self.create_publisher(Header, "run_identity", LATCHED)
        self.claim = new_claim(part.identity)
        self.claims.publish(self.claim)
        self.listen(Header, "run_identity", self.on_claim, STREAM)
        self.listen(WrenchStamped, "external_load", self.on_load, LIVE)
        if awaits:
            self.listen(Header, "recorder_progress", self.on_progress, STREAM)
        part.begin()
        if self.mode == "realtime":
            # The first warning would look through all modules for its caller, which takes as long as many ticks.
            inspect.getmodule(inspect.currentframe())
            steady = Clock(clock_type=ClockType.STEADY_TIME)
            self.create_timer(self.ticks.period, self.on_timer, clock=steady)

    def on_claim(self, other: Header) -> None:
        """Give way to a run that claimed before; tell one that did not again whose the namespace is."""
        if other.frame_id == self.part.identity:
            return
        if comes_before(other, self.claim):
            raise UserError(
                f"namespace is {self.get_namespace()}, in which the run {other.frame_id} is in place; another "
                "namespace, or another ROS_DOMAIN_ID, is needed"
            )
        self.claims.publish(self.claim)

    def on_progress(self, message: Header) -> None:
        """The recorder has every tick up to this one; -1 when it is ready."""
        if message.frame_id == self.part.identity:
            self.part.on_recorded(tick_of(message.stamp, self.ticks))

    def on_load(self, message: WrenchStamped) -> None:
        """Take over force and torque on the tip."""
        force, torque = message.wrench.force, message.wrench.torque
        values = np.array([force.x, force.y, torque.z])
        if finite(values):
            self.part.stepper.load[:] = values
        else:
            self.part.refuse("external_load: a force or torque is not finite")

    def on_timer(self) -> None:
        """Step as far as the wall clock has gone; what cannot be solved ends the node, in one line."""
        try:
            self.part.step_to_now()
        except UserError as error:
            self.fail(error)
        now = time.monotonic()
        if self.part.started_at is not None and now - self.last_report >= REPORT_PERIOD and not self.part.finished:
            self.last_report = now
            self.report()

    def report(self) -> None:
        """Publish how real time is kept."""
        if self.mode != "realtime":
            return
        missed, ticks = self.part.missed, self.part.tick
        message = f"{missed} missed deadlines in {ticks} ticks"
        self.diagnose(message, bad=bool(missed), ticks=ticks, missed_deadlines=missed)
        if missed > self.told:
            self.told = missed
            self.get_logger().warning(message)

    def destroy_node(self) -> None:
        """Tell how real time was kept if the run is ended before its last tick."""
        if hasattr(self, "part") and self.part.started_at is not None and not self.part.finished:
            self.report()
        super().destroy_node()


main = main_of(LimbDynamics)

if __name__ == "__main__":
    main()
