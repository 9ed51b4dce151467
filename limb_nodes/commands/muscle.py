"""`limb muscle`: one muscle of a limb on the bench, its length and activation prescribed."""

from __future__ import annotations

import argparse
import json
import math
from pathlib import Path
from typing import TYPE_CHECKING

from limb_nodes.errors import UserError

if TYPE_CHECKING:
    from limb_nodes.signals.activation import Activation
    from limb_nodes.solve.bench import Course, MuscleBench

PICTURES = (".png", ".pdf", ".svg")


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the command."""
    parser = subparsers.add_parser(
        "muscle",
        help="one muscle on the bench: prescribed length and activation, force out",
        description="Take a muscle off its limb, prescribe the length from its origin to its insertion and its "
        "activation, and show its force, fibre and tendon length, pennation and the frequencies of its motor units.",
    )
    parser.add_argument("limb", metavar="LIMB.yaml", help="the limb")
    parser.add_argument("muscle", metavar="MUSCLE", help="the muscle's name")
    length = parser.add_mutually_exclusive_group()
    length.add_argument(
        "--isometric",
        type=float,
        metavar="M",
        help="hold this length, m (default: fibres at their optimal length, tendon just slack)",
    )
    length.add_argument(
        "--ramp",
        type=float,
        nargs=4,
        metavar=("FROM", "TO", "START", "END"),
        help="from one length to another, m, between two times, s",
    )
    length.add_argument(
        "--isokinetic",
        type=float,
        nargs=4,
        metavar=("FROM", "TO", "SPEED", "START"),
        help="from one length to another, m, at a constant speed, m/s, from a time on, s",
    )
    length.add_argument(
        "--lengths", metavar="FILE", help="follow a file with the columns time [s] and length [m], along a smooth curve"
    )
    parser.add_argument("--straight", action="store_true", help="follow --lengths along straight lines")
    parser.add_argument(
        "--activation",
        default="1",
        metavar="SOURCE",
        help="a number, or as for limb simulate: envelope bag, CSV, waveform YAML, constants (default 1)",
    )
    parser.add_argument("--duration", type=float, metavar="S", help="s (default: to the end of what is prescribed)")
    parser.add_argument("--rate", type=float, default=1000.0, metavar="HZ", help="samples per second (default 1000)")
    parser.add_argument(
        "--initial",
        choices=("rest", "steady", "file"),
        default="rest",
        help="held at the first length before, without activation (rest, default) or with the first activation "
        "(steady); or the states of the limb's file",
    )
    parser.add_argument("-o", "--out", metavar="FILE.png", help=f"draw it; {', '.join(PICTURES)}")
    parser.add_argument("--csv", metavar="FILE.csv", help="write every output at every time")
    parser.add_argument("--json", action="store_true", help="print the summary as JSON, in SI units")


def run(args: argparse.Namespace) -> int:
    """Solve, draw, write, print a summary."""
    picture, table = checked_output("--out", args.out, PICTURES), checked_output("--csv", args.csv, (".csv",))
    if not (math.isfinite(args.rate) and args.rate > 0.0):
        raise UserError(f"--rate is {args.rate:g}; a number > 0 in Hz is needed")
    if args.straight and not args.lengths:
        raise UserError("--straight: goes with --lengths FILE")

    from limb_nodes.model import load_limb
    from limb_nodes.solve.bench import MuscleBench

    limb = load_limb(args.limb)
    bench = MuscleBench(limb, args.muscle)
    course = course_of(args, bench)
    activation = activation_of(args, bench, course)
    time = course.times(args.rate, activation.duration)
    length, rate = course.at(time)

    import numpy as np

    regular = np.arange(len(activation.values)) / args.rate
    excitation = np.interp(time, regular, activation.values[:, 0])
    record = bench.run(time, length, excitation, rate, initial=args.initial)

    from limb_nodes.analysis.bench_table import plain, text, write_csv

    try:
        if picture:
            from limb_nodes.analysis.bench_picture import draw

            draw(record, f"{args.muscle} of {limb.name} on the bench", picture)
        if table:
            write_csv(record, table)
    except OSError as problem:
        raise UserError(f"{problem.filename}: cannot be written: {problem.strerror or problem}") from None
    if args.json:
        head = {"limb": limb.name, "limb_file": limb.file, "muscle": args.muscle, "notes": list(activation.notes)}
        print(json.dumps({**head, **plain(record)}, indent=1))
        return 0
    print(f"{args.muscle} of {limb.name}, {activation.duration:g} s")
    for note in activation.notes:
        print(f"note: {note}")
    print(text(record))
    for name, path in (("picture", picture), ("table", table)):
        if path:
            print(f"{name}: {path}")
    return 0


def checked_output(option: str, name: str | None, endings: tuple[str, ...]) -> Path | None:
    """The path of a file to write; UserError where it cannot be one."""
    if name is None:
        return None
    path = Path(name)
    if path.suffix.lower() not in endings:
        raise UserError(f"{option} {name}: the name must end in {', '.join(endings)}")
    if not path.parent.is_dir():
        raise UserError(f"{option} {name}: there is no folder {path.parent}")
    return path


def course_of(args: argparse.Namespace, bench: MuscleBench) -> Course:
    """The muscle-tendon length that was asked for."""
    import numpy as np

    from limb_nodes.signals.length_course import read_length_course
    from limb_nodes.solve.bench import Course, isokinetic, isometric, ramp

    if args.lengths:
        time, length = read_length_course(args.lengths)
        return Course(time, length, smooth=not args.straight)
    for option in ("isometric", "ramp", "isokinetic"):
        given = getattr(args, option)
        if given is None:
            continue
        numbers = np.atleast_1d(given)
        named = [("length", numbers[:1])] if option == "isometric" else [("length", numbers[:2])]
        if option == "isokinetic":
            named.append(("speed", numbers[2:3]))
        for what, values in named:
            for value in values:
                if not (math.isfinite(value) and value > 0.0):
                    raise UserError(f"--{option}: {what} {value:g}; a number > 0 is needed")
        if option == "isometric":
            return isometric(given)
        start = given[3] if option == "isokinetic" else given[2]
        if not (math.isfinite(start) and start >= 0.0):
            raise UserError(f"--{option}: start {start:g}; a number >= 0 in s is needed")
        if option == "ramp":
            if not (math.isfinite(given[3]) and given[3] > start):
                raise UserError(f"--ramp: end {given[3]:g}; a number > the start ({start:g}) in s is needed")
            return ramp(*given)
        if given[0] == given[1]:
            raise UserError(f"--isokinetic: both lengths are {given[0]:g}; two different lengths in m are needed")
        return isokinetic(*given)
    return isometric(bench.optimal_length())


def activation_of(args: argparse.Namespace, bench: MuscleBench, course: Course) -> Activation:
    """The muscle's activation over the duration that was asked for, or over all that is prescribed."""
    from limb_nodes.signals.activation import load_activation

    source, name = args.activation, bench.muscle.name
    try:
        number = float(source)
    except ValueError:
        pass
    else:
        if not 0.0 <= number <= 1.0:
            raise UserError(f"--activation {source}: a number in [0, 1] is needed")
        source = f"{name}={source}"
    duration = args.duration
    if duration is None and len(course.time) > 1:
        # The source of activations is asked for a whole number of samples.
        duration = max(1, math.ceil(course.time[-1] * args.rate - 1e-6)) / args.rate
    if duration is None and "=" in source:
        duration = max(1, round(args.rate)) / args.rate
    return load_activation(source, [name], args.rate, duration)
