"""The part of recorder: it takes every topic of a run, and knows which ticks are there on all of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import partial
from typing import Any

from limb_nodes.exchange.forms import joint_states_form
from limb_nodes.exchange.outgoing import Outgoing
from limb_nodes.exchange.part import Part
from limb_nodes.exchange.past import CHECKPOINTS, Past, expected_topics
from limb_nodes.foundation.topics import RECORDED, SENDERS, STATES


class RecordingPart(Part):
    """Takes each tick of each topic once.

    expected: topic -> every how many ticks it should have a message. counts: topic -> messages taken. last_tick: of the
    run, -1 while it is not known. ready: whether all other nodes are known to be there. unknown: nodes whose parameters
    the bag waits for.
    """

    def __init__(self, *given: Any, **options: Any) -> None:
        super().__init__(*given, **options)
        self.expected = {topic: every for topic, every in expected_topics({}).items() if topic not in STATES}
        self.counts = dict.fromkeys(RECORDED, 0)
        self.last_tick = -1
        self.ready = False
        self.unknown: list[str] = []
        self._new: dict[str, list[tuple[int, bytes]]] = {topic: [] for topic in RECORDED}
        self._joint_states = Outgoing(joint_states_form(self.limb), self.ticks.nanoseconds)
        for topic in RECORDED:
            self.takes(topic, partial(self.on_message, topic), gaps=True)
            self.streams[topic].every = self.expected.get(topic, 1)

    def expect_states(self, parameters: Mapping[str, Any]) -> None:
        """Expect the states that muscle_stack sends with these parameters."""
        self.expected = expected_topics(parameters)
        for topic, every in self.expected.items():
            self.streams[topic].every = every

    def go_on_after(self, past: Past) -> None:
        """Count what has been recorded as taken."""
        for topic, count in past.counts.items():
            self.counts[topic] = count

    def on_message(self, topic: str, tick: int, data: bytes) -> None:
        """Keep a message until it is drained."""
        if 0 <= self.last_tick < tick:
            self.refuse(f"{topic}: a message is of tick {tick}; {self.last_tick} is the last of the run")
            return
        self._new[topic].append((tick * self.ticks.nanoseconds, data))

    def drain(self, topic: str, arrived: Iterable[bytes]) -> list[tuple[int, bytes]]:
        """Take what has arrived on a topic; stamps (ns) and messages of the ticks that are new."""
        for data in arrived:
            self.receive(topic, data)
        new, self._new[topic] = self._new[topic], []
        if new and topic == "joint_torque":
            self.last_tick = self.forms[topic].number(new[-1][1], "last_tick")
        self.counts[topic] += len(new)
        return new

    def joint_states(self, patterns: Iterable[tuple[int, bytes]]) -> list[tuple[int, bytes]]:
        """Stamps (ns) and messages of joint_states, made of those of movement_pattern."""
        made: list[bytes] = []
        messages, given = self._joint_states, partial(self.values, "movement_pattern")
        messages.send = made.append
        stamps = []
        for stamp, data in patterns:
            values = messages.values
            values["position"][:], values["velocity"][:] = given(data, "angle"), given(data, "velocity")
            values["effort"][:] = given(data, "torque") + given(data, "command")
            messages.publish(stamp // self.ticks.nanoseconds)
            stamps.append(stamp)
        return list(zip(stamps, made, strict=True))

    @property
    def ticks_taken(self) -> int:
        """How many ticks the run has made, as far as they are known."""
        return self.newest("movement_pattern") + 1

    def newest(self, topic: str) -> int:
        """The newest tick that is taken of a topic, -1 before the first."""
        stream = self.streams[topic]
        return stream.next - stream.every if self.counts[topic] else -1

    @property
    def complete(self) -> int:
        """The newest tick that is there on every topic, -1 before the first."""
        return min(self.covered(topic, every) for topic, every in self.awaited_topics)

    def covered(self, topic: str, every: int) -> int:
        """The tick up to which a topic with a message every so many ticks is there, -1 before the first."""
        return self.newest(topic) + every - 1 if self.counts[topic] else -1

    @property
    def awaited_topics(self) -> list[tuple[str, int]]:
        """The topics of which each tick is to be there, and every how many ticks they have a message."""
        return [(topic, every) for topic, every in self.expected.items() if topic not in CHECKPOINTS]

    def missing(self) -> int:
        """Ticks that are not there on a topic that should have them."""
        ticks = self.ticks_taken
        return sum(max(0, -(-ticks // every) - self.counts[topic]) for topic, every in self.awaited_topics if ticks)

    @property
    def done(self) -> int:
        """How many ticks are there on every topic, and one more once all nodes are known to be there."""
        return self.complete + 1 + self.ready

    def awaited(self) -> str:
        """What is missing of the next tick."""
        if self.finished:
            return ""
        if self.unknown:
            return f"the parameters of {', '.join(self.unknown)}"
        tick = self.complete + 1
        topic = next(topic for topic, every in self.awaited_topics if self.covered(topic, every) < tick)
        return f"{topic} of tick {tick} from {SENDERS[topic]}"
