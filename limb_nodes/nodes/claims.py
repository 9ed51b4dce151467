"""The claim of a namespace: on `run_identity` limb_dynamics tells the identity of its run and when it claimed.

Of two runs that claim the same namespace the later one gives way.
"""

from __future__ import annotations

import time

from builtin_interfaces.msg import Time
from std_msgs.msg import Header

from limb_nodes.exchange.ticks import SECOND


def new_claim(identity: str) -> Header:
    """A claim of the namespace, made now."""
    sec, nanosec = divmod(time.time_ns(), SECOND)
    return Header(frame_id=identity, stamp=Time(sec=sec, nanosec=nanosec))


def comes_before(one: Header, other: Header) -> bool:
    """Whether the first of two claims was made before the second; both runs come to the same answer."""
    first, second = ((claim.stamp.sec, claim.stamp.nanosec, claim.frame_id) for claim in (one, other))
    return first < second
