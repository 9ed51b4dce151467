"""`limb trust`: trust the code of a limb's own laws."""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

from limb_nodes.errors import escaped
from limb_nodes.model.consent import trust, trust_file


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the arguments of `limb trust`."""
    parser = subparsers.add_parser(
        "trust",
        help="trust the code of a limb's own laws",
        description="Let the Python files from which the laws of a limb come run without being asked again, as long as "
        "they hold what they hold now. Nothing is run. Read them before.",
    )
    parser.add_argument("source", metavar="LIMB.yaml|BAG", help="the limb, or a bag of a run")
    parser.add_argument("--show", action="store_true", help="print the files, trust nothing")


def run(args: argparse.Namespace) -> int:
    """Trust, or show; print each file and its hash."""
    from limb_nodes.commands.rerun import code_of, run_info, unpack

    with tempfile.TemporaryDirectory(prefix="limb_trust_") as place:
        limb = Path(args.source)
        if limb.is_dir() or limb.suffix.lower() not in (".yaml", ".yml"):
            limb = unpack(Path(place), run_info(args.source), args.source)
        code = code_of(limb)
    if not code.files:
        print(f"{args.source} has no code of its own")
        return 0
    for module in code.files:
        print(f"{module.sha256}  {module.relative}")
        if args.show:
            print(escaped(module.text, kept="\n\t"))
    if not args.show:
        trust(code, args.source)
        print(f"trusted, in {trust_file()}")
    return 0
