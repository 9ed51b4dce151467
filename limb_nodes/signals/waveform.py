"""Activations that are written down instead of recorded: waveforms in YAML, constants in a line.

    muscles:
      flexor: {wave: sine, amplitude: 1, frequency: 1}
      extensor: {wave: constant, value: 0.2}

A sine or cosine that leaves [0, 1] is clipped there, because a muscle has no activation below zero;
`clip: false` makes it an error instead.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from limb_nodes.errors import UserError
from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.foundation.parameter import Parameter
from limb_nodes.foundation.section import Section, describe
from limb_nodes.foundation.yaml_text import read_yaml

Numbers = Mapping[str, float]


@dataclass(frozen=True)
class Wave:
    """A kind of waveform.

    sample: activations at times [samples] in s, from the numbers under its keys. keys: these numbers.
    clips: whether it takes the key `clip`. rising: two keys, of which the second must be the greater.
    """

    sample: Callable[[FloatArray, Numbers], FloatArray]
    keys: tuple[Parameter, ...]
    clips: bool = False
    rising: tuple[str, str] | None = None


def constant(time: FloatArray, p: Numbers) -> FloatArray:
    """The same value at all times."""
    return np.full(time.shape, p["value"])


def sine(time: FloatArray, p: Numbers) -> FloatArray:
    """mean + amplitude sin(2 pi frequency t + phase)."""
    return p["mean"] + p["amplitude"] * np.sin(2 * np.pi * p["frequency"] * time + p["phase"])


def cosine(time: FloatArray, p: Numbers) -> FloatArray:
    """mean + amplitude cos(2 pi frequency t + phase)."""
    return p["mean"] + p["amplitude"] * np.cos(2 * np.pi * p["frequency"] * time + p["phase"])


def step(time: FloatArray, p: Numbers) -> FloatArray:
    """`before` until `time`, `after` from then on."""
    return np.where(time < p["time"], p["before"], p["after"])


def ramp(time: FloatArray, p: Numbers) -> FloatArray:
    """`start` until `start_time`, then straight to `end` at `end_time`, and `end` from then on."""
    return np.interp(time, [p["start_time"], p["end_time"]], [p["start"], p["end"]])


def _activation(name: str, meaning: str) -> Parameter:
    return Parameter(name, "1", meaning, minimum=0.0, maximum=1.0)


def _time(name: str, meaning: str) -> Parameter:
    return Parameter(name, "s", meaning, minimum=0.0)


_PERIODIC = (
    Parameter("mean", "1", "value about which it swings", 0.0),
    Parameter("amplitude", "1", "greatest distance from the mean", 1.0),
    Parameter("frequency", "Hz", "periods per second", minimum=0.0),
    Parameter("phase", "rad", "angle at time 0", 0.0),
)

WAVES: Mapping[str, Wave] = {
    "constant": Wave(constant, (_activation("value", "the activation"),)),
    "sine": Wave(sine, _PERIODIC, clips=True),
    "cosine": Wave(cosine, _PERIODIC, clips=True),
    "step": Wave(
        step,
        (
            _activation("before", "activation before the step"),
            _activation("after", "activation from the step on"),
            _time("time", "when it steps"),
        ),
    ),
    "ramp": Wave(
        ramp,
        (
            _activation("start", "activation until the ramp starts"),
            _activation("end", "activation from the ramp's end on"),
            _time("start_time", "when the ramp starts"),
            _time("end_time", "when the ramp ends"),
        ),
        rising=("start_time", "end_time"),
    ),
}


@dataclass(frozen=True)
class Waveform:
    """One muscle's waveform: its kind, its numbers, and whether it is clipped to [0, 1]."""

    wave: str
    numbers: Numbers
    clip: bool = False

    def sample(self, time: FloatArray) -> FloatArray:
        """Activation at times [samples] in s; outside [0, 1] only if not clipped."""
        values = WAVES[self.wave].sample(time, self.numbers)
        return np.clip(values, 0.0, 1.0) if self.clip else values


def read_waveforms(path: str | Path) -> dict[str, Waveform]:
    """Read a waveform YAML: waveforms by muscle.

    Raises UserError that names file, place (`muscles.flexor.frequency`), value and what is allowed.
    """
    content, _ = read_yaml(Path(path))
    top = Section(str(path), "", content)
    muscles = top.section("muscles")
    top.finish()
    if not muscles.content:
        muscles.fail("", "is empty; at least one muscle is needed")
    return {name: _waveform(muscles.section(name)) for name in muscles.content}


def parse_constants(text: str) -> dict[str, Waveform]:
    """Read constants written in a line, `flexor=0.9,extensor=0`: waveforms by muscle.

    Raises UserError that names the entry and what is allowed.
    """
    waveforms: dict[str, Waveform] = {}
    for entry in text.split(","):
        name, equals, number = (part.strip() for part in entry.partition("="))
        if not (name and equals and number):
            raise UserError(f"{text}: {entry.strip()!r} is no constant; MUSCLE=VALUE, such as flexor=0.9, is needed")
        if name in waveforms:
            raise UserError(f"{text}: {name} is there twice; one value for each muscle is needed")
        try:
            value = float(number)
        except ValueError:
            value = float("nan")
        if not 0.0 <= value <= 1.0:
            raise UserError(f"{text}: {name} is {number}; a number in [0, 1] is needed")
        waveforms[name] = Waveform("constant", {"value": value})
    return waveforms


def check_frequencies(source: str, waveforms: Mapping[str, Waveform], muscles: Sequence[str], rate: float) -> None:
    """Raise UserError if a waveform oscillates faster than samples at a rate (Hz) can follow."""
    for muscle in muscles:
        frequency = waveforms[muscle].numbers.get("frequency", 0.0)
        if frequency >= rate / 2:
            raise UserError(
                f"{source}: muscles.{muscle}.frequency is {frequency:g}; "
                f"a number < {rate / 2:g} in Hz is needed, half the rate"
            )


def sample_waveforms(
    source: str, waveforms: Mapping[str, Waveform], muscles: Sequence[str], times: FloatArray
) -> FloatArray:
    """Activations [samples, muscles] at times [samples] in s.

    Raises UserError if a waveform leaves [0, 1] without being clipped.
    """
    columns = []
    for muscle in muscles:
        values = waveforms[muscle].sample(times)
        outside = np.flatnonzero((values < 0.0) | (values > 1.0))
        if outside.size:
            first = outside[0]
            raise UserError(
                f"{source}: muscles.{muscle} is {values[first]:g} at {times[first]:g} s; "
                "a number in [0, 1] is needed, or clip: true"
            )
        columns.append(values)
    return np.stack(columns, axis=1) if columns else np.empty((len(times), 0))


def _waveform(section: Section) -> Waveform:
    name = section.choice("wave", WAVES)
    wave = WAVES[name]
    # Every key of a wave is required or has a numeric default, so that no number is None.
    numbers = {key.name: section.number(key) or 0.0 for key in wave.keys}
    clip = section.take("clip") if wave.clips else False
    clip = wave.clips if clip is None else clip
    if not isinstance(clip, bool):
        section.fail("clip", f"is {describe(clip)}; true or false is needed")
    section.finish()
    if wave.rising:
        low, high = wave.rising
        if numbers[high] <= numbers[low]:
            section.fail(high, f"is {numbers[high]:g}; a number > {low} ({numbers[low]:g}) is needed")
    return Waveform(name, numbers, bool(clip))
