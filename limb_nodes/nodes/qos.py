"""Qualities of service of the topics."""

from __future__ import annotations

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from limb_nodes.exchange.past import CHECKPOINTS
from limb_nodes.exchange.stream import CHECKPOINT, HISTORY

STREAM = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=HISTORY,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
# As STREAM, for checkpoints: those of the same ticks. Fast DDS tells readers with each message what was before it only
# once its history is full; until then a message that was lost is missed after up to 3 s.
SPARSE = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=HISTORY // CHECKPOINT,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
LATCHED = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=1,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
LIVE = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=10,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.VOLATILE,
)
# As LIVE, for those who want every message: they may fall behind for a while.
EVERY = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=HISTORY,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.VOLATILE,
)
# As EVERY, for sources that offer no more; it hears reliable ones too.
BEST_EFFORT = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=HISTORY,
    reliability=ReliabilityPolicy.BEST_EFFORT,
    durability=DurabilityPolicy.VOLATILE,
)


def stream_of(topic: str) -> QoSProfile:
    """That of a topic of a run."""
    return SPARSE if topic in CHECKPOINTS else STREAM
