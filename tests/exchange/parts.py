"""A run of the nodes' parts alone, each message carried at once."""

from __future__ import annotations

from collections import deque

import numpy as np

from limb_nodes.exchange.activations import ActivationPart
from limb_nodes.exchange.movement import LimbPart
from limb_nodes.exchange.muscles import MusclePart
from limb_nodes.exchange.past import Past
from limb_nodes.exchange.ticks import Ticks
from limb_nodes.model.limb import Limb

IDENTITY = "0123456789abcdef" * 2

Message = tuple[str, bytes]


def run_parts(
    limb: Limb, activations: np.ndarray, ticks: Ticks, past: Past | None = None, state_every: int = 1
) -> tuple[list[Message], LimbPart]:
    """The messages of a run, or of what follows a past, in the order in which they are sent; the limb's part.

    activations: [ticks, muscles].
    """
    common = {"limb": limb, "ticks": ticks, "identity": IDENTITY}
    parts = [
        ActivationPart(**common, values_at=lambda tick: activations[tick], final=len(activations) - 1),
        MusclePart(**common, state_every=state_every),
        dynamics := LimbPart(**common),
    ]
    sent: list[Message] = []
    waiting: deque[Message] = deque()
    for part in parts:
        for topic, messages in part.outgoing.items():

            def send(data: bytes, topic: str = topic) -> None:
                sent.append((topic, data))
                waiting.append((topic, data))

            messages.send = send
        if past is not None:
            part.take_up(past)
    dynamics.begin()
    while waiting:
        topic, data = waiting.popleft()
        for part in parts:
            if topic in part.streams:
                part.receive(topic, data)
    assert all(part.finished and not part.awaited() for part in parts)
    assert sum(part.bad_input + part.foreign + part.conflicts for part in parts) == 0
    return sent, dynamics


def cut(messages: list[Message], tick: int) -> list[Message]:
    """The messages until that with which the torque of a tick would come."""
    torques = [k for k, (topic, _) in enumerate(messages) if topic == "joint_torque"]
    return messages[: torques[tick]]
