"""`limb run`: a limb as a graph of ROS 2 nodes, recorded to a bag."""

from __future__ import annotations

import argparse
import os
import shlex
import sys
from typing import Any


def add_parser(subparsers: Any) -> None:
    """Declare the command."""
    parser = subparsers.add_parser(
        "run",
        help="run a limb as ROS 2 nodes and record it",
        description="Run activation_input, muscle_stack, limb_dynamics and recorder until the activation ends.",
    )
    parser.add_argument("limb", metavar="LIMB.yaml", help="the limb")
    parser.add_argument(
        "--activation",
        dest="source",
        default="",
        metavar="SOURCE",
        help="envelope bag, CSV, waveform YAML or constants (flexor=0.9,extensor=0); without it, in real time, "
        "live from the topic emg_envelope",
    )
    parser.add_argument("--duration", type=float, default=None, metavar="S", help="s (default: the whole recording)")
    parser.add_argument("--rate", type=float, default=1000.0, metavar="HZ", help="ticks per second (default 1000)")
    parser.add_argument("--out", required=True, metavar="DIR", help="folder of the bag, which must not exist")
    parser.add_argument("--mode", choices=("lockstep", "realtime"), default="lockstep", help="(default lockstep)")
    parser.add_argument("--processes", action="store_true", help="each node in a process of its own")
    parser.add_argument("--namespace", default="", metavar="NS", help="namespace of all nodes, for several limbs")
    parser.add_argument("--state-every", type=int, default=1, metavar="N", help="record states every N ticks")
    parser.add_argument("--no-states", action="store_true", help="do not record muscle, unit and sarcomere states")


def run(args: argparse.Namespace) -> int:
    """Run, show progress, print a summary."""
    from tqdm import tqdm

    from limb_nodes.foundation.parameter import Parameter
    from limb_nodes.nodes.base import STATES
    from limb_nodes.nodes.session import run_in_one_process, run_in_processes
    from limb_nodes.nodes.settings import RunSettings, checked

    if args.duration is not None:
        Parameter("duration", "s", "simulated time", above=0.0).check(args.duration)
    Parameter("state_every", "1", "ticks", minimum=1, maximum=1e6, integer=True).check(args.state_every)
    settings = RunSettings(
        limb=args.limb,
        source=args.source,
        rate=args.rate,
        duration=args.duration or 0.0,
        out=args.out,
        mode=args.mode,
        namespace=args.namespace,
        states=() if args.no_states else STATES,
        state_every=args.state_every,
        command=shlex.join(["limb", *sys.argv[1:]]),
    )
    ready, final = checked(settings)
    with tqdm(
        total=None if final is None else final + 1, unit="tick", disable=not sys.stderr.isatty(), leave=False
    ) as bar:

        def show(tick: int) -> None:
            bar.update(max(0, tick + 1 - bar.n))

        outcome = (run_in_processes if args.processes else run_in_one_process)(ready, show)
    if outcome.interrupted and not os.path.exists(ready.out):
        print("interrupted before anything was recorded")
        return 130
    seconds = (outcome.ticks - 1) / args.rate if outcome.ticks else 0.0
    print(f"ticks      {outcome.ticks} at {args.rate:g} Hz ({seconds:g} s)")
    print(f"missing    {outcome.missing}")
    if args.mode == "realtime":
        print(f"deadlines  {outcome.missed} missed")
    if outcome.bad_input:
        print(f"bad input  {outcome.bad_input} messages kept out")
    print(f"wall time  {outcome.seconds:.2f} s ({seconds / max(outcome.seconds, 1e-9):.3g} simulated s per s)")
    print(f"bag        {args.out}")
    if outcome.interrupted:
        print("interrupted; the bag holds what was recorded until then")
        return 130
    return 0
