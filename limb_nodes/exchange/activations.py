"""The part of activation_input: on limb_state k it sends activation k + 1, and activation 0 before it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from limb_nodes.exchange.part import Part
from limb_nodes.exchange.past import Past
from limb_nodes.foundation.arrays import FloatArray

# How long before the last tick a run that is stopped tells which it is (s).
NOTICE = 0.2


class ActivationPart(Part):
    """Sends the activation of each tick.

    values_at: activations [muscles] of a tick. before: called with each tick of the limb, before it is answered. final:
    the last tick, None while it is not known. sent: the newest tick that is sent. now: the newest of the limb.
    """

    def __init__(self, *given: Any, values_at: Callable[[int], FloatArray], final: int | None, **options: Any) -> None:
        super().__init__(*given, **options)
        self.values_at = values_at
        self.before: Callable[[int], None] = lambda tick: None
        self.sent = -1
        self.now = -1
        self.activation = self.sends("activation")
        self.final = final
        self.tell_final()
        self.takes("limb_state", self.on_limb_state, gaps=self.realtime)

    def tell_final(self) -> None:
        """Let the messages tell the last tick."""
        self.activation.values["last_tick"][...] = -1 if self.final is None else self.final

    def end_soon(self) -> None:
        """Stop the run; the limb may be ahead by some ticks, and all must hear in time which is the last."""
        following = self.now + 2 + round(NOTICE * self.ticks.rate)
        self.final = following if self.final is None else min(self.final, following)
        self.tell_final()

    def on_limb_state(self, tick: int, _: bytes) -> None:
        """Send what this tick and the next one need."""
        self.now, last = tick, tick + 1
        self.before(tick)
        if self.final is not None and last >= self.final:
            last = self.final
            # Only the final tick itself tells that muscle_stack has taken all activations before it.
            self.finished = tick >= self.final
        for following in range(self.sent + 1, last + 1):
            self.activation.values["activation"][:] = self.values_at(following)
            self.activation.publish(following)
        self.sent = max(self.sent, last)

    def go_on_after(self, past: Past) -> None:
        """Send what follows the last tick."""
        self.now = self.sent = past.tick

    @property
    def done(self) -> int:
        """The newest tick of the limb."""
        return self.now

    def awaited(self) -> str:
        """The limb's state at the next tick."""
        return "" if self.finished else f"limb_state of tick {self.now + 1} from limb_dynamics"
