"""`limb curves`: every characteristic of a limb's laws as a picture."""

from __future__ import annotations

import argparse

from limb_nodes.analysis.curves import characteristics
from limb_nodes.analysis.style import SUFFIXES
from limb_nodes.commands import add_limb, output_file, writing
from limb_nodes.errors import UserError
from limb_nodes.model import load_limb


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the arguments of `limb curves`."""
    parser = subparsers.add_parser(
        "curves",
        help="draw every characteristic of a limb's laws",
        description="Draw the characteristics of a limb's laws with their units: force by velocity, length and "
        "frequency, passive force, recruitment, activation, tendons, paths, moment arms and pennation.",
    )
    add_limb(parser)
    parser.add_argument("-o", "--out", required=True, metavar="FILE.png", help=f"the picture; {', '.join(SUFFIXES)}")


def run(args: argparse.Namespace) -> int:
    """Draw, and say what was drawn."""
    out = output_file("out", args.out)
    limb = load_limb(args.limb, args.allow_laws)
    if not limb.muscles:
        raise UserError(f"{args.limb}: muscles is empty; at least one is needed, for only muscles have characteristics")
    from limb_nodes.analysis.curves.picture import draw_characteristics

    diagrams = characteristics(limb)
    with writing("out"):
        draw_characteristics(diagrams, limb.name, out)
    for diagram in diagrams:
        print(f"{diagram.title}: {', '.join(diagram.laws)}")
    print(f"picture: {out}")
    return 0
