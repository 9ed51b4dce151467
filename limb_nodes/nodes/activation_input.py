"""Node activation_input: sends the activation of every tick, from a source or from live EMG."""

from __future__ import annotations

from typing import Any

import numpy as np
from limb_msgs.msg import MuscleActivation
from sensor_msgs.msg import JointState

from limb_nodes.errors import UserError
from limb_nodes.nodes.base import LimbNode
from limb_nodes.nodes.qos import LIVE
from limb_nodes.nodes.running import main_of
from limb_nodes.nodes.wire import Incoming
from limb_nodes.signals.activation import Activation, load_activation


class ActivationInput(LimbNode):
    """On joint_states k sends activation k + 1, and activation 0 before it.

    Subscribes `joint_states` and, without a source, `emg_envelope`; publishes `activation`.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__("activation_input", **options)
        source = self.text(
            "source", "", "bag, CSV, waveform YAML or constants (flexor=0.9,...); empty: live from emg_envelope"
        )
        duration = self.number(
            "duration", 0.0, "seconds of simulation time; 0: the whole recording, or without end when live", 0.0, 1e9
        )
        self.source: Activation | None = None
        self.final: int | None = None
        self.muscles = self.limb.muscle_names
        if source:
            self.source = load_activation(source, self.muscles, self.ticks.rate, duration or None)
            self.final = len(self.source.values) - 1
            for note in self.source.notes:
                self.get_logger().info(note)
        elif self.mode == "lockstep":
            raise UserError(
                "activation_input: the parameter source is empty; in mode lockstep a bag, CSV, waveform YAML or "
                "constants are needed (live input needs mode realtime)"
            )
        else:
            if 0.0 < duration < self.ticks.period:
                raise UserError(
                    f"activation_input: the parameter duration is {duration:g}; 0, or at least one tick of "
                    f"{self.ticks.period:g} s is needed"
                )
            self.final = round(duration * self.ticks.rate) if duration else None
        self.envelopes: Any = None
        self.newest = np.zeros(len(self.muscles))
        self.sent = -1
        example = MuscleActivation(
            last_tick=-1 if self.final is None else self.final,
            name=self.muscles,
            activation=[0.0] * len(self.muscles),
        )
        self.activation = self.outgoing("activation", example)
        self.joint_states = Incoming(JointState, "name", self.ticks.nanoseconds)
        zeros = [0.0] * len(self.limb.joint_names)
        self.joint_states.expect(JointState(name=self.limb.joint_names, position=zeros, velocity=zeros))
        self.listen_to_run(JointState, "joint_states", self.on_joint_states)

    def hear_envelopes(self) -> None:
        """Subscribe the live envelopes."""
        self.envelopes = self.listen(MuscleActivation, "emg_envelope", self.on_envelope, LIVE)

    def on_envelope(self, message: MuscleActivation) -> None:
        """Take over a live envelope if every value is good."""
        whole = len(message.name) == len(message.activation)
        given = dict(zip(message.name, message.activation, strict=True)) if whole else {}
        values = np.array([given.get(name, np.nan) for name in self.muscles])
        good = (values >= 0.0) & (values <= 1.0)
        if good.all():
            self.newest = values
            return
        name = self.muscles[int(np.flatnonzero(~good)[0])]
        value = f"is {given[name]:g}" if name in given else "is missing"
        self.complain(f"emg_envelope: {name} {value}; a number from 0 to 1 is needed")

    def on_joint_states(self, data: bytes) -> None:
        """Send what the tick of the message and the next one need."""
        now = self.joint_states.read(data)
        if self.source is None and self.envelopes is None and now > 0:
            # Not before the limb moves, so that who waits for a listener starts together with the limb.
            self.hear_envelopes()
        last = now + 1
        if self.final is not None and last >= self.final:
            last = self.final
            # Only the final tick itself tells that muscle_stack has taken all activations before it.
            self.finished = now >= self.final
        for tick in range(self.sent + 1, last + 1):
            values = self.activation.values
            values["activation"][:] = self.newest if self.source is None else self.source.values[tick]
            self.activation.publish(tick)
        self.sent = max(self.sent, last)


main = main_of(ActivationInput)

if __name__ == "__main__":
    main()
