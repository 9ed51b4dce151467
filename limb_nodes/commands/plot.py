"""`limb plot`: a bag as a picture."""

from __future__ import annotations

import argparse

from limb_nodes.commands import output_file
from limb_nodes.errors import FieldError
from limb_nodes.foundation.parameter import Parameter


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the arguments of `limb plot`."""
    parser = subparsers.add_parser(
        "plot",
        help="draw what a bag holds",
        description="Draw a run from its bag alone: activations, frequencies of the motor units, forces, torques, "
        "angles, velocities and lengths over time, and the limb at a few instants. Of a bag of envelopes, the "
        "envelopes and recorded angles.",
    )
    parser.add_argument("bag", metavar="BAG", help="folder of the bag")
    parser.add_argument("-o", "--out", required=True, metavar="FILE", help="picture: .png, .pdf or .svg")
    parser.add_argument("--force", action="store_true", help="overwrite the picture")
    parser.add_argument("--from", dest="start", type=float, metavar="S", help="first time, s (default: the start)")
    parser.add_argument("--to", dest="end", type=float, metavar="S", help="last time, s (default: the end)")
    parser.add_argument(
        "--reference",
        metavar="BAG",
        help="draw the angles recorded in this bag, such as `limb emg` writes, beside the simulated ones",
    )
    parser.add_argument("--namespace", default="", metavar="NS", help="of the limb, if the bag holds several")
    parser.add_argument("--dpi", type=float, default=150.0, help="dots per inch of a .png (default 150)")


def run(args: argparse.Namespace) -> int:
    """Draw, and print the path of the picture."""
    from limb_nodes.analysis.plot.picture import LARGEST_DPI, picture
    from limb_nodes.analysis.plot.series import read_series
    from limb_nodes.analysis.style import save

    out = output_file("out", args.out)
    Parameter("dpi", "1", "dots per inch", minimum=10, maximum=LARGEST_DPI).check(args.dpi)
    if out.is_dir() or (out.exists() and not args.force):
        raise FieldError("out", f"is {out}, which exists already; a new name is needed, or --force")
    series = read_series(args.bag, namespace=args.namespace, start=args.start, end=args.end, reference=args.reference)
    save(picture(series), out, args.dpi)
    for note in series.notes:
        print(f"note: {note}")
    print(f"picture  {out} ({series.start:g} to {series.end:g} s)")
    return 0
