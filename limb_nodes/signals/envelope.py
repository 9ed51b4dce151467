"""The steps from raw EMG to a normalised envelope, each a function of arrays.

The usual chain is band_pass, rectify, low_pass, normalise; the defaults stand with their sources:

- band 20 to 450 Hz: a corner of 20 Hz with 12 dB/octave removes movement artefacts; above 400 to 450 Hz
  is noise (De Luca, Gilmore, Kuznetsov and Roy, J Biomech 43 (2010) 1573). 12 dB/octave is the
  second-order filter that runs here in each direction.
- low-pass 6 Hz, fourth order, no phase shift: the linear envelope (Winter, Biomechanics and Motor
  Control of Human Movement, 4th ed. 2009, ch. 10: 3 to 6 Hz for movement).
- order and zero phase: a Butterworth filter of half the order runs forward and backward, its corner
  corrected so that the two passes together lose 3 dB there (Winter, ch. 3).
- mains: a notch at the frequency of the mains and at each of its multiples below half the rate, with the quality
  factor 30, so that the widths grow with the frequency, as the drift of a harmonic does.

What works sample by sample is in `limb_nodes.signals.causal`, of the same filters in one pass.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt
from scipy.ndimage import uniform_filter1d
from scipy.signal import butter, iirnotch, sosfiltfilt, tf2sos

from limb_nodes.foundation.arrays import FloatArray, IntArray

DEFAULT_BAND = (20.0, 450.0)
DEFAULT_LOW_PASS = 6.0
DEFAULT_ORDER = 4
MAINS = (50.0, 60.0)
NOTCH_QUALITY = 30.0
# A notch rings for quality / (pi frequency): so many of these times are put before and after the signal.
_NOTCH_PADS = 3.0

Kind = Literal["lowpass", "highpass"]


@dataclass(frozen=True)
class Gaps:
    """What was bridged in one channel.

    count: runs of missing samples; samples: missing samples in all; longest: samples of the longest run.
    """

    count: int
    samples: int
    longest: int


def bridge_gaps(values: FloatArray) -> tuple[FloatArray, Gaps]:
    """Replace missing samples (NaN) along straight lines; ends hold the nearest value.

    values: [samples]. Returns the same without NaN, and what was bridged.
    Raises ValueError if no sample is finite.
    """
    missing = ~np.isfinite(values)
    if missing.all():
        raise ValueError("no sample is finite; at least one is needed")
    if not missing.any():
        return values.copy(), Gaps(0, 0, 0)
    lengths = np.diff(runs(missing))
    samples = np.arange(len(values))
    bridged = np.interp(samples, samples[~missing], values[~missing])
    return bridged, Gaps(len(lengths), int(lengths.sum()), int(lengths.max()))


def runs(mask: npt.NDArray[np.bool_]) -> IntArray:
    """Where a mask [samples] is true without a break: [runs, 2], the first sample of each run and the one after it."""
    edges = np.flatnonzero(np.diff(mask.astype(np.int8), prepend=0, append=0))
    return edges.reshape(-1, 2).astype(np.int64)


def notch(values: FloatArray, rate: float, mains: float) -> FloatArray:
    """Remove the hum of the mains and its harmonics, without phase shift.

    values: [samples, channels], no NaN; rate and mains in Hz. Returns an array of the same shape and unit. Raises
    ValueError as `notch_sections` does.
    """
    pad = min(len(values) - 1, int(np.ceil(_NOTCH_PADS * NOTCH_QUALITY / (np.pi * mains) * rate)))
    cleaned: FloatArray = sosfiltfilt(notch_sections(rate, mains), values, axis=0, padtype="odd", padlen=pad)
    return cleaned


def notch_sections(rate: float, mains: float) -> FloatArray:
    """Second-order sections [harmonics, 6] that remove the mains and its multiples below half the rate (Hz).

    Raises ValueError if the mains is no frequency of a grid, or not below half the rate.
    """
    if mains not in MAINS:
        raise ValueError(f"is {mains:g}; 50 or 60 in Hz is needed")
    if not mains < rate / 2:
        raise ValueError(f"is {mains:g}; a number < {rate / 2:g} in Hz, half the rate, is needed")
    harmonics = mains * np.arange(1, np.ceil(rate / 2 / mains))
    return np.vstack([tf2sos(*iirnotch(frequency, NOTCH_QUALITY, rate)) for frequency in harmonics])


def band_pass(values: FloatArray, rate: float, band: tuple[float, float], order: int = DEFAULT_ORDER) -> FloatArray:
    """Keep the frequencies between two edges (Hz), without phase shift.

    values: [samples, channels], no NaN; rate in Hz; each edge is a filter of the given (even) order, 3 dB down
    at the edge. Returns an array of the same shape and unit. Raises ValueError as `check_filter` does.
    """
    check_band(band)
    return _zero_phase(_zero_phase(values, rate, band[0], order, "highpass"), rate, band[1], order, "lowpass")


def check_band(band: tuple[float, float]) -> None:
    """Raise ValueError if the edges of a band-pass (Hz) do not rise."""
    low, high = band
    if not low < high:
        raise ValueError(f"edges are {low:g} and {high:g}; a lower and then a higher number in Hz are needed")


def rectify(values: FloatArray) -> FloatArray:
    """Full-wave rectification: the absolute value."""
    return np.abs(values)


def low_pass(
    values: FloatArray, rate: float, corner: float = DEFAULT_LOW_PASS, order: int = DEFAULT_ORDER
) -> FloatArray:
    """Smooth without phase shift.

    values: [samples, channels], no NaN; rate and corner in Hz; 3 dB down at the corner. Returns an array of the
    same shape and unit. Raises ValueError as `check_filter` does.
    """
    return _zero_phase(values, rate, corner, order, "lowpass")


def check_filter(rate: float, corner: float, order: int, samples: int | None = None) -> None:
    """Raise ValueError, of the form `NAME is VALUE; WHAT is needed`, if a filter cannot work on such a signal.

    The corner lies between 0 and half the rate, the order is even and 2 to 12, and the signal, if it has an end, lasts
    one period of the corner frequency at least.
    """
    if order < 2 or order > 12 or order % 2:
        raise ValueError(f"order is {order}; an even number from 2 to 12 is needed")
    if not 0 < corner < rate / 2:
        raise ValueError(f"corner is {corner:g}; a number > 0 and < {rate / 2:g} in Hz, half the rate, is needed")
    if samples is not None and samples < max(2, rate / corner):
        raise ValueError(
            f"corner is {corner:g}; {int(np.ceil(rate / corner))} samples, one period of it, are needed, not {samples}"
        )


def rest_level(envelope: FloatArray, rate: float, seconds: float) -> FloatArray:
    """The lowest mean over any stretch of the given length: [channels], in the envelope's unit.

    envelope: [samples, channels], NaN in gaps. Raises ValueError if the stretch is longer than any between gaps.
    """
    window = max(1, round(seconds * rate))
    return np.array([_lowest_mean(column, rate, window, seconds) for column in envelope.T])


def _lowest_mean(column: FloatArray, rate: float, window: int, seconds: float) -> float:
    stretches = [column[start:end] for start, end in runs(np.isfinite(column))]
    longest = max(map(len, stretches), default=0)
    if window > longest:
        whole = "the whole recording" if longest == len(column) else "the longest stretch without a gap"
        raise ValueError(f"is {seconds:g}; a number <= {longest / rate:g} in s, {whole}, is needed")
    valid = [
        uniform_filter1d(stretch, window)[window // 2 : len(stretch) - (window - 1) // 2]
        for stretch in stretches
        if len(stretch) >= window
    ]
    return float(min(means.min() for means in valid))


def normalise(
    envelope: FloatArray, maximum: FloatArray, rest: FloatArray | float = 0.0
) -> tuple[FloatArray, list[int]]:
    """Scale so that `rest` becomes 0 and `maximum` 1, and clip to [0, 1].

    envelope: [samples, channels]; maximum, rest: [channels], in the envelope's unit.
    Returns the activations [samples, channels], dimensionless, and per channel how many samples
    exceeded the maximum. Raises ValueError if a maximum is not above its rest level.
    """
    span = maximum - rest
    if not np.all(span > 0):
        raise ValueError("a maximum is not above its rest level; a greater one is needed")
    scaled = (envelope - rest) / span
    above = (scaled > 1.0).sum(axis=0)
    return np.clip(scaled, 0.0, 1.0), [int(n) for n in above]


def resample(values: FloatArray, rate: float, new_rate: float, delay: float = 0.0) -> FloatArray:
    """Take a signal at another rate, by straight lines between its samples.

    values: [samples, channels] at `rate` (Hz). delay: time (s) by which the result comes later; it begins with the
    first values, held. Returns [new samples, channels] at `new_rate`, from the same first instant to the last that the
    signal covers. Raises ValueError if the new rate is not above 0.
    """
    if not new_rate > 0:
        raise ValueError(f"is {new_rate:g}; a number > 0 in Hz is needed")
    times = np.arange(len(values)) / rate
    count = int(np.floor(times[-1] * new_rate + 1e-9)) + 1
    new_times = np.arange(count) / new_rate - delay
    return np.stack([np.interp(new_times, times, values[:, i]) for i in range(values.shape[1])], axis=1)


def one_pass(rate: float, corner: float, order: int, kind: Kind) -> FloatArray:
    """Second-order sections [order / 2, 6] of a Butterworth filter that runs once, 3 dB down at its corner (Hz).

    Raises ValueError as `check_filter` does.
    """
    check_filter(rate, corner, order)
    sections: FloatArray = butter(order, corner, kind, fs=rate, output="sos")
    return sections


def _zero_phase(values: FloatArray, rate: float, corner: float, order: int, kind: Kind) -> FloatArray:
    check_filter(rate, corner, order, len(values))
    half = order // 2
    # Two passes square the gain: the single pass must have lost only 1.5 dB at the corner. The
    # bilinear transform maps frequency through tan, so the correction is exact there, up to Nyquist.
    shift = (np.sqrt(2.0) - 1.0) ** (1.0 / (2 * half))
    warped = np.tan(np.pi * corner / rate)
    warped = warped / shift if kind == "lowpass" else warped * shift
    sections = butter(half, np.arctan(warped) * rate / np.pi, kind, fs=rate, output="sos")
    # A mirrored end keeps the mean of a rectified signal; a point-mirrored one keeps the slope of a drift.
    pad = min(len(values) - 1, int(np.ceil(3 * rate / corner)))
    filtered: FloatArray = sosfiltfilt(
        sections, values, axis=0, padtype="even" if kind == "lowpass" else "odd", padlen=pad
    )
    return filtered
