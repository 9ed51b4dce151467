"""`limb play`: publish a bag's envelopes at their recorded pace."""

from __future__ import annotations

import argparse
import math
import sys
from typing import Any


def add_parser(subparsers: Any) -> None:
    """Declare the command."""
    parser = subparsers.add_parser(
        "play",
        help="publish a bag's envelopes at their recorded pace",
        description="Publish a bag's envelopes on the topic emg_envelope at the pace at which they were recorded, for "
        "nodes that run in real time without a source.",
    )
    parser.add_argument("bag", metavar="BAG", help="a bag, for example of `limb emg`")
    parser.add_argument(
        "--topic", default="emg_envelope", metavar="NAME", help="topic of the bag to play (default emg_envelope)"
    )
    parser.add_argument(
        "--rate-factor",
        dest="pace",
        type=float,
        default=1.0,
        metavar="X",
        help="recorded seconds per second (default 1)",
    )
    parser.add_argument("--loop", action="store_true", help="begin again at the end, until Ctrl-C")
    parser.add_argument(
        "--wait", type=float, default=10.0, metavar="S",
        help="wait so long for a node that listens, then give up; 0 plays at once (default 10)",
    )  # fmt: skip
    parser.add_argument("--namespace", default="", metavar="NS", help="namespace of the nodes that shall listen")


def run(args: argparse.Namespace) -> int:
    """Play, show progress, print a summary."""
    from tqdm import tqdm

    from limb_nodes.nodes.play import TOPIC, play, read_messages

    messages = read_messages(args.bag, args.topic)
    total = math.inf if args.loop else messages.times[-1]
    with tqdm(total=total, unit="s", disable=not sys.stderr.isatty(), leave=False,
              bar_format="{percentage:3.0f}%|{bar}| {n:.1f}/{total:.1f} s") as bar:  # fmt: skip

        def show(reached: float) -> None:
            bar.update(reached - bar.n)

        played = play(
            messages,
            pace=args.pace,
            loop=args.loop,
            wait=args.wait,
            namespace=args.namespace,
            progress=show,
        )
    topic = f"/{args.namespace.strip('/')}/{TOPIC}" if args.namespace else f"/{TOPIC}"
    print(f"messages  {played.messages} of {messages.topic} on {topic}")
    print(f"wall time {played.seconds:.2f} s, the latest message {played.latest * 1e3:.1f} ms late")
    if played.interrupted:
        print("interrupted")
        return 130
    return 0
