"""A topic of a run as a node receives it: each tick once, in order."""

from __future__ import annotations

from limb_nodes.exchange.forms import Form
from limb_nodes.exchange.outgoing import stamp_of

# How many ticks the limb may be ahead of the recorder, and how many each topic keeps: what the
# recorder has not taken yet is still there, and a node that starts late gets the first ticks too.
RECORDER_LAG = 256
HISTORY = 2 * RECORDER_LAG

# Every so many ticks the nodes send all that they have to remember.
CHECKPOINT = RECORDER_LAG // 2

Message = tuple[int, bytes]
NOTHING: Message = (-1, b"")


class Conflict(ValueError):
    """A tick has come twice, with different numbers, or too late: somebody else publishes in the name of the run."""


class Stream:
    """What has been taken of a topic.

    form: of its messages. next: the tick that is taken next. every: how many ticks are from one message to the next.
    """

    def __init__(self, form: Form, nanoseconds: int, gaps: bool) -> None:
        """nanoseconds: of one tick. gaps: whether ticks may be missing.

        What is ahead of its turn is lost then, unless the one that follows it comes next: who was away for so long that
        a topic has not kept all for him gets the newest ones one after another, a single one is a mistake.
        """
        self.form = form
        self.next, self.every = 0, 1
        # From here on each tick has been taken, or was passed over.
        self._first = 0
        self._nanoseconds, self._gaps = nanoseconds, gaps
        self._kept: list[Message] = [NOTHING] * HISTORY
        self._ahead = NOTHING

    def take(self, data: bytes) -> tuple[Message, ...]:
        """The messages that are to be taken now: mostly this one.

        Raises ValueError that says what is wrong with the message, Conflict if another one was taken in its place.
        """
        self.form.check(data)
        tick, rest = divmod(stamp_of(data), self._nanoseconds)
        if rest or tick < 0:
            raise ValueError("has a stamp that is no tick of this rate")
        if self.form.tick_of(data, tick) != tick:
            raise ValueError(f"has the stamp of tick {tick} and the number of another")
        if self.form.ends_before(data, tick):
            raise ValueError(f"of tick {tick} tells a last tick that has been")
        if tick == self.next:
            return self._take((tick, data))
        if tick < self.next:
            known = self._kept[tick % HISTORY]
            if known[0] == tick and known[1] != data:
                raise Conflict(f"of tick {tick} has come twice with different values")
            if known[0] < tick and tick >= self._first:
                raise Conflict(f"of tick {tick} has come after others that passed it over")
            return ()
        if self._gaps:
            before, self._ahead = self._ahead, (tick, data)
            if before[0] == tick - self.every:
                return self._take(before, (tick, data))
        raise ValueError(f"is of tick {tick}; that of tick {self.next} is needed next")

    def go_on_after(self, tick: int) -> None:
        """Take next what follows a tick."""
        self._first = self.next = tick + self.every - tick % self.every

    def _take(self, *messages: Message) -> tuple[Message, ...]:
        ahead, self._ahead = self._ahead, NOTHING
        if ahead[0] == messages[-1][0] + self.every:
            messages += (ahead,)
        for message in messages:
            self._kept[message[0] % HISTORY] = message
        self.next = messages[-1][0] + self.every
        return messages
