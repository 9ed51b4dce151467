"""A recording of which everything is known: the seated knee, moved by given activations, and noise of their strength.

Surface EMG is close to Gaussian noise whose standard deviation follows the activation (Hogan and Mann, IEEE Trans
Biomed Eng 27 (1980) 382).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from limb_nodes.model import load_limb
from limb_nodes.model.shipped import shipped
from limb_nodes.solve.whole import WholeModel

RATE, ANGLE_RATE = 1000, 50
DURATION = 12.0
LIMB = shipped("seated_knee.yaml")
CHANNELS = ("RF", "BF", "VM", "ST")
# Standard deviation (mV) of each channel's EMG at full activation, and of what an electrode hears besides.
FULL = np.array([0.9, 0.6, 1.2, 0.5])
BACKGROUND = 0.002


@dataclass(frozen=True)
class Generated:
    """What is known: time (s) [T], activation [T, 4] in the order of `CHANNELS`, knee angle (degrees) [T]."""

    time: np.ndarray
    activation: np.ndarray
    angle: np.ndarray


def movement() -> Generated:
    """The knee is stretched three times, and bent in between."""
    time = np.arange(round(DURATION * RATE) + 1) / RATE
    wave = np.sin(0.5 * np.pi * time)
    stretch = 0.01 + 0.15 * np.clip(wave, 0.0, None) ** 2
    bend = 0.01 + 0.06 * np.clip(-wave, 0.0, None) ** 2
    activation = dict(zip(CHANNELS, (stretch, bend, stretch, bend), strict=True))
    limb = load_limb(LIMB)
    excitation = np.column_stack([activation[name] for name in limb.muscle_names])
    solved = WholeModel(limb).simulate(excitation, RATE, observe=False)
    return Generated(time, np.column_stack(list(activation.values())), np.degrees(solved.angle[:, 0]))


def emg(activation: np.ndarray, seed: int) -> np.ndarray:
    """EMG (mV) [T, 4] of activations [T, 4]."""
    rng = np.random.default_rng(seed)
    return FULL * activation * rng.standard_normal(activation.shape) + BACKGROUND * rng.standard_normal(
        activation.shape
    )


def write(path: Path, activation: np.ndarray, angle: np.ndarray, seed: int) -> Path:
    """Write a text file in the shape of "EMG dataset in Lower Limb", the angle at 50 Hz resampled to the EMG's rate."""
    count, step = len(activation), RATE // ANGLE_RATE
    coarse = np.interp(np.arange(count), np.arange(0, count, step), angle[::step])
    lines = [f"File Name: {path.stem}.log"]
    for number, name in enumerate(CHANNELS, 1):
        lines.append(f"Channel {number}: '{name}', {count} values, engineering units: mV, no filters.")
    lines.append(
        f"Channel 5: 'FX', {-(-count // step)} values, engineering units: deg, no filters, "
        f"extrapolated from {ANGLE_RATE} to {RATE} samples per second."
    )
    rows = zip(emg(activation, seed), coarse, strict=True)
    lines += ["", *("\t".join([*(f"{value:.4f}" for value in row), f"{degrees:.1f}"]) for row, degrees in rows)]
    # The recorder adds a row without values.
    path.write_text("\n".join([*lines, "\t\t\t\t"]) + "\n", encoding="utf-8")
    return path
