"""The part of muscle_stack: it answers limb_state k with joint_torque k once it holds the activations k and k + 1."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np

from limb_nodes.errors import RunError
from limb_nodes.exchange.outgoing import Outgoing
from limb_nodes.exchange.part import Part
from limb_nodes.exchange.past import Past
from limb_nodes.exchange.stream import CHECKPOINT
from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.foundation.topics import STATES
from limb_nodes.solve.delay import DelayLine, delays_of
from limb_nodes.solve.outputs import STATE_FIELDS, TORQUE_FIELDS
from limb_nodes.solve.small import finite
from limb_nodes.solve.stepping import MuscleStepper

Input = tuple[FloatArray, FloatArray]


class MusclePart(Part):
    """From activations and the limb's states to joint torques and the states of muscles.

    tick: the newest that is answered. states: topics of states that are sent, every `state_every` ticks.
    waiting: states of the limb that are not answered yet, with how many impacts come before them; a node that is
    started anew gets many before the first activation. struck: impacts that wait for answers. impacts: how many do not.
    passed: which part of the tick the muscles have gone, 0 but for impacts. tell_ranges: called when a length of a
    muscle leaves its range for the first time, and before the last answer.
    """

    def __init__(self, *given: Any, states: tuple[str, ...] = STATES, state_every: int = 1, **options: Any) -> None:
        super().__init__(*given, **options)
        self.state_every = state_every
        self.tell_ranges: Callable[[], None] = lambda: None
        self.stepper = MuscleStepper(self.limb)
        self.delays = DelayLine(delays_of(self.limb, self.ticks.rate))
        n, muscles = len(self.limb.segments), len(self.limb.muscles)
        self.tick = self.last_tick = -1
        self.angle, self.velocity = np.zeros(n), np.zeros(n)
        self.drive = self.stepper.drive(np.zeros(muscles))
        self.last_drive: FloatArray | None = None
        self.excitation: FloatArray = np.zeros(muscles)
        self.inputs: dict[int, Input] = {}
        self.waiting: deque[tuple[int, FloatArray, FloatArray, int]] = deque()
        self.struck: deque[bytes] = deque()
        self.impacts, self.passed = 0, 0.0
        self.torque, self.checkpoint = self.sends("joint_torque"), self.sends("muscle_checkpoint")
        self.impact_torque = self.sends("impact_torque")
        self.states = [self.copied(topic) for topic in states]
        self.takes("activation", self.on_activation, gaps=self.realtime)
        self.takes("limb_state", self.on_limb_state, gaps=self.realtime)
        if self.stepper.model.limited and not self.realtime:
            self.takes("limb_impact", self.on_impact, gaps=False)

    def copied(self, topic: str) -> tuple[Outgoing, list[tuple[FloatArray, FloatArray]]]:
        """The messages of a topic of states, and pairs of target and source to copy into them."""
        shown, messages = self.stepper.shown, self.sends(topic)
        return messages, [(messages.values[field], shown[name]) for field, name in STATE_FIELDS[topic].items()]

    def on_activation(self, tick: int, data: bytes) -> None:
        """Keep the activation of a tick, and answer if it was waited for."""
        self.keep_activation(tick, data)
        self.answer()

    def keep_activation(self, tick: int, data: bytes) -> None:
        """Keep the activation of a tick."""
        self.last_tick = self.forms["activation"].number(data, "last_tick")
        values = self.values("activation", data, "activation").astype(np.float64)
        self.excitation = self.delays.reach(tick, values)
        self.inputs[tick] = self.excitation, self.stepper.drive(self.excitation)

    def limb_state(self, topic: str, data: bytes) -> tuple[FloatArray, FloatArray]:
        """Angles and velocities of a message of a topic."""
        angle, velocity = (self.values(topic, data, name) for name in ("angle", "velocity"))
        return angle.astype(np.float64), velocity.astype(np.float64)

    def on_limb_state(self, tick: int, data: bytes) -> None:
        """Keep a state of the limb; in real time the ones before are answered first, with what is there."""
        if self.waiting and self.realtime:
            self.send(None)
        self.waiting.append(
            (tick, *self.limb_state("limb_state", data), self.forms["limb_state"].number(data, "impacts"))
        )
        self.answer()

    def on_impact(self, number: int, data: bytes) -> None:
        """Answer an impact, if it is one of the tick that was answered last; else keep it."""
        self.struck.append(data)
        self.answer()

    def answer(self) -> None:
        """Send the torques that are waited for, as far as their activations and the impacts before them are there."""
        self.answer_impacts()
        while self.waiting:
            tick, _, _, impacts = self.waiting[0]
            known = tick in self.inputs and (tick == self.last_tick or tick + 1 in self.inputs)
            if not known or impacts > self.impacts:
                return
            if impacts < self.impacts:
                self.conflicts += 1
                self.refuse(
                    f"limb_impact: {self.impacts} impacts were told before tick {tick}, and there are {impacts}"
                )
                self.impacts = impacts
            self.send(self.inputs.get(tick + 1))
            self.answer_impacts()

    def answer_impacts(self) -> None:
        """Send the torques behind the impacts of the tick that was answered last. Raises RunError."""
        form = self.forms["limb_impact"]
        while self.struck and form.number(self.struck[0], "of_tick") == self.tick:
            data = self.struck.popleft()
            angle, before, after = (
                self.values("limb_impact", data, name).astype(np.float64)
                for name in ("angle", "velocity_before", "velocity_after")
            )
            span = self.passed, float(self.values("limb_impact", data, "time")) / self.ticks.period
            following = self.inputs[self.tick + 1][1]
            given = self.drive, following, self.ticks.period, self.last_drive
            self.stepper.advance((self.angle, self.velocity), (angle, before), *given, span)
            self.angle, self.velocity, self.passed = angle, after, span[1]
            rows = self.stepper.torque(angle, after, *given, (self.passed, 1.0))
            self.write_torque(self.impact_torque, rows)
            self.impact_torque.publish(self.impacts)
            self.impacts += 1

    def write_torque(self, messages: Outgoing, rows: FloatArray) -> None:
        """Write torque and slopes into a message. Raises RunError if they are not finite."""
        numbers, start = rows.reshape(-1), 0
        if not finite(numbers):
            why = self.stepper.fault() or "a slope of the torque is not a finite number"
            raise RunError(f"{self.limb.file}: stops at {self.tick * self.ticks.period:g} s, tick {self.tick}: {why}")
        for name in TORQUE_FIELDS:
            target = messages.values[name]
            target[:] = numbers[start : start + target.size]
            start += target.size

    def send(self, following: Input | None) -> None:
        """Advance to the first tick that waits and send its torque and states. Raises RunError."""
        tick, angle, velocity, _ = self.waiting.popleft()
        excitation, drive = self.advance(tick, angle, velocity)
        next_drive = drive if following is None else following[1]
        rows = self.stepper.torque(angle, velocity, drive, next_drive, self.ticks.period, self.last_drive)
        self.write_torque(self.torque, rows)
        if self.stepper.look() or tick == self.last_tick:
            self.tell_ranges()
        self.torque.values["last_tick"][...] = self.last_tick
        self.torque.publish(tick)
        # The limb waits for the torque; the states are for those who look on.
        if self.states and tick % self.state_every == 0:
            self.stepper.observe(angle, velocity, excitation)
            for states, copies in self.states:
                for target, source in copies:
                    target[:] = source
                states.publish(tick)
        if tick % CHECKPOINT == 0:
            self.send_checkpoint()
        self.finished = 0 <= self.last_tick <= tick
        for old in [key for key in self.inputs if key < tick]:
            del self.inputs[old]

    def muscles(self) -> FloatArray:
        """What the muscles show at the newest tick [muscles, MUSCLE_OUTPUTS]; looking leaves nothing behind."""
        kept = self.stepper.remembered
        shown, _ = self.stepper.observe(self.angle, self.velocity, self.excitation)
        self.stepper.remember(kept)
        return shown.copy()

    def advance(self, tick: int, angle: FloatArray, velocity: FloatArray) -> Input:
        """Advance the internal states to joint states of a tick; its excitation and drive."""
        excitation, drive = self.inputs.get(tick, (self.excitation, self.drive))
        if self.tick >= 0:
            period = (tick - self.tick) * self.ticks.period
            before, after = (self.angle, self.velocity), (angle, velocity)
            self.stepper.advance(before, after, self.drive, drive, period, self.last_drive, (self.passed, 1.0))
            self.passed = 0.0
        self.last_drive = self.drive if tick == self.tick + 1 and self.tick >= 0 else None
        self.tick, self.angle, self.velocity, self.drive = tick, angle, velocity, drive
        return excitation, drive

    def send_checkpoint(self) -> None:
        """Send all that the following ticks depend on."""
        has_last = self.last_drive is not None
        last_drive = self.last_drive if self.last_drive is not None else np.zeros_like(self.drive)
        parts = self.stepper.remembered, self.angle, self.velocity, self.drive, last_drive, [float(has_last)]
        self.checkpoint.values["state"][:] = np.concatenate([*parts, self.delays.remembered])
        self.checkpoint.publish(self.tick)

    def go_on_after(self, past: Past) -> None:
        """Answer again what was recorded behind the newest checkpoint, or from the start."""
        if past.muscles is not None:
            self.tick, data = past.muscles
            state = self.values("muscle_checkpoint", data, "state").astype(np.float64)
            parts = self.stepper.remembered, self.angle, self.velocity, self.drive, self.drive
            ends = np.cumsum([*(part.size for part in parts), 1])
            remembered, self.angle, self.velocity, self.drive, last, has_last, delays = np.split(state, ends)
            self.stepper.remember(remembered)
            self.delays.remember(delays)
            self.last_drive = last if has_last[0] else None
        activations = past.messages["activation"]
        for tick in range(self.tick + 1, past.tick + 1):
            for known in {tick, tick + 1} & activations.keys():
                self.keep_activation(known, activations[known])
            self.waiting.append(
                (tick, *self.limb_state("movement_pattern", past.messages["movement_pattern"][tick]), 0)
            )
            self.send(self.inputs.get(tick + 1))
        self.impacts = past.impacts
        if "limb_impact" in self.streams:
            self.streams["limb_impact"].go_on_after(self.impacts - 1)

    @property
    def done(self) -> int:
        """The newest tick that is answered."""
        return self.tick

    def awaited(self) -> str:
        """What the next answer needs."""
        if self.finished:
            return ""
        if not self.waiting:
            return f"limb_state of tick {self.tick + 1} from limb_dynamics"
        tick, _, _, impacts = self.waiting[0]
        if impacts > self.impacts:
            return f"impact {self.impacts} within tick {self.tick} from limb_dynamics"
        return f"activation of tick {tick + (tick in self.inputs)} from activation_input"
