"""`limb plot`: a bag as a picture."""

from __future__ import annotations

import argparse
from pathlib import Path

from limb_nodes.errors import UserError


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
    parser.add_argument("--namespace", default="", metavar="NS", help="of the limb, where the bag holds several")
    parser.add_argument("--dpi", type=float, default=150.0, help="dots per inch of a .png (default 150)")


def run(args: argparse.Namespace) -> int:
    """Draw, and say where the picture is."""
    from limb_nodes.analysis.plot.picture import LARGEST_DPI, SUFFIXES, picture, save
    from limb_nodes.analysis.plot.series import read_run

    out = Path(args.out)
    if out.suffix.lower() not in SUFFIXES:
        raise UserError(f"--out {out}: must end in {', '.join(SUFFIXES)}")
    if not 10 <= args.dpi <= LARGEST_DPI:
        raise UserError(f"--dpi {args.dpi:g}: must be a number from 10 to {LARGEST_DPI}")
    if out.is_dir() or (out.exists() and not args.force):
        raise UserError(f"--out {out}: exists already; give another name, or --force to overwrite a picture")
    if not out.parent.is_dir():
        raise UserError(f"--out {out}: no folder {out.parent}; must be in a folder that exists")
    found = read_run(args.bag, namespace=args.namespace, start=args.start, end=args.end, reference=args.reference)
    save(picture(found), out, args.dpi)
    for note in found.notes:
        print(f"note: {note}")
    print(f"picture  {out} ({found.start:g} to {found.end:g} s)")
    return 0
