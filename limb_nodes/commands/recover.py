"""`limb recover`: a readable bag of what a killed recorder left."""

from __future__ import annotations

import argparse


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the arguments of `limb recover`."""
    parser = subparsers.add_parser(
        "recover",
        help="make a readable bag of one that was not closed",
        description="Copy every message that can still be read from a bag whose recorder was killed, or that is "
        "damaged, to a new bag. The old one stays as it is.",
    )
    parser.add_argument("bag", metavar="BAG", help="folder of the bag, or the .mcap file in it")
    parser.add_argument("-o", "--out", required=True, metavar="OUT", help="folder of the new bag, which must not exist")


def run(args: argparse.Namespace) -> int:
    """Recover, and print what the new bag holds."""
    from limb_nodes.bags.recover import recover
    from limb_nodes.foundation.text_table import aligned

    recovered = recover(args.bag, args.out)
    rows = [(topic, f"{count} message{'s' if count != 1 else ''}") for topic, count in sorted(recovered.counts.items())]
    print("\n".join(aligned(rows)))
    if recovered.truncated:
        print("the file is damaged or ends within a record; what came after that place is lost")
    if recovered.left_out:
        topics = ", ".join(sorted(recovered.left_out))
        print(f"left out, for their messages are defined in no form of ROS 2 or the definition is damaged: {topics}")
    if not recovered.truncated and not recovered.left_out:
        print("nothing is lost")
    print(f"bag {recovered.path}, up to {recovered.end_ns * 1e-9:g} s")
    return 0
