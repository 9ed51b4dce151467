"""`limb export`: a bag as a table for other programs."""

from __future__ import annotations

import argparse

from limb_nodes.commands import output_file
from limb_nodes.errors import FieldError


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the arguments of `limb export`."""
    parser = subparsers.add_parser(
        "export",
        help="write a bag as a table for other programs",
        description="Write envelopes, activations, movement, torques, states of the muscles, and power and work of "
        "muscles and joints as a table over time: for OpenSim, as CSV or as Parquet.",
    )
    parser.add_argument("bag", metavar="BAG", help="a bag of a run or of `limb emg`")
    parser.add_argument(
        "-o", "--out", required=True, metavar="FILE", help="file to write: .sto or .mot (OpenSim), .csv or .parquet"
    )
    parser.add_argument("--force", action="store_true", help="overwrite the file")
    parser.add_argument(
        "--topics", nargs="+", default=[], metavar="NAME",
        help="topics of the bag (default: all that make a table, but motor_unit_state and sarcomere_state)",
    )  # fmt: skip
    parser.add_argument(
        "--columns", nargs="+", default=[], metavar="NAME",
        help="names of columns, or patterns such as '*_power' (default: all)",
    )  # fmt: skip
    parser.add_argument("--from", dest="start", type=float, metavar="S", help="first time, s (default: the start)")
    parser.add_argument("--to", dest="end", type=float, metavar="S", help="last time, s (default: the end)")
    angles = parser.add_mutually_exclusive_group()
    angles.add_argument("--degrees", action="store_true", help="angles in degrees (default in a .mot)")
    angles.add_argument("--radians", action="store_true", help="angles in radians (default in the others)")
    parser.add_argument("--namespace", default="", metavar="NS", help="of the limb, if the bag holds several")


def run(args: argparse.Namespace) -> int:
    """Write the table; print its path and size, and what was left out."""
    from limb_nodes.analysis.export.files import ENDINGS, require_parquet, write_csv, write_parquet, write_storage
    from limb_nodes.analysis.export.table import BagTable, Choice
    from limb_nodes.bags.read import BagReader

    out = output_file("out", args.out, ENDINGS)
    ending = out.suffix.lower()
    if out.is_dir() or (out.exists() and not args.force):
        raise FieldError("out", f"is {out}, which exists already; a new name is needed, or --force")
    if ending == ".parquet":
        require_parquet(out)
    degrees = args.degrees or (ending == ".mot" and not args.radians)
    choice = Choice(tuple(args.topics), tuple(args.columns), args.start, args.end, degrees, args.namespace)
    with BagReader(args.bag) as reader:
        table = BagTable(reader, choice)
        if ending == ".csv":
            write_csv(table, out)
        elif ending == ".parquet":
            write_parquet(table, out)
        else:
            write_storage(table, out, name=reader.path.resolve().name, in_degrees=degrees)
    for note in table.notes:
        print(f"note: {note}")
    size = ", ".join(f"{n} {what}{'s' * (n != 1)}" for n, what in ((table.rows, "row"), (len(table.columns), "column")))
    print(f"table  {out} ({size}, {table.start:.12g} to {table.end:.12g} s)")
    return 0
