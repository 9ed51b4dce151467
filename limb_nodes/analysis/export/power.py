"""Work of muscles and joints, from their power.

The power of a muscle is its force along the tendon times the velocity at which the muscle-tendon unit shortens:
positive if it shortens (concentric), negative if it is stretched (eccentric). The power of a joint is the torque of all
muscles on it times its angular velocity: positive if the muscles give energy to the limb. Work is the integral of power
over time, by the trapezoidal rule.

Source: D. A. Winter, Biomechanics and Motor Control of Human Movement, 4th ed. 2009, ch. 6.
"""

from __future__ import annotations

import numpy as np

from limb_nodes.foundation.arrays import FloatArray


class Work:
    """The work (J) done since the first time, of powers that come in pieces."""

    def __init__(self) -> None:
        self._last: tuple[float, FloatArray, FloatArray] | None = None

    def add(self, times: FloatArray, power: FloatArray) -> FloatArray:
        """The work [times, n] until each time.

        times: [times] in s, rising, behind those of the piece before. power: [times, n] in W.
        """
        time, before, done = self._last or (times[0], power[0], np.zeros(power.shape[1]))
        steps = np.diff(times, prepend=time)
        means = (power + np.vstack([before[np.newaxis], power[:-1]])) / 2.0
        work: FloatArray = done + np.cumsum(steps[:, np.newaxis] * means, axis=0)
        self._last = times[-1], power[-1], work[-1]
        return work
