"""The claim of a namespace: limb_dynamics tells whose it is, since when, and what all nodes of the run must agree on.

Of two runs that claim the same namespace the later one gives way. A node that was started with another limb, rate or
mode than the run in place ends.
"""

from __future__ import annotations

import hashlib
import time

from builtin_interfaces.msg import Time
from limb_msgs.msg import Claim

from limb_nodes.errors import UserError
from limb_nodes.exchange.ticks import SECOND, Ticks
from limb_nodes.model import Limb


def digest(limb: Limb) -> str:
    """The hash of a limb's file and of its own laws, hexadecimal."""
    return hashlib.sha256(f"{limb.text}\0{limb.code.sha256}".encode()).hexdigest()


def new_claim(identity: str, limb: Limb, ticks: Ticks, mode: str, replaces: str = "") -> Claim:
    """A claim of the namespace, made now; replaces: the identity of the run whose nodes are to begin this one."""
    sec, nanosec = divmod(time.time_ns(), SECOND)
    since = Time(sec=sec, nanosec=nanosec)
    return Claim(run=identity, replaces=replaces, since=since, limb=digest(limb), period=ticks.nanoseconds, mode=mode)


def comes_before(one: Claim, other: Claim) -> bool:
    """Whether the first of two claims was made before the second; both runs come to the same answer."""
    first, second = ((claim.since.sec, claim.since.nanosec, claim.run) for claim in (one, other))
    return first < second


def check_claim(claim: Claim, node: str, limb: Limb, ticks: Ticks, mode: str) -> None:
    """Raise UserError if a node cannot be one of the run that has made a claim."""
    where = f"{node}: the run in place, {claim.run[:8]}..., has"
    if claim.mode != mode:
        raise UserError(f"{where} the mode {claim.mode}; the parameter mode is {mode}, and the same is needed")
    if claim.period != ticks.nanoseconds:
        rate = SECOND / claim.period if claim.period > 0 else 0.0
        raise UserError(f"{where} the rate {rate:.9g}; the parameter rate is {ticks.rate:.9g}, and the same is needed")
    if claim.limb != digest(limb):
        raise UserError(f"{where} another limb than {limb.file}; the same file and laws are needed")
