"""`limb simulate`: solve the whole model at once, without ROS."""

from __future__ import annotations

import argparse
import math
import shlex
import sys
import time
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

from limb_nodes.commands import add_limb
from limb_nodes.foundation.parameter import Parameter
from limb_nodes.foundation.text_table import aligned

if TYPE_CHECKING:
    from limb_nodes.analysis.record import MovementBag
    from limb_nodes.model import Limb
    from limb_nodes.solve.ranges import Ranges
    from limb_nodes.solve.whole import Movement


def add_parser(subparsers: Any) -> None:
    """Declare the command."""
    parser = subparsers.add_parser(
        "simulate",
        help="solve a limb as one system of equations, without ROS",
        description="Solve the whole model over an activation and print where the limb ends; --out records a bag.",
    )
    add_limb(parser)
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
    from limb_nodes.model import load_limb
    from limb_nodes.signals.activation import load_activation

    limb = load_limb(args.limb, args.allow_laws)
    if args.tolerance is not None:
        Parameter("tolerance", "1", "relative error per step", minimum=1e-14, maximum=1e-2).check(args.tolerance)
    if args.out:
        refuse_existing(Path(args.out))
    activation = load_activation(args.source, limb.muscle_names, args.rate, args.duration)

    from limb_nodes.solve.failure import SolveError
    from limb_nodes.solve.ranges import Ranges
    from limb_nodes.solve.whole import TOLERANCE, WholeModel

    tolerance = args.tolerance or TOLERANCE
    model = WholeModel(limb, once=True)
    ranges = Ranges(model)
    bag: MovementBag | nullcontext[None] = nullcontext()
    if args.out:
        from limb_nodes.analysis.record import MovementBag
        from limb_nodes.bags.versions import versions

        info = {
            "limb": limb.text,
            "limb_file": limb.file,
            "laws": limb.code.sources,
            "command": shlex.join(["limb", *sys.argv[1:]]),
            "rate": args.rate,
            "period_ns": round(1e9 / args.rate),
            "parameters": {"simulate": {"activation": args.source, "tolerance": tolerance}},
            "versions": versions(),
            "seed": None,
        }
        bag = MovementBag(args.out, limb, len(activation), args.rate, info, ranges)
    summary, failure = Summary(limb, ranges), None
    try:
        with bag as recording:
            for part in summary.over(
                model.simulate_in_parts(activation, args.rate, tolerance=tolerance, observe=bool(args.out))
            ):
                if recording is not None:
                    recording.write(part)
    except SolveError as error:
        # What was solved until then is in the bag, and told.
        failure = error
    for note in activation.notes:
        print(f"note       {note}")
    print("\n".join(summary.lines()))
    if args.out:
        print(f"bag        {args.out}")
    if failure is not None:
        raise failure
    return 0


class Summary:
    """What is told of a movement: how long it took to solve, where its joints went, what does not balance or fit."""

    def __init__(self, limb: Limb, ranges: Ranges) -> None:
        self._limb, self._ranges, joints = limb, ranges, limb.joint_names
        self._seconds = self._end = 0.0
        self._steps = 0
        self._lowest = [math.inf] * len(joints)
        self._highest = [-math.inf] * len(joints)
        self._last = [math.nan] * len(joints)

    def over(self, parts: Iterator[Movement]) -> Iterator[Movement]:
        """The parts of a movement, looked at."""
        begun = time.perf_counter()
        for part in parts:
            self._seconds += time.perf_counter() - begun
            self._end, self._steps = float(part.time[-1]), part.steps[0]
            self._lowest = [min(pair) for pair in zip(self._lowest, part.angle.min(axis=0).tolist(), strict=True)]
            self._highest = [max(pair) for pair in zip(self._highest, part.angle.max(axis=0).tolist(), strict=True)]
            self._last = part.angle[-1].tolist()
            self._ranges.look_at(part)
            yield part
            begun = time.perf_counter()

    def lines(self) -> list[str]:
        """The lines for a person."""
        from limb_nodes.model.path_remarks import unequal_work

        rows = [("joint", "lowest", "highest", "at the end", "degrees")]
        for joint, *angles in zip(self._limb.joint_names, self._lowest, self._highest, self._last, strict=True):
            lowest, highest, last = map(math.degrees, angles)
            rows.append((joint, f"{lowest:.3f}", f"{highest:.3f}", f"{last:.4f}", ""))
        solved = f"solved     {self._end:g} s in {self._seconds:.3g} s, {self._steps} steps"
        left = [f"range      {length} {told}" for length, told in self._ranges.told().items()]
        work = [f"work       {told}"] if (told := unequal_work(self._limb)) else []
        return [solved, *aligned(rows, "lrrr"), *work, *left]
