"""The header of a text table: a line of column names, or lines that describe one channel each.

time (s),RF [mV],VM [mV]

Channel 1: 'RF', 13480 values, engineering units: mV, no filters.
Channel 2: 'FX', 674 values, engineering units: deg, extrapolated from 50 to 1000 samples per second.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from limb_nodes.errors import UserError
from limb_nodes.signals import units

_NAME_AND_UNIT = re.compile(r"(?P<name>.*?)\s*[\[(](?P<unit>[^\])]*)[\])]")
_CHANNEL = re.compile(
    r"Channel\s+\d+:\s*'(?P<name>[^']*)'\s*,\s*(?P<count>\d+)\s+values\s*,"
    r"\s*engineering units:\s*(?P<unit>[^,\s]+?)\s*[,.]?(?:\s.*)?"
)
_CHANNEL_RATE = re.compile(r"(?P<rate>\d+(?:\.\d+)?)\s+samples per second")
# Channels are described in the first lines only.
_MOST_LINES = 200


@dataclass(frozen=True)
class Header:
    """What a text table says of its columns.

    names, units: one per column; the unit is "" if the file does not state one.
    delimiter: between the cells of a row. end: index of the first line below.
    rates: the different numbers of samples per second (Hz) that are stated, rising. rows: how many are promised.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    delimiter: str
    end: int
    rates: tuple[float, ...] = ()
    rows: int | None = None

    def time_column(self) -> int | None:
        """Index of the column of times (named `time`, `timestamp` or `t`), or None."""
        for index, (name, unit) in enumerate(zip(self.names, self.units, strict=True)):
            if (name.lower() in {"time", "timestamp"} or name == "t") and unit in units.TIME:
                return index
        return None


def read_header(source: str, lines: Sequence[str]) -> Header:
    """Read the header of a file's lines.

    A column's name may carry its unit, `RF [mV]` or `time (s)`. Lines that start with `#` above the names are passed
    over. Raises UserError that names the line if there is no header, or if a column has no name or the name of another.
    """
    described = enumerate(lines[:_MOST_LINES])
    channels = {index: match for index, line in described if (match := _CHANNEL.fullmatch(line.strip()))}
    return _channel_lines(source, lines, channels) if channels else _name_line(source, lines)


def _name_line(source: str, lines: Sequence[str]) -> Header:
    first = next((i for i, line in enumerate(lines) if line.strip() and not line.startswith("#")), None)
    if first is None:
        raise UserError(f"{source}: the file is empty; a header line and rows of numbers are needed")
    delimiter = _delimiter_of(lines[first])
    try:
        cells = [cell.strip() for cell in next(csv.reader([lines[first]], delimiter=delimiter))]
    except csv.Error as error:
        raise UserError(f"{source}, line {first + 1}: is no line of column names: {error}") from None
    if all(_is_number(cell) for cell in cells):
        raise UserError(f"{source}, line {first + 1}: is a row of numbers; names, for example time,RF,VM, are needed")
    names, units_of = zip(*(_split_unit(cell) for cell in cells), strict=True)
    _check_names(source, first + 1, names)
    return Header(names, units_of, delimiter, first + 1)


def _channel_lines(source: str, lines: Sequence[str], channels: Mapping[int, re.Match[str]]) -> Header:
    """channels: the match of each line that describes a channel, by its index."""
    end = max(channels) + 1
    while end < len(lines) and not lines[end].strip(" \r\n"):
        end += 1
    names = tuple(match["name"] for match in channels.values())
    _check_names(source, max(channels) + 1, names)
    rates = {float(match["rate"]) for line in channels.values() if (match := _CHANNEL_RATE.search(line[0]))}
    return Header(
        names,
        tuple(match["unit"] for match in channels.values()),
        _delimiter_of(lines[end]) if end < len(lines) else ",",
        end,
        tuple(sorted(rates)),
        max(int(match["count"]) for match in channels.values()),
    )


def _delimiter_of(line: str) -> str:
    """The separator of a line's cells: a tab if there is one, else a comma."""
    return "\t" if "\t" in line else ","


def _check_names(source: str, line: int, names: Sequence[str]) -> None:
    for index, name in enumerate(names):
        if not name:
            raise UserError(f"{source}, line {line}: column {index + 1} has no name; a name for each column is needed")
        if name in names[:index]:
            raise UserError(f"{source}, line {line}: two columns are named {name!r}; different names are needed")


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _split_unit(cell: str) -> tuple[str, str]:
    """Split `RF [mV]` into name and unit; brackets that hold no known unit belong to the name."""
    match = _NAME_AND_UNIT.fullmatch(cell)
    return (match["name"], match["unit"]) if match and match["unit"] in units.KNOWN else (cell, "")
