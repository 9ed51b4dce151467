"""The part of limb_dynamics: it offers limb_state 0, then steps from tick to tick under the joint torques."""

from __future__ import annotations

import time
from collections import OrderedDict, deque
from typing import Any

import numpy as np

from limb_nodes.exchange.forms import joint_states_form
from limb_nodes.exchange.held import Held
from limb_nodes.exchange.outgoing import Outgoing
from limb_nodes.exchange.part import Part
from limb_nodes.exchange.past import Past
from limb_nodes.exchange.stream import CHECKPOINT, RECORDER_LAG
from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.model.points import points
from limb_nodes.solve.held import slope_rows
from limb_nodes.solve.outputs import TORQUE_FIELDS
from limb_nodes.solve.stepping import Impact, LimbStepper

REMEMBERED = 1000
# How long the limb goes on with a torque in real time (s). Farther its slopes say nothing.
MOST_AHEAD = 0.05


class LimbPart(Part):
    """From joint torques to the limb's state and the movement pattern.

    In lockstep joint_torque k leads to limb_state k + 1. In real time `step_to_now` does, at the pace of the wall
    clock, with the newest torque; ticks whose torque is not there in time are counted. The movement pattern and
    joint_states of a tick are sent as soon as its torque is known.

    tick: that the limb is at. last_tick: of the run, -1 while it is not known. missed: deadlines. started_at: when real
    time began (s of the monotonic clock). recorded: the newest tick that the recorder has, -1 before. again: whether it
    goes on from what is recorded. joint_states: messages for everybody. command, load: what acts from outside.
    commanded: the newest tick that a command answers, -1 before. struck: the impact within the tick that waits for its
    torque. impacts: how many have it.
    """

    def __init__(
        self,
        *given: Any,
        awaits_recorder: bool = False,
        command_every: int = 0,
        command_timeout: float = 0.0,
        load_timeout: float = 0.0,
        frame_prefix: str = "",
        **options: Any,
    ) -> None:
        """command_every: in lockstep, wait for a command every so many ticks; 0: never. frame_prefix: of joint_states.

        command_timeout, load_timeout: how long a command or a load acts (s of simulation time); 0 for ever.
        """
        super().__init__(*given, **options)
        self.awaits_recorder, self.command_every = awaits_recorder, command_every
        self.joint_states = Outgoing(joint_states_form(self.limb, frame_prefix), self.ticks.nanoseconds)
        self.commanded = self.shown = -1
        # In real time nobody can wait for a torque in the middle of a tick.
        self.stepper = LimbStepper(self.limb, asks=not self.realtime)
        self.struck: Impact | None = None
        self.impacts = 0
        self.impact_torques: dict[int, FloatArray] = {}
        self.command = Held(self.stepper.command, self.in_ticks(command_timeout))
        self.load = Held(self.stepper.load, self.in_ticks(load_timeout))
        self.tick = 0
        self.begun = self.again = False
        self.most_ahead = max(1, round(MOST_AHEAD / self.ticks.period))
        self.behind = False
        self.missed = 0
        self.recorded = -1
        # Torques of this tick and those that follow, which a node that is started anew gets at once.
        self.pending: deque[FloatArray] = deque()
        self.newest: tuple[int, FloatArray] | None = None
        self.history: OrderedDict[int, tuple[FloatArray, FloatArray]] = OrderedDict()
        self.started_at: float | None = None
        self.last_tick = -1
        self.state, self.pattern = self.sends("limb_state"), self.sends("movement_pattern")
        self.checkpoint, self.impact = self.sends("limb_checkpoint"), self.sends("limb_impact")
        self.takes("joint_torque", self.on_torque, gaps=self.realtime)
        if self.stepper.model.limited and not self.realtime:
            self.takes("impact_torque", self.on_impact_torque, gaps=False)

    def in_ticks(self, seconds: float) -> int:
        """A time in ticks, 1 at least; 0 stays 0."""
        return max(1, round(seconds / self.ticks.period)) if seconds else 0

    def begin(self) -> None:
        """Offer the first state, unless the recorder is to be there first."""
        if not self.awaits_recorder:
            self.offer()

    def offer(self) -> None:
        """Send the state at the current tick, or the impact within it."""
        self.begun = True
        if self.struck is not None:
            self.send_impact(self.struck)
            return
        values = self.state.values
        values["impacts"][...] = self.impacts
        values["angle"][:], values["velocity"][:] = self.stepper.angle, self.stepper.velocity
        self.state.publish(self.tick)
        if self.tick % CHECKPOINT == 0:
            self.send_checkpoint()

    def on_recorded(self, tick: int) -> None:
        """The recorder has every tick up to this one; -1 when it is ready."""
        # The recorder may have ticks that are done again.
        if tick < self.recorded or (tick > self.tick and not self.again):
            self.refuse(f"recorded: tick {tick} is not from {self.recorded} to {self.tick}")
            return
        self.recorded = tick
        if not self.begun:
            self.offer()
        self.go_on()

    def on_torque(self, tick: int, data: bytes) -> None:
        """Take over a torque; in lockstep also step."""
        if self.realtime and tick > self.tick and not self.again:
            self.refuse(f"joint_torque: a message is of tick {tick}, which has not been; the limb is at {self.tick}")
            return
        rows = self.rows("joint_torque", data)
        self.last_tick = self.forms["joint_torque"].number(data, "last_tick")
        if not self.realtime:
            self.pending.append(rows)
            self.go_on()
            return
        self.newest = tick, rows
        if tick == self.tick:
            self.show(rows)
        if self.behind:
            self.catch_up(int(self.elapsed()))

    def go_on(self) -> None:
        """In lockstep, step as far as torques are there and the recorder is near."""
        self.meet_impacts()
        while self.pending and self.begun and self.struck is None and not self.finished and not self.ahead:
            self.show(self.pending[0])
            if self.uncommanded:
                return
            self.step(self.pending.popleft())

    def on_command(self, tick: int, torque: FloatArray) -> None:
        """Take over a torque on the joints (N m), with which a controller answers joint_states of a tick."""
        if self.command_every and not self.commanded <= tick <= self.tick:
            self.refuse(f"joint_command: tick {tick} is not from {self.commanded} to {self.tick}")
            return
        self.command.take(torque, self.tick)
        self.commanded = tick
        if not self.realtime:
            self.go_on()

    @property
    def uncommanded(self) -> bool:
        """Whether the limb must wait for a command, which it does not at the last tick."""
        due = self.command_every and self.tick % self.command_every == 0 and self.tick != self.last_tick
        return bool(due) and not self.realtime and self.commanded < self.tick

    @property
    def ahead(self) -> bool:
        """Whether the limb must wait for the recorder."""
        return self.awaits_recorder and self.tick - self.recorded > RECORDER_LAG

    def rows(self, topic: str, data: bytes) -> FloatArray:
        """Torque and slopes [2 + 2 n, n] of a message of a topic."""
        parts = [self.values(topic, data, name) for name in TORQUE_FIELDS]
        return np.concatenate(parts).reshape(-1, self.stepper.joints)

    def step_to_now(self) -> None:
        """In real time, step as far as the wall clock has gone."""
        if self.newest is None or self.finished:
            return
        if self.started_at is None:
            self.started_at = time.monotonic() - self.ticks.period
        self.catch_up(self.due())

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

    def carried(self, tick: int, rows: FloatArray) -> FloatArray:
        """The torque of an older tick, carried to the current state along its slopes."""
        if tick not in self.history:
            return rows
        angle, velocity = self.history[tick]
        carried = rows.copy()
        by_angle, by_velocity = slope_rows(rows)
        carried[0] += (
            by_angle @ (self.stepper.angle - angle)
            + by_velocity @ (self.stepper.velocity - velocity)
            + rows[1] * (self.tick - tick) * self.ticks.period
        )
        return carried

    def step(self, rows: FloatArray) -> None:
        """Send the movement pattern of this tick, if it has not been, and go on to the next. Raises RunError."""
        self.show(rows)
        self.finished = 0 <= self.last_tick <= self.tick
        if self.finished:
            return
        self.command.age(self.tick)
        self.load.age(self.tick)
        if self.realtime:
            self.history[self.tick] = self.stepper.angle.copy(), self.stepper.velocity.copy()
            if len(self.history) > REMEMBERED:
                self.history.popitem(last=False)
        self.go_to(self.stepper.step(rows, self.ticks.period))
        self.meet_impacts()

    def go_to(self, impact: Impact | None) -> None:
        """Be at an impact within the tick, or at the next tick, and offer that."""
        self.struck = impact
        self.tick += impact is None
        self.offer()

    def on_impact_torque(self, number: int, data: bytes) -> None:
        """Take over the torque behind an impact; a node that is started anew gets those that it comes to later."""
        if self.struck is None and not self.again:
            self.conflicts += 1
            self.refuse(f"impact_torque: a message is of impact {number}, which has not been")
            return
        self.impact_torques[number] = self.rows("impact_torque", data)
        self.go_on()

    def meet_impacts(self) -> None:
        """Go on behind the impacts within the tick whose torques are there."""
        while self.struck is not None and self.begun and self.impacts in self.impact_torques:
            rows = self.impact_torques.pop(self.impacts)
            self.impacts += 1
            self.go_to(self.stepper.go_on(rows))

    def send_impact(self, impact: Impact) -> None:
        """Ask for the torque behind an impact."""
        values = self.impact.values
        values["of_tick"][...], values["time"][...] = self.tick, impact.time
        values["angle"][:] = impact.angle
        values["velocity_before"][:], values["velocity_after"][:] = impact.before, impact.after
        self.impact.publish(self.impacts)

    def show(self, rows: FloatArray) -> None:
        """Send the movement pattern and joint_states of this tick, once."""
        if self.shown == self.tick:
            return
        self.shown = self.tick
        if 0 <= self.last_tick <= self.tick:
            self.before_the_end()
        self.send_pattern(rows)

    def send_checkpoint(self) -> None:
        """Send all that the following ticks depend on."""
        self.checkpoint.values["state"][:] = self.stepper.remembered
        self.checkpoint.publish(self.tick)

    def go_on_after(self, past: Past) -> None:
        """Step from the newest checkpoint, or from the start, under the torques."""
        if past.limb is not None:
            self.tick, data = past.limb
            self.stepper.remember(self.values("limb_checkpoint", data, "state"))
        patterns = past.messages["movement_pattern"]
        for tick in range(self.tick, past.tick + 1):
            # A pattern tells what acted until its tick.
            pattern = patterns[min(tick + 1, past.tick)]
            self.stepper.command[:] = self.values("movement_pattern", pattern, "command")
            self.stepper.load[:] = self.values("movement_pattern", pattern, "load")
            rows = self.rows("joint_torque", past.messages["joint_torque"][tick])
            self.struck = self.stepper.step(rows, self.ticks.period)
        self.tick = past.tick + (self.struck is None)
        self.again = True
        self.impacts = past.impacts
        if "impact_torque" in self.streams:
            self.streams["impact_torque"].go_on_after(self.impacts - 1)

    def before_the_end(self) -> None:
        """What is to be said before the message with which the recording ends."""

    def send_pattern(self, rows: FloatArray) -> None:
        """Send the movement of this tick under torque and slopes [2 + 2 n, n]."""
        values, shown, stepper = self.pattern.values, self.joint_states.values, self.stepper
        values["impacts"][...] = self.impacts
        values["angle"][:], values["velocity"][:] = stepper.angle, stepper.velocity
        values["acceleration"][:] = stepper.acceleration(rows)
        values["torque"][:], values["command"][:], values["load"][:] = rows[0], stepper.command, stepper.load
        values["position"][:, :2] = points(self.limb, list(stepper.angle))
        self.pattern.publish(self.tick)
        shown["position"][:], shown["velocity"][:] = stepper.angle, stepper.velocity
        np.add(rows[0], stepper.command, out=shown["effort"])
        self.joint_states.publish(self.tick)

    @property
    def done(self) -> int:
        """The tick that the limb is at, and one more once all nodes are known to be there: the recorder has said so."""
        return self.tick + (self.awaits_recorder and self.begun)

    def awaited(self) -> str:
        """The torque of this tick, or the recorder."""
        if self.finished:
            return ""
        if self.struck is not None and self.begun:
            return f"the torque behind impact {self.impacts} within tick {self.tick} from muscle_stack"
        if self.pending and self.uncommanded:
            return f"joint_command of tick {self.tick} from a controller"
        if self.pending:
            return f"the recording of tick {self.recorded + 1} from recorder"
        if not self.begun:
            return "the start of the recording from recorder"
        return f"joint_torque of tick {self.tick} from muscle_stack"
