"""`limb scale`: the limb of one person as that of another."""

from __future__ import annotations

import argparse
from pathlib import Path

from limb_nodes.commands import add_limb


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the arguments of `limb scale`."""
    parser = subparsers.add_parser(
        "scale",
        help="make of a person's limb that of another person",
        description="Scale a limb whose file names its person: lengths go with the height, masses with the mass, "
        "forces with the mass to the power of 2/3. Comments stay.",
    )
    add_limb(parser)
    parser.add_argument("--mass", type=float, metavar="KG", help="mass of the new person (default: as before)")
    parser.add_argument("--height", type=float, metavar="M", help="height of the new person (default: as before)")
    parser.add_argument("-o", "--out", required=True, metavar="FILE", help="the new limb; FILE must not exist")


def run(args: argparse.Namespace) -> int:
    """Write the scaled limb and say what has changed."""
    from limb_nodes.errors import FieldError
    from limb_nodes.model import load_limb
    from limb_nodes.model.load import parse_limb
    from limb_nodes.model.scale import factors_between, scaled_text

    limb = load_limb(args.limb, args.allow_laws)
    if args.mass is None and args.height is None:
        raise FieldError("mass", "is missing, and height too; one of them or both are needed")
    if Path(args.out).exists():
        raise FieldError("out", f"is {args.out}, which exists; the name of a new file is needed")
    factors = factors_between(limb, args.mass, args.height)
    text = scaled_text(limb, factors)
    # What is written can be read: a joint's range may not fit fibres of another length.
    parse_limb(text, args.out, args.allow_laws)
    try:
        Path(args.out).write_text(text, encoding="utf-8")
    except OSError as problem:
        raise FieldError("out", f"is {args.out}, which cannot be written: {problem.strerror or problem}") from None
    print(f"lengths    times {factors.length:.4g}")
    print(f"masses     times {factors.mass:.4g}")
    print(f"forces     times {factors.force:.4g}")
    print(f"limb       {args.out}")
    return 0
