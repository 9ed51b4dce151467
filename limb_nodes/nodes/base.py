"""What every node of the limb has: parameters with ranges, its limb, its part of the run, and a watch over it."""

from __future__ import annotations

import difflib
import math
import os
import time
from collections.abc import Callable, Collection, Sequence
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from limb_msgs.msg import Claim
from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from std_msgs.msg import Header

from limb_nodes.errors import RunError, UserError, clean
from limb_nodes.exchange.identity import FORM, is_identity
from limb_nodes.exchange.part import Part
from limb_nodes.exchange.recorded import RecordedRun
from limb_nodes.exchange.ticks import HIGHEST_RATE, LOWEST_RATE, Ticks
from limb_nodes.exchange.watch import LOOK_PERIOD, SOON, STALL, STALL_LIMIT, Watch
from limb_nodes.foundation.topics import PUBLIC, exchanged
from limb_nodes.model import Limb, load_limb
from limb_nodes.nodes.claims import check_claim
from limb_nodes.nodes.distribution import given_parameters, parameter_values, taken
from limb_nodes.nodes.health import WINDOW, Counts, Steps
from limb_nodes.nodes.messages import class_of
from limb_nodes.nodes.onlookers import Onlookers
from limb_nodes.nodes.priority import HIGHEST, take_priority
from limb_nodes.nodes.qos import LIVE, STREAM, stream_of

MODES = ("lockstep", "realtime")
OK, WARN, STALE = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.STALE
# How often a node tells how it does (s).
REPORT_PERIOD = 1.0
# How often those who look at the limb get a picture (s).
VIEW_PERIOD = 0.04
# What the nodes of a limb declare, all together: a file of parameters may be for all of them.
PARAMETERS = {
    "allow_laws", "await_recorder", "band", "band_order", "channels", "command", "command_every", "command_timeout",
    "copies", "duration", "emg_rate", "frame_prefix", "identity", "limb", "load_timeout", "low_pass",
    "low_pass_order", "mains", "maximum", "mode", "muscle_colour", "on_silence", "out", "priority", "publish_clock",
    "publish_motor_unit_state", "publish_muscle_state", "publish_sarcomere_state", "publish_tf", "rate", "resume",
    "silence", "source", "stall_limit", "state_every",
}  # fmt: skip
# How the names of parameters begin that any node of ROS takes.
ROS_PARAMETERS = ("use_sim_time", "qos_overrides.", "start_type_description_service")
# The variable by which a run tells the nodes in processes of their own whose children they are: they end with it.
PARENT = "LIMB_RUN_PARENT"
# The variable by which it tells them to stay when they have finished: whoever is started anew may need their messages.
STAY = "LIMB_RUN_STAY"
# How long a node that a person has started waits for the others without a word (s).
UNSAID = 10.0


class LimbNode(Node):
    """A node of one limb at one rate.

    part: what it does in a run. failure: why it cannot go on, and the exit status, for whoever spins it; a text,
    because an error would keep the node and all that it knows alive. typed: names of the parameters that a person has
    typed for this node alone. former: the identities of the runs in whose place this one began, the last one last.
    following: that of the run that is to begin in place of this one, once it is known.
    """

    part: Part

    def __init__(self, name: str, former: Sequence[str] = (), typed: Collection[str] = (), **options: Any) -> None:
        super().__init__(name, **options)
        self.former, self.typed = former, typed
        self.failure: tuple[str, type[UserError]] | None = None
        self.following = ""
        self._last_complaint = -math.inf
        self._told = 0
        self._last_refused = ""
        self.steps, self._counts = Steps(), Counts()
        self.diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", LIVE)
        path = self.text("limb", "", "the limb's YAML file")
        if not path:
            raise UserError(f"{name}: the parameter limb is empty; the path of a limb's YAML file is needed")
        allow_laws = self.switch("allow_laws", False, "run the code of the limb's own laws, also if it is not trusted")
        self.limb: Limb = load_limb(path, allow_laws)
        self.mode = self.choice("mode", MODES, "lockstep: tick after tick as fast as possible; realtime: by the clock")
        self.ticks = Ticks(
            self.number("rate", 1000.0, "ticks per second of simulation time", LOWEST_RATE, HIGHEST_RATE)
        )
        self.given_identity = self.text(
            "identity", "", f"identity of the run, {FORM}; empty: a new one (limb_dynamics), that of the run (others)"
        )
        if self.given_identity and not is_identity(self.given_identity):
            raise UserError(f"{name}: the parameter identity is {self.given_identity!r}; {FORM} are needed")
        self.priority = self.whole(
            "priority", 0, "real-time priority of all threads of the process (SCHED_FIFO); 0: none", 0, HIGHEST
        )
        self.resume = self.text("resume", "", "bag of the run that this node goes on with; empty: a new run")
        meaning = "end the run if no tick has come for so long, s; if it is given, also before the first tick"
        limit = self.number("stall_limit", STALL_LIMIT, meaning, STALL.minimum or 0.0, STALL.maximum or 0.0)
        child = PARENT in os.environ
        patient = child or "stall_limit" not in given_parameters(self)
        self.watch = Watch(limit, math.inf if child else UNSAID, patient=patient)

    @property
    def finished(self) -> bool:
        """Whether the node has done its part of the run."""
        return self.part.finished

    @property
    def common(self) -> dict[str, Any]:
        """What every part is made with."""
        realtime = self.mode == "realtime"
        return {"limb": self.limb, "ticks": self.ticks, "identity": self.given_identity, "realtime": realtime}

    def carry(self, part: Part, listen: bool = True) -> None:
        """Publish what a part sends, and watch over it; listen: hand it what it takes, too.

        Comes after all parameters are declared. Raises UserError if others are given.
        """
        self.refuse_unknown()
        if self.priority:
            take_priority(self.get_name(), self.priority)
        self.part = part
        part.complain = self.complain
        part.knows(self.former)
        if self.resume:
            part.take_up(self.recorded_run().past())
        for topic, messages in part.outgoing.items():
            own = self.create_publisher(class_of(topic), exchanged(topic), stream_of(topic))
            messages.send = own.publish
            if topic in PUBLIC:
                messages.send = both(own.publish, Onlookers(self.create_publisher(class_of(topic), topic, LIVE)).send)
        for topic in part.streams if listen else ():

            def receive(data: bytes, topic: str = topic) -> None:
                self.timed(lambda: part.receive(topic, data))

            self.listen(class_of(topic), exchanged(topic), receive, STREAM, raw=True)
        self.listen(Claim, exchanged("claim"), self.on_claim, STREAM)
        self.create_timer(LOOK_PERIOD, self.on_look, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self.create_timer(REPORT_PERIOD, self.report, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def timed(self, work: Callable[[], None]) -> None:
        """Do some work, and know how long it took if it has led to another tick."""
        begun, done = time.perf_counter(), self.part.done
        work()
        if self.part.done != done:
            self.steps.add(time.perf_counter() - begun)

    def on_claim(self, claim: Claim) -> None:
        """Raise UserError if the node cannot be one of a run that has claimed the namespace.

        A run that replaces that of the node is the one to begin.
        """
        if self.part.identity and claim.replaces == self.part.identity and is_identity(claim.run):
            self.following = claim.run
        elif self.part.identity in ("", claim.run):
            check_claim(claim, self.get_name(), self.limb, self.ticks, self.mode)

    @property
    def leaves(self) -> bool:
        """Whether the node has nothing left to do in its run, for another one follows."""
        return bool(self.following)

    def parameters_of_following(self) -> dict[str, Any]:
        """The parameters that are others in the run that follows."""
        return {"identity": self.following, "resume": ""}

    def serve(self) -> None:
        """Offer what a person may ask for who has started the node."""

    def refuse_unknown(self) -> None:
        """Raise UserError for a parameter that no node of a limb has, and for one that is typed in vain."""
        for name in given_parameters(self):
            if self.has_parameter(name) or name.startswith(ROS_PARAMETERS):
                continue
            if name in PARAMETERS and name in self.typed:
                raise UserError(
                    f"{self.get_name()}: {name} is a parameter of another node of the limb, not of this one"
                )
            if name not in PARAMETERS:
                near = difflib.get_close_matches(name, parameter_values(self), 1)
                meant = f"; {near[0]} is meant perhaps" if near else ""
                raise UserError(f"{self.get_name()}: {name} is no parameter of this node{meant}")

    def recorded_run(self) -> RecordedRun:
        """The run that the node goes on with. Raises UserError if it is of another limb or rate."""
        run = RecordedRun.read(self.resume)
        for key, own in ("limb", self.limb.text), ("period_ns", self.ticks.nanoseconds):
            if run.info[key] != own:
                raise UserError(
                    f"{self.get_name()}: the parameter resume is {self.resume}, whose {key} is another than that of "
                    "this node; the bag of this run is needed"
                )
        return run

    def on_look(self) -> None:
        """Say what the part waits for if nothing goes on, and give up at last."""
        if self.following:
            return
        part, watch = self.part, self.watch
        if watch.waited >= SOON:
            self.take_unnoticed()
        if said := watch.look(time.monotonic(), part.done, part.awaited()):
            self.get_logger().warning(said)
            self.diagnose(said, WARN, waited=f"{watch.waited:.1f}")
        if watch.given_up:
            self.fail(RunError(f"{self.get_name()} has waited {watch.waited:.0f} s for {part.awaited()}"))

    def take_unnoticed(self) -> None:
        """Take messages that have come without the executor's notice, as may happen while it is being made."""
        for subscription in self.subscriptions:
            for message in taken(subscription, raw=subscription.raw):
                self.get_logger().debug(f"a message on {subscription.topic_name} has come unnoticed")
                subscription.callback(message)

    def fail(self, error: UserError) -> None:
        """Let whoever spins the node know that it cannot go on."""
        self.failure = self.failure or (str(error), type(error))

    def raise_failure(self) -> None:
        """Raise why the node cannot go on, if it cannot."""
        if self.failure:
            text, kind = self.failure
            raise RunError(text) if issubclass(kind, RunError) else UserError(text)

    def frame_prefix(self) -> str:
        """What stands before the names of frames."""
        space = self.get_namespace().strip("/")
        return self.text("frame_prefix", space and f"{space}/", "put before the names of frames")

    def show(self, draw: Callable[[], Any], publisher: Any) -> None:
        """Publish by the wall clock what is drawn of the limb, if anybody looks and it has gone on."""
        seen = -1

        def look() -> None:
            nonlocal seen
            if self.part.done != seen and publisher.get_subscription_count() > 0:
                seen = self.part.done
                publisher.publish(draw())

        self.create_timer(VIEW_PERIOD, look, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def text(self, name: str, default: str, meaning: str) -> str:
        """A parameter that holds a text, fixed at the start."""
        descriptor = ParameterDescriptor(description=meaning, read_only=True)
        return str(self._declare(name, default, descriptor, "a text"))

    def choice(self, name: str, allowed: Sequence[str], meaning: str) -> str:
        """A parameter that holds one of some texts, the first by default."""
        value = self.text(name, allowed[0], f"{meaning} (one of {', '.join(allowed)})")
        if value not in allowed:
            raise UserError(
                f"{self.get_name()}: the parameter {name} is {value!r}; one of {', '.join(allowed)} is needed"
            )
        return value

    def number(self, name: str, default: float, meaning: str, lowest: float, highest: float) -> float:
        """A parameter that holds a number within a range."""
        span = FloatingPointRange(from_value=lowest, to_value=highest)
        descriptor = ParameterDescriptor(description=meaning, read_only=True, floating_point_range=[span])
        given = given_parameters(self)
        if name in given and given[name].type_ == Parameter.Type.INTEGER:
            # ROS tells 200 from 200.0; a person does not.
            given[name] = Parameter(name, value=float(given[name].value))
        allowed = f"a number from {lowest:g} to {highest:g}"
        value = float(self._declare(name, default, descriptor, allowed))
        if not lowest <= value <= highest:
            raise UserError(f"{self.get_name()}: the parameter {name} is {value:.12g}; {allowed} is needed")
        return value

    def whole(self, name: str, default: int, meaning: str, lowest: int, highest: int) -> int:
        """A parameter that holds a whole number within a range."""
        span = IntegerRange(from_value=lowest, to_value=highest, step=1)
        descriptor = ParameterDescriptor(description=meaning, read_only=True, integer_range=[span])
        return int(self._declare(name, default, descriptor, f"a whole number from {lowest} to {highest}"))

    def switch(self, name: str, default: bool, meaning: str) -> bool:
        """A parameter that is true or false."""
        descriptor = ParameterDescriptor(description=meaning, read_only=True)
        return bool(self._declare(name, default, descriptor, "true or false"))

    def _declare(self, name: str, default: Any, descriptor: ParameterDescriptor, allowed: str) -> Any:
        try:
            return self.declare_parameter(name, default, descriptor).value
        except Exception as problem:
            given = given_parameters(self).get(name)
            value = f"is {given.value!r}" if given is not None else f"cannot be read ({problem})"
            raise UserError(f"{self.get_name()}: the parameter {name} {value}; {allowed} is needed") from None

    def complain(self, what: str) -> None:
        """Say what is wrong with a message that is not taken, once per second at most."""
        now = time.monotonic()
        self._last_refused = clean(what)
        if now - self._last_complaint >= 1.0:
            self._last_complaint = now
            self.get_logger().warning(f"{clean(what)}; it is not taken ({self.refused} so far)")
            self.diagnose(what, WARN)

    @property
    def counts(self) -> dict[str, int]:
        """What has gone wrong so far, by what it is."""
        return {name: getattr(self.part, name) for name in ("bad_input", "foreign", "conflicts")}

    def report(self) -> None:
        """Publish once a second how the node does: a warning if something has gone wrong lately."""
        wrong = ", ".join(f"{count} {name}" for name, count in self._counts.lately(self.counts).items() if count)
        lately = f"{wrong} in the last {WINDOW:g} s" if wrong else ""
        values = {**self.steps.told("step"), **({"last_refused": self._last_refused} if self._last_refused else {})}
        self.diagnose("; ".join(filter(None, (self.state(), lately))), WARN if wrong else OK, **values)

    def state(self) -> str:
        """In words, what the node is at."""
        return f"at tick {self.part.done}"

    @property
    def refused(self) -> int:
        """How many messages have not been taken."""
        return self.part.bad_input + self.part.foreign

    def diagnose(self, message: str, level: bytes, part: str = "", **values: object) -> None:
        """Publish on `/diagnostics` how the node does, or a part of it."""
        if not part:
            self._told = self.refused
            values |= self.counts
        values["run"] = self.part.identity
        status = DiagnosticStatus(
            level=level,
            name=f"{self.get_fully_qualified_name()}{part and ': '}{part}",
            message=message,
            hardware_id=self.limb.name,
            values=[KeyValue(key=key, value=str(value)) for key, value in values.items()],
        )
        stamp = self.get_clock().now().to_msg()
        self.diagnostics.publish(DiagnosticArray(header=Header(stamp=stamp), status=[status]))

    def listen(self, kind: type, topic: str, callback: Callable[[Any], None], qos: QoSProfile, **options: Any) -> Any:
        """Subscribe a topic; what the callback cannot do ends the node, in one line."""

        def guarded(message: Any) -> None:
            try:
                callback(message)
            except UserError as error:
                self.fail(error)

        return self.create_subscription(kind, topic, guarded, qos, **options)

    def destroy_node(self) -> None:
        """Tell the last count of messages that were not taken."""
        if hasattr(self, "part") and self.refused > self._told:
            self.diagnose(f"{self.refused} messages could not be used", WARN)
        super().destroy_node()


def both(first: Callable[[bytes], object], second: Callable[[bytes], object]) -> Callable[[bytes], None]:
    """A way for messages that is two."""

    def send(data: bytes) -> None:
        first(data)
        second(data)

    return send
