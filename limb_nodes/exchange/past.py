"""What has been recorded of a run, as far as its nodes need it to go on."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from limb_nodes.bags.columns import MessageLayout
from limb_nodes.bags.types import limb_typestore
from limb_nodes.exchange.outgoing import stamp_of
from limb_nodes.exchange.stream import CHECKPOINT
from limb_nodes.foundation.topics import RECORDED, STATES, TOPIC_TYPES

# Nobody waits for them: a lost message of a topic that is rarely sent is missed, and sent again, only after seconds.
CHECKPOINTS = ("muscle_checkpoint", "limb_checkpoint")
# What the ticks behind a checkpoint are made from.
NEEDED = ("activation", "joint_torque", "movement_pattern")


@dataclass
class Past:
    """The last ticks of a run that are recorded.

    complete: the last tick that is there on every topic, -1 if none is. tick: from which a run goes on, the same or the
    one before; the torque depends on the activation of the next tick, which must be there too. Between the checkpoints
    and it no tick has an impact within, whose exchange is not recorded. impacts: how many come before it.
    counts: topic -> messages up to it. messages: topic -> tick -> message, in CDR, from the checkpoints on.
    muscles, limb: the newest checkpoint of muscle_stack and of limb_dynamics, its tick and message; None for the start.
    """

    complete: int = -1
    tick: int = -1
    impacts: int = 0
    counts: dict[str, int] = field(default_factory=dict)
    messages: dict[str, dict[int, bytes]] = field(default_factory=lambda: {topic: {} for topic in NEEDED})
    muscles: tuple[int, bytes] | None = None
    limb: tuple[int, bytes] | None = None


def expected_topics(parameters: Mapping[str, Any]) -> dict[str, int]:
    """Topic of a run -> every how many ticks it has a message; parameters: of muscle_stack."""
    every = parameters.get("state_every", 1)
    states = {topic: every for topic in STATES if parameters.get(f"publish_{topic}", True)}
    ticked = {topic: 1 for topic in RECORDED if topic not in STATES}
    return {**ticked, **states, **dict.fromkeys(CHECKPOINTS, CHECKPOINT)}


def past_of(recorded: Iterable[tuple[str, bytes]], every: Mapping[str, int], nanoseconds: int) -> Past:
    """The past of a run from what is recorded.

    recorded: topic, without its namespace, and message, in the order of their recording; topics that are not in `every`
    are passed over. every: topic -> every how many ticks it has a message. nanoseconds: of one tick. What is behind the
    first gap of a topic is not used. Only so much is kept as is needed to go on.
    """
    past = Past(counts=dict.fromkeys(every, 0))
    checkpoints: dict[str, list[tuple[int, bytes]]] = {topic: [] for topic in CHECKPOINTS}
    for topic, data in recorded:
        if topic not in every or (tick := stamp_of(data) // nanoseconds) != past.counts[topic] * every[topic]:
            continue
        past.counts[topic] += 1
        if topic in NEEDED:
            past.messages[topic][tick] = data
        elif topic in checkpoints:
            checkpoints[topic].append((tick, data))
            drop(past, checkpoints, every)
    past.complete, past.tick = complete(past.counts, every), answered(past.counts, every)
    past.tick, past.impacts = before_impacts(past, checkpoints)
    for topic, step in every.items():
        past.counts[topic] = past.tick // step + 1
    newest = {name: [found for found in some if found[0] <= past.tick][-1:] for name, some in checkpoints.items()}
    past.muscles, past.limb = (next(iter(some), None) for some in newest.values())
    return past


def before_impacts(past: Past, checkpoints: Mapping[str, list[tuple[int, bytes]]]) -> tuple[int, int]:
    """The last tick that follows from checkpoints without an impact within a tick, and how many impacts came before."""
    patterns = past.messages["movement_pattern"]
    if past.tick < 0:
        return past.tick, 0
    layout = MessageLayout(patterns[past.tick], limb_typestore())
    try:
        layout.message(TOPIC_TYPES["movement_pattern"], "")
    except Exception:
        # Of another version, whose bytes mean something else: `Part.take_up` refuses it in words.
        return past.tick, 0
    at, kind, _ = layout.numbers["impacts"]

    def impacts(tick: int) -> int:
        return int(np.frombuffer(patterns[tick], kind, 1, at)[0])

    first = min(([tick for tick, _ in some if tick <= past.tick] or [0])[-1] for some in checkpoints.values())
    tick = past.tick
    while tick > first and impacts(tick) > impacts(first):
        tick -= 1
    return tick, impacts(tick)


def answered(counts: Mapping[str, int], every: Mapping[str, int]) -> int:
    """The newest tick that is there on every topic, with the next activation, on which the torque depends; -1 if none.

    A run that has ended has no next one: its last tick is done again.
    """
    return max(-1, min(complete(counts, every), counts["activation"] - 2))


def complete(counts: Mapping[str, int], every: Mapping[str, int]) -> int:
    """The newest tick that is there on every topic, of so many messages from tick 0 on; -1 if none is."""
    return min(count * every[topic] for topic, count in counts.items() if topic not in CHECKPOINTS) - 1


def drop(past: Past, checkpoints: dict[str, list[tuple[int, bytes]]], every: Mapping[str, int]) -> None:
    """Drop what comes before the checkpoints from which all that is complete follows."""
    tick = answered(past.counts, every)
    for name, some in checkpoints.items():
        old = [found for found in some if found[0] <= tick]
        checkpoints[name] = [*old[-1:], *some[len(old) :]]
    first = min(some[0][0] if some else 0 for some in checkpoints.values())
    for messages in past.messages.values():
        for old_tick in [tick for tick in messages if tick < first]:
            del messages[old_tick]
