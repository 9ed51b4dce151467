"""`limb muscle`: one muscle of a limb on the bench, its length and activation prescribed."""

from __future__ import annotations

import argparse
import json
import math
from typing import TYPE_CHECKING

from limb_nodes.analysis.style import SUFFIXES
from limb_nodes.commands import add_limb, output_file, writing
from limb_nodes.errors import FieldError
from limb_nodes.foundation.parameter import Parameter

if TYPE_CHECKING:
    from limb_nodes.signals.activation import Activation
    from limb_nodes.solve.bench import Course, MuscleBench


LENGTH = Parameter("length", "m", "from the muscle's origin to its insertion", above=0.0)
SPEED = Parameter("speed", "m/s", "of both ways, towards the second length", above=0.0)
START = Parameter("start", "s", "when the length begins to change", minimum=0.0)


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the command."""
    parser = subparsers.add_parser(
        "muscle",
        help="one muscle on the bench: prescribed length and activation, force out",
        description="Take a muscle off its limb, prescribe the length from its origin to its insertion and its "
        "activation, and show its force, fibre and tendon length, pennation and the frequencies of its motor units.",
    )
    add_limb(parser)
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
        dest="source",
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
    parser.add_argument("-o", "--out", metavar="FILE.png", help=f"draw it; {', '.join(SUFFIXES)}")
    parser.add_argument("--csv", metavar="FILE.csv", help="write every output at every time")
    parser.add_argument("--json", action="store_true", help="print the summary as JSON, in SI units")


def run(args: argparse.Namespace) -> int:
    """Solve, draw, write, print a summary."""
    picture = output_file("out", args.out) if args.out else None
    table = output_file("csv", args.csv, (".csv",)) if args.csv else None
    Parameter("rate", "Hz", "samples per second", above=0.0).check(args.rate)
    if args.straight and not args.lengths:
        raise FieldError("lengths", "is missing; the file that is to be followed straight is needed")

    from limb_nodes.model import load_limb
    from limb_nodes.solve.bench import MuscleBench

    limb = load_limb(args.limb, args.allow_laws)
    bench = MuscleBench(limb, args.muscle)
    course = course_of(args, bench)
    activation = activation_of(args, bench, course)
    time = course.times(args.rate, activation.duration)
    length, rate = course.at(time)

    import numpy as np

    regular = np.arange(len(activation.values)) / args.rate
    excitation = np.interp(time, regular, activation.values[:, 0])
    record = bench.run(time, length, excitation, rate, initial=args.initial)

    from limb_nodes.analysis.bench_table import summary_data, summary_text, write_csv

    if picture:
        from limb_nodes.analysis.bench_picture import draw_bench

        with writing("out"):
            draw_bench(record, f"{args.muscle} of {limb.name} on the bench", picture)
    if table:
        with writing("csv"):
            write_csv(record, table)
    if args.json:
        head = {"limb": limb.name, "limb_file": limb.file, "muscle": args.muscle, "notes": list(activation.notes)}
        print(json.dumps({**head, **summary_data(record)}, indent=1))
        return 0
    print(f"{args.muscle} of {limb.name}, {activation.duration:g} s")
    for note in activation.notes:
        print(f"note: {note}")
    print(summary_text(record))
    for name, path in (("picture", picture), ("table", table)):
        if path:
            print(f"{name}: {path}")
    return 0


def course_of(args: argparse.Namespace, bench: MuscleBench) -> Course:
    """The muscle-tendon length that was asked for."""
    from limb_nodes.signals.length_course import read_length_course
    from limb_nodes.solve.bench import Course, isokinetic, isometric, ramp

    if args.lengths:
        time, length = read_length_course(args.lengths)
        return Course(time, length, smooth=not args.straight)
    if args.isometric is not None:
        check("isometric", LENGTH, args.isometric)
        return isometric(args.isometric)
    if args.ramp:
        begin, end = args.ramp[2:]
        check("ramp", LENGTH, *args.ramp[:2])
        check("ramp", START, begin)
        check("ramp", Parameter("end", "s", "end of the ramp", above=begin), end)
        return ramp(*args.ramp)
    if args.isokinetic:
        first, last, speed, begin = args.isokinetic
        check("isokinetic", LENGTH, first, last)
        check("isokinetic", SPEED, speed)
        check("isokinetic", START, begin)
        if first == last:
            raise FieldError("isokinetic", f"lengths are both {first:g}; two different lengths in m are needed")
        return isokinetic(*args.isokinetic)
    return isometric(bench.optimal_length())


def check(option: str, parameter: Parameter, *values: float) -> None:
    """Raise FieldError if one of the numbers that an option takes is out of range."""
    for value in values:
        if not parameter.accepts(value):
            raise FieldError(option, f"{parameter.name} is {value:g}; {parameter.allowed()} is needed")


def activation_of(args: argparse.Namespace, bench: MuscleBench, course: Course) -> Activation:
    """The muscle's activation over the duration that was asked for, or over all that is prescribed."""
    from limb_nodes.signals.activation import load_activation

    source, name = args.source, bench.muscle.name
    try:
        number = float(source)
    except ValueError:
        pass
    else:
        if not 0.0 <= number <= 1.0:
            raise FieldError("source", f"is {source}; a number in [0, 1] is needed")
        source = f"{name}={source}"
    duration = args.duration
    if duration is None and len(course.time) > 1:
        # The source of activations is asked for a whole number of samples.
        duration = max(1, math.ceil(course.time[-1] * args.rate - 1e-6)) / args.rate
    if duration is None and "=" in source:
        duration = max(1, round(args.rate)) / args.rate
    return load_activation(source, [name], args.rate, duration)
