"""`limb simulate`: solve the whole model at once, without ROS."""

from __future__ import annotations

import argparse
import math
import shlex
import sys
import time
from pathlib import Path
from typing import Any

from limb_nodes.foundation.parameter import Parameter
from limb_nodes.foundation.text_table import aligned


def add_parser(subparsers: Any) -> None:
    """Declare the command."""
    parser = subparsers.add_parser(
        "simulate",
        help="solve a limb as one system of equations, without ROS",
        description="Solve the whole model over an activation and print where the limb ends; --out records a bag.",
    )
    parser.add_argument("limb", metavar="LIMB.yaml", help="the limb")
    parser.add_argument(
        "--activation",
        dest="source",
        required=True,
        metavar="SOURCE",
        help="envelope bag, CSV, waveform YAML or constants (flexor=0.9,extensor=0)",
    )
    parser.add_argument("--duration", type=float, default=None, metavar="S", help="s (default: the whole recording)")
    parser.add_argument("--rate", type=float, default=1000.0, metavar="HZ", help="samples per second (default 1000)")
    parser.add_argument("--tolerance", type=float, default=None, metavar="T", help="relative error per step")
    parser.add_argument("--out", metavar="DIR", help="write a bag with the topics of a run; DIR must not exist")


def run(args: argparse.Namespace) -> int:
    """Solve, record, print a summary."""
    from limb_nodes.bags.folder import refuse_existing
    from limb_nodes.model import load_limb, user_sources
    from limb_nodes.signals.activation import load_activation

    limb = load_limb(args.limb)
    if args.tolerance is not None:
        Parameter("tolerance", "1", "relative error per step", minimum=1e-14, maximum=1e-2).check(args.tolerance)
    if args.out:
        refuse_existing(Path(args.out))
    activation = load_activation(args.source, limb.muscle_names, args.rate, args.duration)

    from limb_nodes.solve.whole import TOLERANCE, WholeModel

    model = WholeModel(limb, once=True)
    begun = time.perf_counter()
    movement = model.simulate(
        activation.values, args.rate, tolerance=args.tolerance or TOLERANCE, observe=bool(args.out)
    )
    seconds = time.perf_counter() - begun
    for note in activation.notes:
        print(f"note       {note}")
    print(f"solved     {activation.duration:g} s in {seconds:.3g} s, {movement.steps[0]} steps")
    rows = [("joint", "lowest", "highest", "at the end", "degrees")]
    for index, joint in enumerate(limb.joint_names):
        angle = [math.degrees(value) for value in movement.angle[:, index]]
        rows.append((joint, f"{min(angle):.3f}", f"{max(angle):.3f}", f"{angle[-1]:.4f}", ""))
    print("\n".join(aligned(rows, "lrrr")))
    if args.out:
        from limb_nodes.analysis.record import write_movement
        from limb_nodes.bags.versions import versions

        info = {
            "limb": limb.text,
            "limb_file": limb.file,
            "laws": user_sources(limb),
            "command": shlex.join(["limb", *sys.argv[1:]]),
            "rate": args.rate,
            "parameters": {"simulate": {"activation": args.source, "tolerance": args.tolerance or TOLERANCE}},
            "versions": versions(),
            "seed": None,
        }
        write_movement(args.out, model, movement, args.rate, info)
        print(f"bag        {args.out}")
    return 0
