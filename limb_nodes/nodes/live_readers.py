"""From the messages of a live source to activations: envelopes as they are, raw EMG by the causal chain."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from limb_msgs.msg import EmgEnvelope
from std_msgs.msg import Float64MultiArray

from limb_nodes.errors import FieldError
from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.nodes.live_settings import EMG_RATE, ON_SILENCE, SILENCE, LiveSettings
from limb_nodes.signals.causal import CausalChain

# Beyond any EMG in any unit, and far from where a filter overflows.
LARGEST = 1e30
# How many letters of a message's names are shown.
MOST_LETTERS = 100


class EnvelopeReader:
    """Takes envelopes: the muscles' values by name, in any order."""

    topic = "emg_envelope"
    kind: type = EmgEnvelope

    def __init__(self, muscles: Sequence[str], settings: LiveSettings) -> None:
        """Raises FieldError if the settings rename to no muscle."""
        self._muscles = muscles
        self._channels = renamed(muscles, settings)

    def read(self, message: EmgEnvelope) -> FloatArray:
        """The activations [muscles]. Raises ValueError that says what is wrong."""
        names, values = message.name, message.envelope
        if len(names) != len(values):
            raise ValueError(f"has {len(names)} names and {len(values)} values; as many are needed")
        given = dict(zip(names, values, strict=True))
        given.update({self._channels[name]: value for name, value in given.items() if name in self._channels})
        missing = [muscle for muscle in self._muscles if muscle not in given]
        if missing:
            raise ValueError(
                f"has {shown(names)}; {', '.join(missing)}, muscles of the limb, are needed too (channels renames)"
            )
        activations = np.array([given[muscle] for muscle in self._muscles])
        wrong = np.flatnonzero(~((activations >= 0.0) & (activations <= 1.0)))
        if wrong.size:
            raise ValueError(f"{self._muscles[wrong[0]]} is {activations[wrong[0]]:g}; a number from 0 to 1 is needed")
        return activations

    def stamp(self, message: EmgEnvelope) -> tuple[int, int]:
        """The time that the source gave the message."""
        return message.header.stamp.sec, message.header.stamp.nanosec


class RawReader:
    """Takes raw EMG: one sample of every channel after another, filtered as `limb emg --causal` does."""

    topic = "emg"
    kind: type = Float64MultiArray

    def __init__(self, muscles: Sequence[str], settings: LiveSettings) -> None:
        """Raises FieldError if a setting is out of range, or a muscle has no channel or no maximum."""
        self._channels = list(settings.named("channels")) or list(muscles)
        muscle_of = {**{name: name for name in self._channels}, **renamed(muscles, settings)}
        channel_of = {muscle: channel for channel, muscle in muscle_of.items()}
        lacking = [muscle for muscle in muscles if muscle not in channel_of]
        if lacking:
            raise FieldError(
                "channels",
                f"is {settings.channels}; a channel for {', '.join(lacking)} is needed too, as CHANNEL=MUSCLE",
            )
        maxima = settings.maxima()
        for name in maxima:
            if name not in self._channels:
                raise FieldError("maximum", f"names {name}; one of {', '.join(self._channels)} is needed")
        wanted = [channel_of[muscle] for muscle in muscles]
        for name in wanted:
            if name not in maxima:
                raise FieldError("maximum", f"of {name} is missing; a number > 0 in the unit of the EMG is needed")
        self._columns = [self._channels.index(name) for name in wanted]
        self._maxima = np.array([maxima[name] for name in wanted])
        self._chain = CausalChain(settings.emg_rate, settings.steps(), len(muscles))

    def read(self, message: Float64MultiArray) -> FloatArray:
        """The activations [muscles] after the samples of a message. Raises ValueError that says what is wrong.

        Values that are missing are taken as the ones before, unless all are.
        """
        size, dimensions = len(self._channels), message.layout.dim
        values = np.array(message.data, dtype=np.float64)
        if not len(values) or len(values) % size or (len(dimensions) > 1 and dimensions[-1].size != size):
            form = "x".join(str(dimension.size) for dimension in dimensions) or str(len(values))
            raise ValueError(f"has {form} values; a multiple of {size}, samples of {shown(self._channels)}, is needed")
        samples = values.reshape(-1, size)[:, self._columns]
        samples[~(np.abs(samples) <= LARGEST)] = np.nan
        if np.isnan(samples).all():
            raise ValueError("no value is a number; samples of the EMG are needed")
        return np.clip(self._chain.process(samples)[-1] / self._maxima, 0.0, 1.0)

    def stamp(self, message: Float64MultiArray) -> None:
        """The message has no time."""


def reader(muscles: Sequence[str], settings: LiveSettings) -> EnvelopeReader | RawReader:
    """The reader that the settings ask for. Raises FieldError if a setting is out of range."""
    SILENCE.check(settings.silence)
    EMG_RATE.check(settings.emg_rate)
    if settings.on_silence not in ON_SILENCE:
        raise FieldError("on_silence", f"is {settings.on_silence}; one of {', '.join(ON_SILENCE)} is needed")
    if settings.emg_rate:
        return RawReader(muscles, settings)
    if settings.maximum:
        raise FieldError("emg_rate", "is missing; the samples per second of raw EMG are needed, for it has maxima")
    return EnvelopeReader(muscles, settings)


def renamed(muscles: Iterable[str], settings: LiveSettings) -> dict[str, str]:
    """The muscle of each channel that has another name. Raises FieldError."""
    result = {channel: muscle for channel, muscle in settings.named("channels").items() if muscle}
    for channel, muscle in result.items():
        if muscle not in muscles:
            raise FieldError("channels", f"gives {channel} the name {muscle}; one of {', '.join(muscles)} is needed")
        if list(result.values()).count(muscle) > 1:
            raise FieldError("channels", f"gives {muscle} to several channels; one channel is needed")
    return result


def shown(names: Sequence[str]) -> str:
    """Names for a line of text."""
    text = ", ".join(names) or "no names"
    return text if len(text) <= MOST_LETTERS else f"{text[:MOST_LETTERS]}..."
