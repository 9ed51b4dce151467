"""Node activation_input: sends the activation of every tick, from a source or from live EMG."""

from __future__ import annotations

import time
from collections import deque
from functools import partial
from typing import Any

import numpy as np

from limb_nodes.errors import FieldError, UserError, clean
from limb_nodes.exchange.activations import ActivationPart
from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.nodes.base import LimbNode
from limb_nodes.nodes.health import Steps
from limb_nodes.nodes.live_readers import reader
from limb_nodes.nodes.live_settings import EMG_RATE, ON_SILENCE, SILENCE, LiveSettings
from limb_nodes.nodes.live_source import LiveSource
from limb_nodes.nodes.running import main_of
from limb_nodes.signals.activation import Activation, load_activation

MOST_ON_THE_WAY = 1000


class ActivationInput(LimbNode):
    """On the limb's state at tick k sends activation k + 1, and activation 0 before it.

    Subscribes, without a source, `emg_envelope` or `emg`; publishes `activation`, and how the live source does on
    `/diagnostics`.
    """

    part: ActivationPart

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
        # Of envelopes that have come: at which tick they reach the limb, and when they came.
        self.on_the_way: deque[tuple[int, float]] = deque(maxlen=MOST_ON_THE_WAY)
        self.latency = Steps()
        final: int | None = None
        self.muscles = self.limb.muscle_names
        if source:
            self.source = load_activation(source, self.muscles, self.ticks.rate, duration or None)
            final = len(self.source.values) - 1
            for note in self.source.notes:
                self.get_logger().info(clean(note))
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
            final = round(duration * self.ticks.rate) if duration else None
            self.live = self.live_source(settings)
        part = ActivationPart(**self.common, values_at=self.values_at, final=final)
        if self.live is not None:
            part.before = partial(self.look_at_source, self.live)
        self.carry(part)

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
                "on_silence", ON_SILENCE, "live: what a silent source leads to: zero activations, the last held, a stop"
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
            raise UserError(f"activation_input: {error.raw(f'the parameter {error.field}')}") from None

    def values_at(self, tick: int) -> FloatArray:
        """The activations [muscles] of a tick: of a live source those that it gives now."""
        if self.live is None:
            assert self.source is not None
            values: FloatArray = self.source.values[tick]
            return values
        if tick == self.part.final:
            # Before the message with which the recording ends.
            self.tell_of_source(self.live)
        if self.live.arrived:
            # The limb's state one tick later is the first that this message moves.
            self.on_the_way.append((tick + 1, self.live.arrived))
            self.live.arrived = 0.0
        return self.newest

    @property
    def newest(self) -> FloatArray:
        """The activations [muscles] that a live source gives now."""
        assert self.live is not None
        if self.live.silent and self.on_silence == "zero":
            return np.zeros(len(self.muscles))
        return self.live.values

    def look_at_source(self, live: LiveSource, tick: int) -> None:
        """Open a live source once the limb moves, and end the run with it if it is to be."""
        while self.on_the_way and self.on_the_way[0][0] <= tick:
            self.latency.add(time.monotonic() - self.on_the_way.popleft()[1])
        if live.subscription is None and tick > 0:
            # Not before, so that who waits for a listener starts together with the limb.
            live.open()
        if live.gone and self.on_silence == "stop" and not live.closed:
            live.closed = True
            self.part.end_soon()

    def report(self) -> None:
        """Publish how the node does: with a live source, how that one does."""
        if self.live is None or self.live.subscription is None:
            super().report()
        else:
            self.live.report()

    def tell_of_source(self, live: LiveSource) -> None:
        """Tell how the live source did until now."""
        if live.subscription is not None:
            live.look()
            live.report()

    def destroy_node(self) -> None:
        """Tell how the live source did if the run is ended before its last tick."""
        if self.live is not None and hasattr(self, "part") and not self.part.finished:
            self.tell_of_source(self.live)
        super().destroy_node()


main = main_of(ActivationInput)

if __name__ == "__main__":
    main()
