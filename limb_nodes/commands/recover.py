"""`limb recover`: a whole bag of what a killed recorder left, or of a damaged one."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from limb_nodes.bags.recover import Recovered

# So many stretches of lost messages are told of each topic.
MOST_STRETCHES = 4


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the arguments of `limb recover`."""
    parser = subparsers.add_parser(
        "recover",
        help="make a whole bag of one that was not closed or is damaged",
        description="Copy every message that can still be read from a bag whose recorder was killed, or that is "
        "damaged, to a new bag with its index, and say what was lost. The old one stays as it is; nothing in it runs.",
    )
    parser.add_argument("bag", metavar="BAG", help="folder of the bag, or a file of messages in it (.mcap or .db3)")
    parser.add_argument("-o", "--out", required=True, metavar="OUT", help="folder of the new bag, which must not exist")


def run(args: argparse.Namespace) -> int:
    """Recover, and print what the new bag holds and what was lost."""
    from limb_nodes.bags.recover import recover
    from limb_nodes.foundation.text_table import aligned

    recovered = recover(args.bag, args.out)
    topics = sorted({*recovered.counts, *recovered.expected})
    rows = [(topic, messages(recovered.counts.get(topic, 0)), lost_of(recovered, topic)) for topic in topics]
    print("\n".join(aligned(rows)))
    for note in recovered.notes:
        print(f"note: {note}")
    if recovered.left_out:
        left = ", ".join(sorted(recovered.left_out))
        print(f"left out, for their messages are defined in no form of ROS 2 or the definition is lost: {left}")
    if stretch := lost_ticks(recovered):
        print(stretch)
    elif not recovered.truncated and not recovered.left_out:
        print("nothing is lost")
    print(f"bag {recovered.path}, up to {recovered.end_ns * 1e-9:g} s")
    return 0


def messages(count: int) -> str:
    """A number of messages."""
    return f"{count} message{'s' if count != 1 else ''}"


def lost_of(recovered: Recovered, topic: str) -> str:
    """How many messages of a topic are lost, and from when to when; "" if none is known to be."""
    gaps = recovered.lost.get(topic, [])
    count = sum(number for _, _, number in gaps)
    short = recovered.expected.get(topic, 0) - recovered.counts.get(topic, 0)
    if not count and short <= 0:
        return ""
    return f"{max(count, short)} lost" + (f": {stretches(gaps)}" if gaps else "")


def lost_ticks(recovered: Recovered) -> str:
    """The line that says which ticks are lost on one topic or more; "" if none is known to be."""
    gaps = sorted(gap for one in recovered.lost.values() for gap in one)
    together: list[list[int]] = []
    for first, last, _ in gaps:
        if together and first <= together[-1][1] + max(1, recovered.period_ns):
            together[-1][1] = max(last, together[-1][1])
        else:
            together.append([first, last])
    if not together:
        return ""
    period = recovered.period_ns
    seconds = sum(last - first + period for first, last in together) * 1e-9
    ticks = f"{round(seconds * 1e9 / period)} ticks, " if period else ""
    return f"lost on one topic or more: {ticks}{seconds:.6g} s, {stretches(together)}"


def stretches(gaps: Sequence[Sequence[int]]) -> str:
    """Times from when to when messages are lost."""
    shown = [f"{gap[0] * 1e-9:.9g} s" + f" to {gap[1] * 1e-9:.9g} s" * (gap[1] > gap[0]) for gap in gaps]
    more = f" and {len(shown) - MOST_STRETCHES} more" if len(shown) > MOST_STRETCHES else ""
    return ", ".join(shown[:MOST_STRETCHES]) + more
