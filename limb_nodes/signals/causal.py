"""Raw EMG to envelopes sample by sample: what a live source can do, and what `limb emg --causal` does.

The steps of `limb_nodes.signals.envelope`, each filter in one pass of the whole order. Such an envelope is late, by
about 0.07 s with a low-pass of 6 Hz and order 4.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise

import numpy as np
import numpy.typing as npt
from scipy.signal import sosfilt, sosfilt_zi

from limb_nodes.errors import FieldError
from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.signals import envelope as steps
from limb_nodes.signals.options import EnvelopeOptions

Mask = npt.NDArray[np.bool_]


class CausalChain:
    """Notch, band-pass, rectification and low-pass of several channels, with their state between calls.

    A channel starts at its first finite value, as if it had always had that value, so that an offset makes no
    transient; until then its envelope is 0. A value that is missing (NaN or infinite) is taken as the one before.

    Args:
        rate: samples per second (Hz).
        options: of it count mains, band, band_order, rectify, low_pass and low_pass_order.
        channels: how many.
        source: what an error begins with, such as the name of a recording.

    Raises:
        FieldError: a filter cannot work at this rate; its field is the one of the options.
    """

    def __init__(self, rate: float, options: EnvelopeOptions, channels: int, source: str = "") -> None:
        before, after = _sections(rate, options, source)
        self._raw, self._rectified = _Filter(before, channels), _Filter(after, channels)
        self._rectify = options.rectify
        self._started: Mask = np.zeros(channels, dtype=bool)
        self._last: FloatArray = np.zeros(channels)

    def step(self, values: FloatArray) -> FloatArray:
        """The envelopes [channels] after one more sample of each channel, values [channels], in their unit."""
        envelopes: FloatArray = self.process(np.asarray(values, dtype=np.float64)[None, :])[0]
        return envelopes

    def process(self, values: FloatArray) -> FloatArray:
        """The envelopes [samples, channels] of the next samples, values [samples, channels]; the same as by steps."""
        if not len(values):
            return values.copy()
        if self._started.all() and np.isfinite(values).all():
            # The usual case by far, and the one in which a live source has no time to lose.
            self._last = values[-1].copy()
            return self._run(values, slice(None), None)
        held, starts = self._held(values)
        result = np.zeros(held.shape)
        rows = np.unique(starts[~self._started & (starts < len(values))])
        edges = np.unique([0, *rows, len(values)])
        for start, end in pairwise(edges.tolist()):
            new = ~self._started & (starts <= start)
            self._started |= new
            result[start:end, self._started] = self._run(held[start:end, self._started], self._started, new)
        return result

    def _held(self, values: FloatArray) -> tuple[FloatArray, npt.NDArray[np.intp]]:
        """The values, each missing one as the one before it, and the row of each channel's first finite value."""
        finite = np.isfinite(values)
        starts = np.where(finite.any(axis=0), finite.argmax(axis=0), len(values))
        held = values
        if not finite.all():
            rows = np.maximum.accumulate(np.where(finite, np.arange(len(values))[:, None], -1), axis=0)
            held = np.where(rows < 0, self._last, np.take_along_axis(values, np.maximum(rows, 0), axis=0))
        self._last = held[-1].copy()
        return held, starts

    def _run(self, values: FloatArray, running: Mask | slice, new: Mask | None) -> FloatArray:
        """Filter values [samples, running channels], of which the new ones start with the first row."""
        signal = self._raw.run(values, running, new)
        if self._rectify:
            signal = steps.rectify(signal)
        return self._rectified.run(signal, running, new)


class _Filter:
    """Second-order sections [sections, 6] and their state [sections, 2, channels]; without sections it does nothing."""

    def __init__(self, sections: FloatArray, channels: int) -> None:
        self._sections = sections
        self._steady = sosfilt_zi(sections)[:, :, None] if len(sections) else np.zeros((0, 2, 1))
        self._state = np.zeros((len(sections), 2, channels))

    def run(self, values: FloatArray, running: Mask | slice, new: Mask | None) -> FloatArray:
        """Filter values [samples, running channels]; the new channels start at rest at their first value."""
        if not len(self._sections):
            return values
        if new is not None:
            self._state[:, :, new] = self._steady * values[0, new[running]]
        filtered: FloatArray
        filtered, self._state[:, :, running] = sosfilt(self._sections, values, axis=0, zi=self._state[:, :, running])
        return filtered


def _sections(rate: float, options: EnvelopeOptions, source: str) -> tuple[FloatArray, FloatArray]:
    """The filters before and after the rectification."""
    before, after = [np.zeros((0, 6))], [np.zeros((0, 6))]
    if options.mains is not None:
        with naming("mains", source):
            before.append(steps.notch_sections(rate, options.mains))
    if options.band is not None:
        with naming("band", source):
            steps.check_band(options.band)
            before.append(steps.one_pass(rate, options.band[0], options.band_order, "highpass"))
            before.append(steps.one_pass(rate, options.band[1], options.band_order, "lowpass"))
    if options.low_pass is not None:
        with naming("low_pass", source):
            after.append(steps.one_pass(rate, options.low_pass, options.low_pass_order, "lowpass"))
    return np.vstack(before), np.vstack(after)


@contextmanager
def naming(field: str, source: str) -> Iterator[None]:
    """Turn the ValueError of a step into a line that names the source and the field of the options."""
    try:
        yield
    except ValueError as error:
        raise FieldError(field, str(error), source) from error
