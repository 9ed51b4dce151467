"""Options of commands that overrule what is concluded from a text file."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from limb_nodes.signals.text_options import DECIMALS, TextOptions


def add_text_options(parser: argparse.ArgumentParser) -> None:
    """Add the options that overrule what is concluded from a text file."""
    text = parser.add_argument_group("how a text file is read")
    text.add_argument(
        "--delimiter",
        metavar="SIGN",
        help="between columns: comma, semicolon, tab or blanks (default: as the rows show)",
    )
    text.add_argument("--decimal", choices=DECIMALS, help="decimal mark (default: as the rows show)")
    text.add_argument(
        "--header-row", type=int, metavar="LINE",
        help="line of the columns' names, from 1; 0: there is none, they are named 'column 1' and so on",
    )  # fmt: skip
    text.add_argument("--encoding", metavar="NAME", help="such as utf-8 or cp1252 (default: as the first bytes show)")
    times = text.add_mutually_exclusive_group()
    times.add_argument("--time", metavar="COLUMN", help="column of times (default: by its name, or as it rises evenly)")
    times.add_argument(
        "--no-times", action="store_true", help="do not use times; the rate is that of --rate or the header"
    )
    text.add_argument(
        "--unit", dest="units", action="append", default=[], metavar="[COLUMN=]UNIT",
        help="unit of a column, or of all that state none; repeatable",
    )  # fmt: skip


def text_options(args: argparse.Namespace, columns: Sequence[str]) -> TextOptions:
    """What was said of the text file. columns: those that are asked for by name."""
    pairs = [entry.rpartition("=") for entry in args.units]
    return TextOptions(
        encoding=args.encoding,
        delimiter=args.delimiter,
        decimal=args.decimal,
        header_row=args.header_row,
        time=args.time,
        no_times=args.no_times,
        units={column: unit for column, _, unit in pairs},
        skip=tuple(args.skip),
        wanted=tuple(columns),
    )
