"""The graph in lockstep beside a bare ring of rclpy nodes with the same messages."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from functools import partial

from limb_nodes.model.shipped import shipped
from tests.benchmarks.ring import Ring, in_one_process, in_three_processes, recorded
from tests.benchmarks.solving import PRODUCT, missing
from tests.benchmarks.table import Bar, Row
from tests.benchmarks.timing import Spent, alternate, median, ratio

BARE = "bare rclpy ring"


def graph(rounds: int, duration: float) -> Iterator[Row]:
    """Ticks per second of the reference joint with tendons."""
    why = missing("rclpy")
    if why:
        yield Row("graph", BARE, missing=why)
        return
    # A domain of its own: what others on this machine run is not heard.
    os.environ.setdefault("ROS_DOMAIN_ID", str(1 + os.getpid() % 100))
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    limb, ticks = str(shipped("reference_joint_tendon.yaml")), round(1000.0 * duration)
    bare, ours = Ring("bare", limb, ticks), Ring("product", limb, ticks)
    yield from rows(
        "graph, one process",
        {
            BARE: partial(in_one_process, bare),
            PRODUCT: partial(in_one_process, ours),
            f"{PRODUCT}, recorded": partial(recorded, ours),
        },
        {PRODUCT: 0.8, f"{PRODUCT}, recorded": 0.5},
        max(1, rounds // 2),
    )
    yield from rows(
        "graph, three processes",
        {BARE: partial(in_three_processes, bare), PRODUCT: partial(in_three_processes, ours)},
        {PRODUCT: 0.8},
        max(1, rounds // 3),
    )


def rows(work: str, engines: dict[str, Callable[[], Spent]], bars: dict[str, float], rounds: int) -> Iterator[Row]:
    """Rows of some rings. bars: least part of the bare ring's rate."""
    found = alternate(engines, rounds)
    for name, spent in found.items():
        middle, over, rate = median(spent), ratio(spent, found[BARE]), ratio(found[BARE], spent)
        shown = (Bar(f"{name}, part of the bare ring's rate", rate.wall, bars[name]),) if name in bars else ()
        note = "wall and cpu of one tick; x: over the bare ring"
        yield Row(
            work,
            name,
            None,
            middle.wall,
            middle.cpu,
            1.0 / middle.wall,
            "ticks",
            (over.wall, over.cpu),
            note=note,
            bars=shown,
        )
