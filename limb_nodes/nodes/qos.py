"""Qualities of service of the topics."""

from __future__ import annotations

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from limb_nodes.exchange.past import EVERY as EVERY_TICKS
from limb_nodes.exchange.stream import HISTORY

STREAM = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=HISTORY,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
# As STREAM, for topics with a message every so many ticks: the same ticks, and those that may be on their way. Fast DDS
# tells readers with each message what was before it only once its history is full; until then a message that was lost
# is missed after up to 3 s.
SPARSE = {
    topic: QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=HISTORY // every,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL,
    )
    for topic, every in EVERY_TICKS.items()
}
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
