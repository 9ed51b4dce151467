"""`limb structure`: degrees of freedom, index, structure matrices and blocks of a limb's equations."""

from __future__ import annotations

import argparse
import json
import shutil
import sys

from limb_nodes.analysis.structure import TITLES, analyse
from limb_nodes.analysis.structure.data import structure_data
from limb_nodes.analysis.structure.table import report
from limb_nodes.analysis.style import SUFFIXES
from limb_nodes.commands import add_limb, output_file, writing
from limb_nodes.errors import FieldError
from limb_nodes.model import load_limb

# For terminals without these characters.
PLAIN = str.maketrans({
    "⊗": "O", "×": "x", "·": ".", "→": ">", "α": "alpha", "β": "beta", "θ": "theta", "ω": "omega",
})  # fmt: skip


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the arguments of `limb structure`."""
    parser = subparsers.add_parser(
        "structure",
        help="degrees of freedom, index and structure matrices of a limb's equations",
        description="Count the equations and unknowns of every level of a limb, and find from their structure the "
        "degrees of freedom, the differential index, and which equations must be solved together. Exit status 1 if "
        "what is solved (all but the original form of the limb) is singular or has an index above 1.",
    )
    add_limb(parser)
    parser.add_argument("--level", choices=list(TITLES), help="this level only, with its whole matrix")
    parser.add_argument("--json", action="store_true", help="print JSON; docs/structure.md lists its keys")
    parser.add_argument("-o", "--out", metavar="FILE.png", help=f"draw the matrices; {', '.join(SUFFIXES)}")


def run(args: argparse.Namespace) -> int:
    """Print and draw; 1 if what is solved cannot be solved as it stands."""
    out = output_file("out", args.out) if args.out else None
    limb = load_limb(args.limb, args.allow_laws)
    findings = analyse(limb, args.level)
    if not findings:
        raise FieldError("level", f"is {args.level}; a level that a muscle of this limb has is needed", args.limb)
    if out:
        from limb_nodes.analysis.structure.picture import draw_structure

        with writing("out"):
            draw_structure(findings, limb.name, out)
    if args.json:
        text = json.dumps(structure_data(findings, limb.name, args.limb), indent=1)
    else:
        text = report(findings, limb.name, max(60, shutil.get_terminal_size((110, 24)).columns), bool(args.level))
        if out:
            text += f"\n\npicture: {out}"
    print(printable(text))
    return 0 if all(one.sound for one in findings if one.system.name != "limb_original") else 1


def printable(text: str) -> str:
    """The text, with plain letters if standard output cannot show its symbols."""
    encoding = sys.stdout.encoding or "utf-8"
    try:
        text.encode(encoding)
    except UnicodeEncodeError:
        return text.translate(PLAIN).encode(encoding, "replace").decode(encoding)
    return text
