"""What the recorder awaits can be said at any moment, in whatever order the topics come."""

from __future__ import annotations

import itertools
import random
from pathlib import Path

import numpy as np
import pytest

from limb_nodes.exchange.recording import RecordingPart
from limb_nodes.exchange.ticks import Ticks
from limb_nodes.model import load_limb
from tests.exchange.parts import IDENTITY, run_parts

LIMB = load_limb(Path(__file__).resolve().parents[2] / "params" / "reference_joint.yaml")
TICKS = Ticks(100.0)
ACTIVATIONS = np.full((23, 2), 0.9)


@pytest.mark.parametrize("every", [1, 2, 7, 50])
def test_the_first_topic_that_lacks_is_named(every):
    sent, _ = run_parts(LIMB, ACTIVATIONS, TICKS, state_every=every)
    order = random.Random(every)
    for _ in range(20):
        part = RecordingPart(limb=LIMB, ticks=TICKS, identity=IDENTITY)
        part.expect_states({"state_every": every})
        # Each topic in its own order, all topics mixed.
        left = {topic: list(messages) for topic, messages in itertools.groupby(sorted(sent, key=topic_of), topic_of)}
        left = {topic: messages for topic, messages in left.items() if topic in part.streams}
        while left:
            lacking = part.awaited()
            if lacking:
                topic, tick = lacking.split(" of tick ")
                awaited = dict(part.awaited_topics)
                assert topic in awaited
                assert int(tick.split()[0]) == part.complete + 1
                # Of a topic with a message every so many ticks, the tick that has one is the one that lacks.
                assert part.covered(topic, awaited[topic]) == part.complete
            topic = order.choice(sorted(left))
            part.drain(topic, [left[topic].pop(0)[1]])
            if not left[topic]:
                del left[topic]
        assert part.missing() == 0
        assert part.complete >= len(ACTIVATIONS) - 1


def topic_of(message: tuple[str, bytes]) -> str:
    return message[0]
