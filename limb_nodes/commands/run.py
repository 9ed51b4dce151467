"""`limb run`: a limb as a graph of ROS 2 nodes, recorded to a bag."""

from __future__ import annotations

import argparse
import os
import shlex
import sys
from typing import Any

from limb_nodes.commands import add_limb
from limb_nodes.errors import FieldError, RunError

# Exit status of a run whose live source never came, or was silent at its end.
INPUT_LOST = 3


def add_parser(subparsers: Any) -> None:
    """Declare the command."""
    parser = subparsers.add_parser(
        "run",
        help="run a limb as ROS 2 nodes and record it",
        description="Run activation_input, muscle_stack, limb_dynamics and recorder until the activation ends. "
        "Exit status 3 if a live source never came or was silent at the end; 1 if the run could not be finished, or if "
        "somebody else published in its name.",
    )
    add_limb(parser, default="that of --resume")
    parser.add_argument(
        "--activation",
        dest="source",
        default="",
        metavar="SOURCE",
        help="envelope bag, CSV, waveform YAML or constants (flexor=0.9,extensor=0); without it, in real time, "
        "live from the topic emg_envelope, or emg with --emg-rate",
    )
    parser.add_argument("--duration", type=float, default=None, metavar="S", help="s (default: the whole recording)")
    parser.add_argument("--rate", type=float, default=1000.0, metavar="HZ", help="ticks per second (default 1000)")
    parser.add_argument("--out", required=True, metavar="DIR", help="folder of the bag, which must not exist")
    parser.add_argument("--mode", choices=("lockstep", "realtime"), default="lockstep", help="(default lockstep)")
    parser.add_argument("--processes", action="store_true", help="each node in a process of its own")
    parser.add_argument(
        "--resume", default="", metavar="BAG",
        help="go on behind the last tick of a lockstep run that was cut short, with its settings; DIR gets all of it",
    )  # fmt: skip
    parser.add_argument("--respawn", action="store_true", help="start a node that was killed anew (with --processes)")
    parser.add_argument(
        "--stall-limit", type=float, default=None, metavar="S", help="end if no tick comes for so long (default 30)"
    )
    parser.add_argument("--namespace", default="", metavar="NS", help="namespace of all nodes, for several limbs")
    parser.add_argument("--state-every", type=int, default=1, metavar="N", help="record states every N ticks")
    parser.add_argument("--no-states", action="store_true", help="do not record muscle, unit and sarcomere states")
    live = parser.add_argument_group("live input")
    live.add_argument(
        "--channels", action="append", default=[], metavar="CHANNEL=MUSCLE",
        help="the source's name of a muscle; repeatable; for raw EMG all channels in the order of the values, CHANNEL "
        "alone for one that is not used (default: the muscles)",
    )  # fmt: skip
    live.add_argument(
        "--on-silence", choices=("zero", "hold", "stop"), default="zero",
        help="if a source is silent, make its activations zero, hold the last ones, or stop the run; one that never "
        "came has 10 s to come (default zero)",
    )  # fmt: skip
    live.add_argument(
        "--silence", type=float, default=0.5, metavar="S", help="a source is silent after so long (default 0.5)"
    )
    live.add_argument(
        "--emg-rate", type=float, default=0.0, metavar="HZ",
        help="samples per second of raw EMG on the topic emg, filtered as by `limb emg --causal` (default: envelopes)",
    )  # fmt: skip
    live.add_argument(
        "--maximum", action="append", default=[], metavar="CHANNEL=VALUE",
        help="envelope of the raw EMG that becomes 1, in its unit; repeatable",
    )  # fmt: skip
    live.add_argument("--mains", type=float, default=0.0, metavar="HZ", help="notch, 50 or 60 (default: none)")
    live.add_argument(
        "--band-pass", dest="band", default="20,450", metavar="LOW,HIGH", help="edges in Hz (default 20,450)"
    )
    live.add_argument("--low-pass", type=float, default=6.0, metavar="HZ", help="corner (default 6)")


def run(args: argparse.Namespace) -> int:
    """Run, show progress, print a summary."""
    from tqdm import tqdm

    from limb_nodes.exchange.watch import STALL_LIMIT
    from limb_nodes.foundation.parameter import Parameter
    from limb_nodes.foundation.topics import STATES
    from limb_nodes.nodes.live_settings import LiveSettings
    from limb_nodes.nodes.resuming import resumed
    from limb_nodes.nodes.session import run_in_one_process, run_in_processes
    from limb_nodes.nodes.settings import RunSettings, checked

    if args.duration is not None:
        Parameter("duration", "s", "simulated time", above=0.0).check(args.duration)
    Parameter("state_every", "1", "ticks", minimum=1, maximum=1e6, integer=True).check(args.state_every)
    settings = RunSettings(
        limb=args.limb,
        allow_laws=args.allow_laws,
        source=args.source,
        rate=args.rate,
        duration=args.duration or 0.0,
        out=args.out,
        mode=args.mode,
        namespace=args.namespace,
        states=() if args.no_states else STATES,
        state_every=args.state_every,
        command=shlex.join(["limb", *sys.argv[1:]]),
        stall_limit=STALL_LIMIT if args.stall_limit is None else args.stall_limit,
        respawn=args.respawn,
        live=LiveSettings(
            channels=",".join(args.channels),
            on_silence=args.on_silence,
            silence=args.silence,
            emg_rate=args.emg_rate,
            maximum=",".join(args.maximum),
            mains=args.mains,
            band=args.band,
            low_pass=args.low_pass,
        ),
    )
    if args.resume:
        settings = resumed(settings, args.resume)
    if args.respawn and not args.processes:
        raise FieldError("respawn", "is given; --processes is needed with it, for one process is killed as a whole")
    ready, final = checked(settings)
    with tqdm(
        total=None if final is None else final + 1, unit="tick", disable=not sys.stderr.isatty(), leave=False
    ) as bar:

        def show(tick: int) -> None:
            bar.update(max(0, tick + 1 - bar.n))

        try:
            outcome = (run_in_processes if args.processes else run_in_one_process)(ready, show)
        except RunError as error:
            raise RunError(f"{error}{what_is_kept(ready.out)}") from None
    if outcome.interrupted and not os.path.exists(ready.out):
        print("interrupted before anything was recorded")
        return 130
    seconds = (outcome.ticks - 1) / ready.rate if outcome.ticks else 0.0
    print(f"ticks      {outcome.ticks} at {ready.rate:g} Hz ({seconds:g} s)")
    print(f"missing    {outcome.missing}")
    if ready.mode == "realtime":
        print(f"deadlines  {outcome.missed} missed")
    if outcome.bad_input:
        print(f"bad input  {outcome.bad_input} messages kept out")
    if outcome.foreign:
        print(f"strangers  {outcome.foreign} messages of others kept out")
    if outcome.conflicts:
        print(f"doubtful   {outcome.conflicts} ticks came twice with different values: another publishes for this run")
    if outcome.work:
        print(f"work       {outcome.work}")
    for length, told in outcome.ranges.items():
        print(f"range      {length} {told}")
    if outcome.live:
        print(f"live input {outcome.live}")
    print(f"wall time  {outcome.seconds:.2f} s ({seconds / max(outcome.seconds, 1e-9):.3g} simulated s per s)")
    print(f"bag        {args.out}")
    if outcome.interrupted:
        print("interrupted; the bag holds what was recorded until then")
        return 130
    if outcome.conflicts:
        return 1
    return INPUT_LOST if outcome.lost else 0


def what_is_kept(out: str) -> str:
    """In words, what is there of a run that could not be finished."""
    if not os.path.exists(out):
        return ""
    if os.path.exists(os.path.join(out, "metadata.yaml")):
        return f"; {out} holds what was recorded until then"
    return f"; `limb recover {out}` makes a readable bag of what was recorded until then"
