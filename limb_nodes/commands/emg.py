"""`limb emg`: raw EMG to normalised envelopes in a bag."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from limb_nodes.bags.folder import refuse_existing
from limb_nodes.errors import FieldError
from limb_nodes.foundation.text_table import aligned
from limb_nodes.signals.bag_field import BagOptions
from limb_nodes.signals.emg import Envelopes, envelopes
from limb_nodes.signals.envelope import DEFAULT_BAND, DEFAULT_LOW_PASS, DEFAULT_ORDER, MAINS, Gaps
from limb_nodes.signals.envelope_bag import write_envelopes
from limb_nodes.signals.options import DEFAULT_LONGEST_GAP, EnvelopeOptions
from limb_nodes.signals.recording import read_recording
from limb_nodes.signals.text_options import DECIMALS, TextOptions


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the arguments of `limb emg`."""
    parser = subparsers.add_parser(
        "emg",
        help="raw EMG to normalised envelopes in a bag",
        description="Band-pass, rectify, low-pass and normalise raw EMG; write the envelopes (topic emg_envelope), "
        "the raw EMG (topic emg_raw) and the angles recorded beside them (topic reference_angle) to a bag.",
    )
    parser.add_argument("file", help="text with named columns, such as CSV, a bag, or a C3D file")
    parser.add_argument("-o", "--out", required=True, metavar="BAG", help="folder to write; must not exist")
    reading = parser.add_argument_group("what is read")
    reading.add_argument(
        "--rate",
        type=float,
        metavar="HZ",
        help="samples per second, whatever the file says (default: as its times say)",
    )
    reading.add_argument(
        "--channel", dest="channels", action="append", default=[], metavar="COLUMN[=NAME]",
        help="take this EMG column, under another name if given; repeatable (default: all in V, mV, uV or no unit)",
    )  # fmt: skip
    reading.add_argument(
        "--channels", dest="names", metavar="NAMES",
        help="take these EMG columns, as in RF,VM; of a bag whose messages have no names, their names",
    )  # fmt: skip
    reading.add_argument(
        "--angle", dest="angles", action="append", default=[], metavar="COLUMN[=NAME]",
        help="keep this column of angles, under another name if given; repeatable (default: all in deg or rad)",
    )  # fmt: skip
    reading.add_argument(
        "--skip", action="append", default=[], metavar="COLUMN",
        help="leave out before its cells are read; repeatable",
    )  # fmt: skip
    add_text_options(parser)
    add_bag_options(parser)
    steps = parser.add_argument_group("steps")
    steps.add_argument(
        "--remove-spikes", action="store_true", help="put straight lines for lone spikes (default: they are noted)"
    )
    steps.add_argument(
        "--longest-gap", type=float, default=DEFAULT_LONGEST_GAP, metavar="S",
        help=f"put straight lines for values that are missing for S seconds at most (default {DEFAULT_LONGEST_GAP:g})",
    )  # fmt: skip
    steps.add_argument("--keep-gaps", action="store_true", help="keep longer gaps as gaps (default: they are refused)")
    steps.add_argument(
        "--mains", type=float, metavar="HZ",
        help=f"notch at the mains, {' or '.join(f'{mains:g}' for mains in MAINS)}, and its harmonics (default: none)",
    )  # fmt: skip
    band = steps.add_mutually_exclusive_group()
    band.add_argument(
        "--band-pass", dest="band", nargs=2, type=float, default=DEFAULT_BAND, metavar=("LOW", "HIGH"),
        help=f"edges in Hz (default {DEFAULT_BAND[0]:g} {DEFAULT_BAND[1]:g})",
    )  # fmt: skip
    band.add_argument("--no-band-pass", action="store_true", help="leave the band-pass out")
    steps.add_argument(
        "--band-pass-order", dest="band_order", type=int, default=DEFAULT_ORDER, metavar="N",
        help=f"order of both passes together, even (default {DEFAULT_ORDER})",
    )  # fmt: skip
    steps.add_argument("--no-rectify", action="store_true", help="leave the full-wave rectification out")
    low = steps.add_mutually_exclusive_group()
    low.add_argument(
        "--low-pass", type=float, default=DEFAULT_LOW_PASS, metavar="HZ", help=f"corner (default {DEFAULT_LOW_PASS:g})"
    )
    low.add_argument("--no-low-pass", action="store_true", help="leave the low-pass out")
    steps.add_argument(
        "--low-pass-order", type=int, default=DEFAULT_ORDER, metavar="N",
        help=f"order of both passes together, even (default {DEFAULT_ORDER})",
    )  # fmt: skip
    steps.add_argument(
        "--causal", action="store_true",
        help="filter forward only, as live use does; filters of the same orders (default: no phase shift)",
    )  # fmt: skip
    steps.add_argument(
        "--rest", type=float, default=0.0, metavar="S",
        help="the mean of each channel's quietest S seconds becomes 0 (default: nothing is subtracted)",
    )  # fmt: skip
    steps.add_argument(
        "--maximum", action="append", default=[], metavar="COLUMN=VALUE",
        help="envelope that becomes 1, in the column's unit; repeatable (default: the channel's own maximum)",
    )  # fmt: skip
    steps.add_argument(
        "--maximum-from", nargs="+", action="extend", default=[], metavar="FILE",
        help="recordings such as maximal contractions, read and processed alike; a channel's largest envelope in them "
        "becomes 1",
    )  # fmt: skip
    steps.add_argument(
        "--trust", action="append", default=[], metavar="COLUMN",
        help="normalise this channel although it seems to hold no signal; repeatable (default: it is left at 0)",
    )  # fmt: skip
    steps.add_argument(
        "--delay", type=float, default=0.0, metavar="S",
        help="shift the envelopes later by the electromechanical delay, often 0.03 to 0.1 (default 0)",
    )  # fmt: skip
    parser.add_argument("--no-raw", action="store_true", help="leave the raw EMG (topic emg_raw) out of the bag")
    steps.add_argument("--resample", type=float, metavar="HZ", help="rate of the bag (default: the recording's)")


def add_bag_options(parser: argparse.ArgumentParser) -> None:
    """Add the options that choose what is read from a bag."""
    group = parser.add_argument_group("how a bag is read")
    group.add_argument(
        "--topic", help="topic of the raw EMG in a bag (default: emg_raw, emg, or the only one with channels)"
    )
    group.add_argument("--field", metavar="PATH", help="field of the values in its messages, as in outer.inner")
    group.add_argument(
        "--stamps", choices=("header", "received"),
        help="times of a bag's samples (default: the stamps in the messages if they rise, else times of reception)",
    )  # fmt: skip
    group.add_argument(
        "--rows", choices=("samples", "channels"),
        help="in messages with several samples: one sample stands after the other, or one channel",
    )  # fmt: skip


def bag_options(args: argparse.Namespace) -> BagOptions:
    """What was said of the bag. Raises FieldError if a name is empty or given twice."""
    names = [] if args.names is None else [name.strip() for name in args.names.split(",")]
    for name in names:
        if not name or names.count(name) > 1:
            raise FieldError("names", f"is {args.names}; different names such as RF,VM are needed")
    return BagOptions(args.topic, args.field, tuple(names), args.stamps, args.rows)


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


def run(args: argparse.Namespace) -> int:
    """Read, process, write, and print what was done. Raises UserError before anything is written."""
    refuse_existing(Path(args.out))
    channels = dict(_pairs("channels", args.channels, same=True))
    angles = dict(_pairs("angles", args.angles, same=True))
    bag = bag_options(args)
    for name in bag.names:
        channels.setdefault(name, name)
    text = text_options(args, [*channels, *angles])
    recording = read_recording(args.file, rate=args.rate, text=text, bag=bag)
    # What is skipped need not be in the others.
    other = replace(text, skip=())
    maxima = [read_recording(file, rate=args.rate, text=other, bag=bag) for file in args.maximum_from]
    options = EnvelopeOptions(
        band=None if args.no_band_pass else (args.band[0], args.band[1]),
        band_order=args.band_order,
        rectify=not args.no_rectify,
        low_pass=None if args.no_low_pass else args.low_pass,
        low_pass_order=args.low_pass_order,
        rest=args.rest,
        resample=args.resample,
        maximum={column: _float("maximum", column, value) for column, value in _pairs("maximum", args.maximum)},
        channels=channels,
        angles=angles,
        skip=tuple(name for name in args.skip if name not in recording.skipped),
        mains=args.mains,
        causal=args.causal,
        delay=args.delay,
        trust=tuple(args.trust),
        remove_spikes=args.remove_spikes,
        longest_gap=args.longest_gap,
        keep_gaps=args.keep_gaps,
    )
    result = envelopes(recording, options, maxima)
    write_envelopes(result, args.out, options, raw=not args.no_raw)
    print(summary(result, args.out))
    return 0


def summary(result: Envelopes, out: str) -> str:
    """A table of the channels, and the path of the bag."""
    rows = [("channel", "as", "samples", "gaps bridged", "longest", "maximum", "rest level", "above maximum")]
    samples = str(len(result.values))
    for channel in result.channels:
        unit = f" {channel.unit}" if channel.unit else ""
        rows.append(
            (channel.column, channel.name, samples, _gaps(channel.gaps), _longest(channel.gaps),
             f"{channel.maximum:.4g}{unit}" if channel.has_signal else "no signal", f"{channel.rest:.3g}{unit}",
             str(channel.clipped))
        )  # fmt: skip
    for angle in result.angle_channels:
        rows.append(
            (angle.column, f"{angle.name} (angle)", samples, _gaps(angle.gaps), _longest(angle.gaps), "", "", "")
        )
    lines = aligned(rows) + [f"note: {note}" for note in result.notes]
    lines.append(f"rate {result.rate:g} Hz, {(len(result.values) - 1) / result.rate:g} s, in {out}")
    return "\n".join(lines)


def _gaps(gaps: Gaps) -> str:
    return f"{gaps.count} ({gaps.samples} samples)" if gaps.count else "0"


def _longest(gaps: Gaps) -> str:
    return f"{gaps.longest} samples" if gaps.count else "-"


def _pairs(field: str, entries: Sequence[str], same: bool = False) -> list[tuple[str, str]]:
    """Split NAME=VALUE; with `same`, NAME alone stands for NAME=NAME."""
    pairs: list[tuple[str, str]] = []
    for entry in entries:
        name, equals, value = entry.partition("=")
        if not equals and same:
            value = name
        if not name or not value:
            raise FieldError(field, f"is {entry}; COLUMN{'[=NAME]' if same else '=VALUE'} is needed")
        if name in dict(pairs):
            raise FieldError(field, f"names {name!r} twice; different columns are needed")
        pairs.append((name, value))
    return pairs


def _float(field: str, name: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise FieldError(field, f"of {name} is {text!r}; a number > 0 is needed") from None
