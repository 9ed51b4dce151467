"""Node limb_dynamics: from joint torques to joint states and the movement pattern."""

from __future__ import annotations

import inspect
from typing import Any

from geometry_msgs.msg import TransformStamped, WrenchStamped
from limb_msgs.msg import Claim, Recorded
from rclpy.clock import Clock, ClockType
from rosgraph_msgs.msg import Clock as ClockMessage
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import Trigger

from limb_nodes.errors import UserError
from limb_nodes.exchange.held import Held
from limb_nodes.exchange.identity import new_identity
from limb_nodes.exchange.movement import LimbPart
from limb_nodes.foundation.topics import exchanged
from limb_nodes.model.urdf import urdf
from limb_nodes.nodes.base import OK, STALE, LimbNode
from limb_nodes.nodes.claims import comes_before, new_claim
from limb_nodes.nodes.messages import stamp_at, tick_of
from limb_nodes.nodes.onlookers import Onlookers
from limb_nodes.nodes.outside import command_of, load_of
from limb_nodes.nodes.qos import BEST_EFFORT, EVERY, LATCHED, LIVE, STREAM
from limb_nodes.nodes.running import main_of
from limb_nodes.nodes.transforms import message_class, transforms

# How long a load or a command acts unless another one comes (s).
TIMEOUT = 0.5
MOST_TICKS = 1_000_000


class LimbDynamics(LimbNode):
    """Offers the limb's state at tick 0, then steps from tick to tick.

    In lockstep joint_torque k leads to the state k + 1. In real time a wall timer at the fixed
    rate does, with the newest torque; ticks whose torque is not there in time are counted.
    It claims the namespace for its run, and ends if another run's claim comes before. The service `reset` begins anew.
    Subscribes `external_load` and `joint_command`; publishes `joint_states`, `movement_pattern`, `robot_description`,
    `/diagnostics` and, on request, `/clock` and `/tf`.
    """

    part: LimbPart

    def __init__(self, **options: Any) -> None:
        super().__init__("limb_dynamics", **options)
        awaits = self.switch(
            "await_recorder", False, "start with the recorder and never run farther ahead than it can take"
        )
        every = self.whole(
            "command_every", 0, "lockstep: wait for joint_command every so many ticks; 0: do not wait", 0, MOST_TICKS
        )
        acts = "acts, s of simulation time; 0: until the next one"
        timeouts = {
            name: self.number(name, TIMEOUT, f"how long {meaning} {acts}", 0.0, 1e9)
            for name, meaning in (("command_timeout", "a joint_command"), ("load_timeout", "an external_load"))
        }
        self.prefix = self.frame_prefix()
        ticking = self.switch("publish_clock", False, "publish simulation time on /clock")
        transforming = self.switch("publish_tf", False, "publish the frames of the segments on /tf; needs tf2_msgs")
        frames = message_class() if transforming else None
        part = LimbPart(
            **self.common, awaits_recorder=awaits, command_every=every, frame_prefix=self.prefix, **timeouts
        )
        part.before_the_end = self.report_the_end
        if not part.identity:
            part.join(new_identity())
        self.told = 0
        self.clock = self.create_publisher(ClockMessage, "/clock", LIVE) if ticking else None
        onlookers = Onlookers(self.create_publisher(JointState, "joint_states", LIVE))

        def show(data: bytes) -> None:
            if self.clock is not None:
                self.clock.publish(ClockMessage(clock=stamp_at(part.tick, self.ticks)))
            onlookers.send(data)

        part.joint_states.send = show
        self.carry(part)
        self.description = self.create_publisher(String, "robot_description", LATCHED)
        self.description.publish(String(data=urdf(self.limb)))
        self.claims = self.create_publisher(Claim, exchanged("claim"), LATCHED)
        self.claim = self.new_claim(part.identity, "".join(self.former[-1:]))
        self.claims.publish(self.claim)
        if frames is not None:
            self.show(lambda: frames(transforms=self.transforms()), self.create_publisher(frames, "/tf", LIVE))
        self.listen(WrenchStamped, "external_load", self.on_load, BEST_EFFORT)
        # Whoever is waited for must not be lost.
        self.listen(JointState, "joint_command", self.on_command, EVERY if every else BEST_EFFORT)
        if awaits:
            self.listen(Recorded, exchanged("recorded"), self.on_progress, STREAM)
        part.begin()
        if self.mode == "realtime":
            # The first warning would look through all modules for its caller, which takes as long as many ticks.
            inspect.getmodule(inspect.currentframe())
            steady = Clock(clock_type=ClockType.STEADY_TIME)
            self.create_timer(self.ticks.period, self.on_timer, clock=steady)

    def transforms(self) -> list[TransformStamped]:
        """The frames of the segments at the newest tick."""
        stamp = stamp_at(self.part.tick, self.ticks)
        return transforms(self.limb, self.part.stepper.angle, stamp, self.prefix)

    def on_claim(self, claim: Claim) -> None:
        """Give way to a run that claimed before; tell one that did not again whose the namespace is."""
        if claim.run in (self.part.identity, self.following):
            return
        if comes_before(claim, self.claim):
            raise UserError(
                f"namespace is {self.get_namespace()}, in which the run {claim.run} is in place; another "
                "namespace, or another ROS_DOMAIN_ID, is needed"
            )
        self.claims.publish(self.claim)

    def serve(self) -> None:
        """Offer `reset`: the run ends, and its nodes begin another one at tick 0."""
        self.create_service(Trigger, "reset", self.on_reset)

    def on_reset(self, _: Trigger.Request, answer: Trigger.Response) -> Trigger.Response:
        """Let all nodes of the run know the identity of the one that follows."""
        if self.part.tick <= 0:
            answer.message = f"the run {self.part.identity} has not made its first tick; there is nothing to begin anew"
            return answer
        if not self.following:
            self.following = new_identity()
            self.claims.publish(self.new_claim(self.following, self.part.identity))
        answer.success, answer.message = True, f"the run {self.following} begins"
        return answer

    def new_claim(self, identity: str, replaces: str) -> Claim:
        """A claim of the namespace for a run, made now; replaces: the run in whose place it begins."""
        return new_claim(identity, self.limb, self.ticks, self.mode, replaces)

    def on_progress(self, message: Recorded) -> None:
        """The recorder has every tick up to this one; -1 when it is ready."""
        if message.run == self.part.identity:
            self.part.on_recorded(message.tick)

    def on_load(self, message: WrenchStamped) -> None:
        """Take over force and torque on the tip."""
        try:
            values = load_of(message, self.limb, self.part.stepper.angle, self.prefix)
        except ValueError as problem:
            self.part.refuse(f"external_load: {problem}")
            return
        self.part.load.take(values, self.part.tick)

    def on_command(self, message: JointState) -> None:
        """Take over torques on the joints."""
        try:
            values = command_of(message, self.limb)
        except ValueError as problem:
            self.part.refuse(f"joint_command: {problem}")
            return
        self.part.on_command(tick_of(message.header.stamp, self.ticks), values)

    def on_timer(self) -> None:
        """Step as far as the wall clock has gone; what cannot be solved ends the node, in one line."""
        try:
            self.timed(self.part.step_to_now)
        except UserError as error:
            self.fail(error)

    @property
    def counts(self) -> dict[str, int]:
        """What has gone wrong so far, by what it is."""
        return {"missed_deadlines": self.part.missed, **super().counts}

    def state(self) -> str:
        """In words, how real time is kept."""
        if self.mode != "realtime":
            return super().state()
        return f"{self.part.missed} missed deadlines in {self.part.tick} ticks"

    def report(self) -> None:
        """Publish how the node does, and what acts from outside."""
        super().report()
        for name, held in (("external_load", self.part.load), ("joint_command", self.part.command)):
            self.report_held(name, held)
        if self.part.missed > self.told:
            self.told = self.part.missed
            self.get_logger().warning(self.state())

    def report_held(self, name: str, held: Held) -> None:
        """Publish whether what acts from outside is too old, once something has come."""
        if held.heard:
            self.diagnose(
                "too old; it does not act any more" if held.stale else "acts", STALE if held.stale else OK, name
            )

    def report_the_end(self) -> None:
        """Tell how real time was kept, before the message with which the recording ends."""
        if self.mode == "realtime":
            self.report()

    def destroy_node(self) -> None:
        """Tell how real time was kept if the run is ended before its last tick."""
        if hasattr(self, "part") and self.part.started_at is not None and not self.part.finished:
            self.report()
        super().destroy_node()


main = main_of(LimbDynamics)

if __name__ == "__main__":
    main()
