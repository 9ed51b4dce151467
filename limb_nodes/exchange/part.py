"""What every node's part in a run has: its identity, the streams that it takes and sends, and what it waits for."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from limb_nodes.errors import UserError
from limb_nodes.exchange.forms import Form, forms_of
from limb_nodes.exchange.identity import bytes_of, identity_of
from limb_nodes.exchange.outgoing import Outgoing, ignore
from limb_nodes.exchange.past import Past
from limb_nodes.exchange.stream import Conflict, Stream
from limb_nodes.exchange.ticks import Ticks
from limb_nodes.model import Limb

Complain = Callable[[str], None]


class Part:
    """A node's part in a run, without ROS.

    Whoever carries the messages hands them to `receive`, and lets `outgoing` send.

    identity: of the run; empty until it is known. finished: whether the part is done. bad_input: messages of the run
    that could not be used. foreign: messages of others. conflicts: ticks that came twice with different values.
    complain: takes what is to be said of messages that are not taken.
    """

    def __init__(self, limb: Limb, ticks: Ticks, identity: str = "", realtime: bool = False) -> None:
        self.limb, self.ticks, self.realtime = limb, ticks, realtime
        self.forms: dict[str, Form] = forms_of(limb, ticks.rate)
        self.identity, self._own = "", b""
        self.outgoing: dict[str, Outgoing] = {}
        self.streams: dict[str, Stream] = {}
        self._handlers: dict[str, Callable[[int, bytes], None]] = {}
        self._former: set[bytes] = set()
        self.finished = False
        self.bad_input = self.foreign = self.conflicts = 0
        self.complain: Complain = lambda what: None
        if identity:
            self.join(identity)

    def join(self, identity: str) -> None:
        """Belong to a run from now on."""
        self.identity, self._own = identity, bytes_of(identity)
        for messages in self.outgoing.values():
            messages.identify(self._own)

    def knows(self, former: Iterable[str]) -> None:
        """Of these runs, which came before, last messages may still come; they are neither taken nor counted."""
        self._former = {bytes_of(identity) for identity in former}

    def sends(self, topic: str) -> Outgoing:
        """The messages that the part sends on a topic."""
        messages = self.outgoing[topic] = Outgoing(self.forms[topic], self.ticks.nanoseconds)
        if self.identity:
            messages.identify(self._own)
        return messages

    def takes(self, topic: str, handler: Callable[[int, bytes], None], gaps: bool) -> None:
        """Let a handler have the messages of a topic, with their ticks, in order; gaps: as for `Stream`."""
        self.streams[topic] = Stream(self.forms[topic], self.ticks.nanoseconds, gaps)
        self._handlers[topic] = handler

    def receive(self, topic: str, data: bytes) -> None:
        """Take a serialised message of a topic, if it is one of the run and its turn."""
        if not self.owns(topic, data):
            return
        try:
            messages = self.streams[topic].take(data)
        except ValueError as problem:
            self.conflicts += isinstance(problem, Conflict)
            self.refuse(f"{topic}: a message {problem}")
            return
        for tick, message in messages:
            self._handlers[topic](tick, message)

    def owns(self, topic: str, data: bytes) -> bool:
        """Whether a serialised message belongs to the run; one without a run joins that of the first message."""
        given = data[self.forms[topic].run]
        if given == self._own:
            return True
        identity = identity_of(given)
        if identity and not self.identity:
            self.join(identity)
            return True
        if given in self._former:
            return False
        self.foreign += 1
        if not identity:
            # Of another run it is enough to know how many: that run is told to give way.
            self.complain(f"{topic}: a message has no identity of a run in its field run")
        return False

    def refuse(self, what: str) -> None:
        """Count a message of the run that cannot be used, and say so."""
        self.bad_input += 1
        self.complain(what)

    def take_up(self, past: Past) -> None:
        """Go on behind the last tick of what has been recorded; before the part receives anything.

        Raises UserError if what is recorded is of another form.
        """
        kept = {topic: next(iter(messages.values()), None) for topic, messages in past.messages.items()}
        checkpoints = {"muscle_checkpoint": past.muscles, "limb_checkpoint": past.limb}
        kept |= {topic: checkpoint and checkpoint[1] for topic, checkpoint in checkpoints.items()}
        for topic, data in kept.items():
            try:
                self.forms[topic].check(data or self.forms[topic].data)
            except ValueError as problem:
                raise UserError(
                    f"the recorded {topic} {problem}; a bag that was recorded by this version is needed"
                ) from None
        for stream in self.streams.values():
            stream.go_on_after(past.tick)
        # What is done again has been sent.
        sends = {topic: messages.send for topic, messages in self.outgoing.items()}
        for messages in self.outgoing.values():
            messages.send = ignore
        self.go_on_after(past)
        for topic, send in sends.items():
            self.outgoing[topic].send = send

    def go_on_after(self, past: Past) -> None:
        """Become what the part was after the last tick of what has been recorded."""
        raise NotImplementedError

    @property
    def done(self) -> int:
        """A number that grows while the part goes on."""
        raise NotImplementedError

    def awaited(self) -> str:
        """What the part cannot go on without, and who sends it; empty if nothing."""
        raise NotImplementedError

    def values(self, topic: str, data: bytes, name: str) -> Any:
        """A field of a message of a topic, as an array that must not be kept."""
        return self.forms[topic].values(data, name)
