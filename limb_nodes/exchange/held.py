"""A value from outside, held until another one comes or it is too old."""

from __future__ import annotations

from limb_nodes.foundation.arrays import FloatArray


class Held:
    """What acts on the limb from outside.

    heard: whether anything has come. stale: whether what came last is too old; what was there at first acts then.
    """

    def __init__(self, target: FloatArray, ticks: int) -> None:
        """target: the array that is written to. ticks: how long a value counts; 0 for ever."""
        self._target, self._first, self._ticks = target, target.copy(), ticks
        self._since = 0
        self.heard = self.stale = False

    def take(self, values: FloatArray, tick: int) -> None:
        """Let values act from a tick on."""
        self._target[:] = values
        self._since, self.heard, self.stale = tick, True, False

    def age(self, tick: int) -> None:
        """Let go of what is too old at a tick."""
        if self.heard and not self.stale and self._ticks and tick - self._since >= self._ticks:
            self._target[:], self.stale = self._first, True
