"""Simulation time: tick k is k times a whole number of nanoseconds."""

from __future__ import annotations

from limb_nodes.errors import UserError

SECOND = 1_000_000_000
# Of a run (Hz).
LOWEST_RATE, HIGHEST_RATE = 1e-3, 100_000.0


class Ticks:
    """The fixed rate of a run.

    rate: Hz. nanoseconds: of one tick. period: of one tick, in s.
    """

    def __init__(self, rate: float) -> None:
        if not LOWEST_RATE <= rate <= HIGHEST_RATE:
            raise UserError(f"rate is {rate:g}; a number >= {LOWEST_RATE:g} and <= {HIGHEST_RATE:g} in Hz is needed")
        self.rate = rate
        self.nanoseconds = round(SECOND / rate)
        self.period = self.nanoseconds / SECOND
