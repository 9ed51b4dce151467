"""Node activation_input: sends the activation of every tick, from a source or from live EMG."""

from __future__ import annotations

from typing import Any

import numpy as np
from limb_msgs.msg import MuscleActivation
from sensor_msgs.msg import JointState

from limb_nodes.errors import FieldError, UserError
from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.nodes.base import LimbNode
from limb_nodes.nodes.live_readers import reader
from limb_nodes.nodes.live_settings import EMG_RATE, ON_SILENCE, SILENCE, LiveSettings
from limb_nodes.nodes.live_source import LiveSource
from limb_nodes.nodes.running import main_of
from limb_nodes.nodes.wire import Incoming
from limb_nodes.signals.activation import Activation, load_activation

# How long before the last tick a run that is stopped tells which it is (s).
NOTICE = 0.2


class ActivationInput(LimbNode):
    """On joint_states k sends activation k + 1, and activation 0 before it.

    Subscribes `joint_states` and, without a source, `emg_envelope` or `emg`; publishes `activation`, and how the live
    source does on `/diagnostics`.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__("activation_input", **options)
        source = self.text(
            "source", "", "bag, CSV, waveform YAML or constants (flexor=0.9,...); empty: live from a topic"
        )
        duration = self.number(
            "duration", 0.0, "seconds of simulation time; 0: the whole recording, or without end when live", 0.0, 1e9
        )
        settings = self.live_settings()
        self.on_silence = settings.on_silence
        self.source: Activation | None = None
        self.live: LiveSource | None = None
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
            self.live = self.live_source(settings)
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

    def live_settings(self) -> LiveSettings:
        """The parameters of live input."""
        default = LiveSettings()
        longest, fastest = SILENCE.maximum or 0.0, EMG_RATE.maximum or 0.0
        orders = "order of the causal"
        return LiveSettings(
            channels=self.text(
                "channels", "", "live: CHANNEL=MUSCLE,... renames; raw EMG: all channels in the order of the values"
            ),
            on_silence=self.choice(
                "on_silence", ON_SILENCE, "live: what a silent source leads to: hold or zero activations, stop the run"
            ),
            silence=self.number(
                "silence", default.silence, "live: a source is silent after so long, s", SILENCE.minimum or 0.0, longest
            ),
            emg_rate=self.number(
                "emg_rate",
                0.0,
                "live: samples per second of raw EMG on emg; 0: envelopes on emg_envelope",
                0.0,
                fastest,
            ),
            maximum=self.text("maximum", "", "raw EMG: CHANNEL=VALUE,..., the envelope that counts as 1, in its unit"),
            mains=self.number("mains", 0.0, "raw EMG: notch at the mains and its harmonics, Hz; 0: none", 0.0, 60.0),
            band=self.text("band", default.band, "raw EMG: LOW,HIGH, edges of the band-pass, Hz; empty: none"),
            band_order=self.whole("band_order", default.band_order, f"raw EMG: {orders} band-pass, even", 2, 12),
            low_pass=self.number("low_pass", default.low_pass, "raw EMG: corner, Hz; 0: no low-pass", 0.0, fastest),
            low_pass_order=self.whole(
                "low_pass_order", default.low_pass_order, f"raw EMG: {orders} low-pass, even", 2, 12
            ),
        )

    def live_source(self, settings: LiveSettings) -> LiveSource:
        """The live source that the settings ask for."""
        try:
            return LiveSource(self, reader(self.muscles, settings), settings.silence, len(self.muscles))
        except FieldError as error:
            raise UserError(f"activation_input: {error.line(f'the parameter {error.field}')}") from None

    @property
    def newest(self) -> FloatArray:
        """The activations [muscles] that a live source gives now."""
        assert self.live is not None
        if self.live.silent and self.on_silence == "zero":
            return np.zeros(len(self.muscles))
        return self.live.values

    def on_joint_states(self, data: bytes) -> None:
        """Send what the tick of the message and the next one need."""
        now = self.joint_states.read(data)
        last = now + 1
        if self.live is not None:
            if self.live.subscription is None and now > 0:
                # Not before the limb moves, so that who waits for a listener starts together with the limb.
                self.live.open()
            if self.live.gone and self.on_silence == "stop" and not self.live.closed:
                self.live.closed = True
                # The limb may be ahead by some ticks; all nodes must hear in time which is the last.
                following = last + 1 + round(NOTICE * self.ticks.rate)
                self.final = following if self.final is None else min(self.final, following)
                self.activation.values["last_tick"][...] = self.final
        if self.final is not None and last >= self.final:
            last = self.final
            # Only the final tick itself tells that muscle_stack has taken all activations before it.
            self.finished = now >= self.final
            if self.live is not None and self.sent < self.final:
                # Before the message with which the recording ends.
                self.tell_of_source(self.live)
        for tick in range(self.sent + 1, last + 1):
            values = self.activation.values
            values["activation"][:] = self.newest if self.source is None else self.source.values[tick]
            self.activation.publish(tick)
        self.sent = max(self.sent, last)

    def tell_of_source(self, live: LiveSource) -> None:
        """Tell how the live source did until now."""
        if live.subscription is not None:
            live.look()
            live.report()

    def destroy_node(self) -> None:
        """Tell how the live source did if the run is ended before its last tick."""
        if self.live is not None and not self.finished:
            self.tell_of_source(self.live)
        super().destroy_node()


main = main_of(ActivationInput)

if __name__ == "__main__":
    main()
