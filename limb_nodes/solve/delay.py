"""The electromechanical delay of muscles: what is excited now reaches the muscle later.

A delay is a number of samples, whole or not: between two samples the input is a straight line. Before the first sample
the muscles are excited as at it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from limb_nodes.errors import UserError
from limb_nodes.foundation.arrays import FloatArray

if TYPE_CHECKING:
    from limb_nodes.model.limb import Limb
    from limb_nodes.solve.course import Input


def delays_of(limb: Limb, rate: float) -> FloatArray:
    """The delays of a limb's muscles [muscles], in samples of `rate` Hz."""
    # A delay that is a whole number of samples is one also where rounding says otherwise.
    return np.array([round(muscle.delay * rate, 9) for muscle in limb.muscles])


def refuse_long_delays(limb: Limb, duration: float) -> None:
    """Raise UserError if a muscle would get nothing of an input that lasts so long (s)."""
    for muscle in limb.muscles:
        if muscle.delay > 0.0 and muscle.delay >= duration:
            raise UserError(
                f"{limb.file}: {muscle.place}.delay is {muscle.delay:g} s; the input lasts {duration:g} s, and "
                "less than that is needed"
            )


def between(older: Any, newer: Any, part: float) -> Any:
    """The values, numbers or arrays, at a part of the way from one sample to the next."""
    return older + part * (newer - older) if part else older


def delayed(samples: Input, delays: Sequence[float] | FloatArray, start: int, end: int) -> FloatArray:
    """Rows of an input as they reach the muscles [end - start, muscles]. delays: in samples [muscles]."""
    back = [math.ceil(delay) for delay in delays]
    first = max(0, start - max(back, default=0))
    known = np.asarray(samples[first:end], dtype=np.float64)
    if not any(back):
        return known
    rows, out = np.arange(start, end), np.empty((end - start, len(back)))
    for muscle, (delay, steps) in enumerate(zip(delays, back, strict=True)):
        older, newer = (known[np.maximum(rows - back_to, 0) - first, muscle] for back_to in (steps, max(steps - 1, 0)))
        out[:, muscle] = between(older, newer, steps - delay)
    return out


class DelayLine:
    """The same, tick by tick. delays: in ticks [muscles]."""

    def __init__(self, delays: FloatArray) -> None:
        self.delays = delays
        self.back = [math.ceil(delay) for delay in delays]
        # The newest last; one tick may be asked for again when the next is already there.
        self.rows: FloatArray = np.zeros((max(self.back) + 2 if any(self.back) else 0, delays.size))
        self.newest = -1

    def reach(self, tick: int, values: FloatArray) -> FloatArray:
        """What reaches the muscles at a tick at which they are excited so [muscles]; ticks may be left out."""
        if not self.rows.size:
            return values
        if self.newest < 0:
            self.rows[:] = values
        elif tick > self.newest:
            passed, last = min(tick - self.newest, len(self.rows)), self.rows[-1].copy()
            self.rows[:-passed] = self.rows[passed:].copy()
            # In real time a tick may be lost: what was before holds.
            self.rows[-passed:] = last
            self.rows[-1] = values
        self.newest = max(self.newest, tick)
        at = len(self.rows) - 1 - (self.newest - tick)
        return np.array(
            [
                between(self.rows[at - steps, m], self.rows[min(at - steps + 1, at), m], steps - self.delays[m])
                for m, steps in enumerate(self.back)
            ]
        )

    @property
    def remembered(self) -> FloatArray:
        """All that the next ticks depend on; `remember` takes it."""
        return np.append(self.rows.reshape(-1), float(self.newest))

    def remember(self, values: FloatArray) -> None:
        """Go on from what another line of the same delays remembered."""
        self.rows[:] = values[:-1].reshape(self.rows.shape)
        self.newest = int(values[-1])
