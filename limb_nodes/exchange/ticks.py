"""Simulation time: tick k is k times a whole number of nanoseconds."""

from __future__ import annotations

from limb_nodes.errors import UserError

SECOND = 1_000_000_000


class Ticks:
    """The fixed rate of a run.

    rate: Hz. nanoseconds: of one tick. period: of one tick, in s.
    """

    def __init__(self, rate: float) -> None:
        if not 0.0 < rate <= 100_000.0:
            raise UserError(f"rate is {rate:g}; a number > 0 and <= 100000 in Hz is needed")
        self.rate = rate
        self.nanoseconds = round(SECOND / rate)
        self.period = self.nanoseconds / SECOND
