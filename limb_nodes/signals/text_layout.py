"""What a text file's first lines say of the rest: delimiter, decimal mark, names, units, where the rows begin.

Several readings are tried on the first lines; the one in which rows of numbers follow each other counts. If two are
possible, both are told and none is taken.
"""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from limb_nodes.errors import FieldError, UserError
from limb_nodes.signals import units
from limb_nodes.signals.column import Column, column_of
from limb_nodes.signals.text_options import DECIMALS, DELIMITERS, TextOptions

MOST_COLUMNS = 4096
# So many rows of numbers show how all are written.
_ENOUGH = 50
# The rows begin within so many lines.
_MOST_PREAMBLE = 2000
MISSING = ("", "na", "n/a", "nan", "-nan", "null", "none", "-")
_EXPONENT = r"(?:[eE][+-]?\d+)?"
_NUMBERS = {
    ".": re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)" + _EXPONENT, re.ASCII),
    ",": re.compile(r"[+-]?(?:\d+(?:,\d+)?|,\d+)" + _EXPONENT, re.ASCII),
}
_INTEGER_PART = re.compile(r"[+-]?0\d")
_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}(?:,\d{3})+")
_RATE = re.compile(r"([\d.]+(?:[eE][+-]?\d+)?)\s*Hz", re.IGNORECASE)
_STATED = re.compile(r"(?:sampl\w*[ _]*(?:rate|freq\w*)|frequency|\bfs\b)[^\d]{0,20}?([\d.]+)", re.IGNORECASE)
_PROMISED = re.compile(r"nRows\s*=\s*(\d+)|datarows\s+(\d+)", re.IGNORECASE)
_CHANNEL = re.compile(
    r"Channel\s+\d+:\s*'(?P<name>[^']*)'\s*,\s*(?P<count>\d+)\s+values\s*,"
    r"\s*engineering units:\s*(?P<unit>[^,\s]*?)\s*[,.]?(?:\s.*)?"
)
_CHANNEL_RATE = re.compile(r"(?P<rate>\d+(?:\.\d+)?)\s+samples per second")
_LABELS = re.compile(r"labels\s*:?=+\s*(.*)", re.IGNORECASE)
_MARKS = "#%/;"
# Remarks above the rows say what is looked for at their beginning.
_REMARK = 1000


@dataclass(frozen=True)
class Layout:
    """How the lines of a file are to be read.

    delimiter: `,`, `;`, a tab, or a blank for any number of blanks. decimal: `.` or `,`.
    columns: one for each cell of a row. groups: the sensor above each column, "" if none is named.
    names_line: the line of the names, counted from 1; None if they stand elsewhere. start: index of the first row.
    rates: by column, the rate (Hz) stated above it. stated: the rates (Hz) that the header states for all, rising.
    promised: how many rows the header promises.
    sample: the cells of the first rows.
    """

    delimiter: str
    decimal: str
    columns: tuple[Column, ...]
    groups: tuple[str, ...]
    names_line: int | None
    start: int
    rates: dict[int, float]
    stated: tuple[float, ...]
    promised: int | None
    sample: tuple[tuple[str, ...], ...]

    def number(self, cell: str) -> float | None:
        """A cell's number, or None."""
        return number_of(cell, self.decimal)


@dataclass(frozen=True)
class _Rows:
    """The first rows of numbers under one reading: `width` cells each, of lines `start` to `end`.

    text: how many cells hold text.
    """

    delimiter: str
    decimal: str
    start: int
    end: int
    width: int
    cells: tuple[tuple[str, ...], ...]
    text: int


@dataclass(frozen=True)
class _Names:
    cells: tuple[str, ...]
    units: tuple[str, ...]
    groups: tuple[str, ...]
    line: int | None
    rates: dict[int, float]


def number_of(cell: str, decimal: str) -> float | None:
    """The number that a cell holds with this decimal mark, or None."""
    cell = cell.strip()
    return float(cell.replace(",", ".")) if _NUMBERS[decimal].fullmatch(cell) else None


def split(line: str, delimiter: str) -> tuple[str, ...]:
    """The cells of a line, without the blanks around them. Raises ValueError if quotation marks do not fit."""
    if delimiter == " ":
        line = re.sub(r"\s+", " ", line.strip())
    try:
        cells = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True, strict=True), [])
    except csv.Error as error:
        raise ValueError(str(error)) from None
    return tuple(cell.strip() for cell in cells)


def read_layout(source: str, lines: Sequence[str], options: TextOptions) -> Layout:
    """Conclude a file's layout from its first lines. lines: without their ends.

    Raises UserError if there is no row of numbers or no header; FieldError if two readings are possible, or if what
    an option says is not there.
    """
    if not any(line.strip() for line in lines):
        raise UserError(f"{source}: the file is empty; a header line and rows of numbers are needed")
    widest = max(max(line.count(sign) for sign in ",;\t") for line in lines) + 1
    if widest > MOST_COLUMNS:
        raise UserError(f"{source}: holds {widest} columns; at most {MOST_COLUMNS} are needed")
    first = 1 if lines[0].lower().startswith("sep=") else 0
    sign = options.sign or (lines[0][4:5] or None if first else None)
    above = min(options.header_row or first, len(lines))
    if options.header_row and options.header_row >= len(lines):
        raise FieldError("header_row", f"is {options.header_row}; a line above rows of numbers is needed", source)
    readings: list[_Rows] = []
    some = lines[: above + _MOST_PREAMBLE]
    for delimiter in [sign] if sign else DELIMITERS.values():
        for decimal in [options.decimal] if options.decimal else DECIMALS:
            rows = _rows(some, above, delimiter, decimal)
            if rows:
                readings.append(rows)
                if len(rows.cells) == _ENOUGH:
                    # Another reading has to show itself in the same lines.
                    some = some[: rows.end]
    if not readings:
        raise UserError(_no_rows(source, lines))
    rows, names = _best(source, lines, readings, options)
    if options.header_row == 0:
        names = _Names(
            tuple(f"column {i + 1}" for i in range(rows.width)), ("",) * rows.width, ("",) * rows.width, None, {}
        )
    if names is None:
        raise UserError(_no_names(source, lines, rows))
    columns = tuple(column_of(cell, unit) for cell, unit in zip(names.cells, names.units, strict=True))
    start = max(above, _first_row(lines, rows, names.line or 0), names.line or 0)
    cells = rows.cells[max(0, start - rows.start) :]
    preamble = lines[:start]
    return Layout(
        rows.delimiter, rows.decimal, columns, names.groups, names.line, start, names.rates,
        _stated_rates(preamble, rows.delimiter), _promised(preamble), cells,
    )  # fmt: skip


def _rows(lines: Sequence[str], first: int, delimiter: str, decimal: str) -> _Rows | None:
    """The first rows of numbers: three or more in succession, else the most."""
    best: list[tuple[int, tuple[str, ...]]] = []
    run: list[tuple[int, tuple[str, ...]]] = []
    for index in range(first, len(lines)):
        line = lines[index]
        if not line.strip() and run:
            continue
        cells = _data(line, delimiter, decimal)
        if run and (cells is None or len(cells) != len(run[0][1])):
            if len(run) >= 3:
                break
            run = []
        if cells is not None:
            run.append((index, cells))
            if len(run) > len(best):
                best = list(run) if len(run) <= 3 else run
            if len(run) >= _ENOUGH:
                break
    if not best:
        return None
    text = sum(
        bool(cell) and cell.lower() not in MISSING and not _looks(cell, decimal) for _, row in best for cell in row
    )
    return _Rows(delimiter, decimal, best[0][0], best[-1][0] + 1, len(best[0][1]), tuple(row for _, row in best), text)


def _data(line: str, delimiter: str, decimal: str) -> tuple[str, ...] | None:
    """The cells of a line in which numbers prevail, or None."""
    if line[:1] in {"#", "%"}:
        return None
    try:
        cells = split(line, delimiter)
    except ValueError:
        return None
    filled = [cell for cell in cells if cell.lower() not in MISSING]
    numbers = sum(_looks(cell, decimal) for cell in filled)
    blank = bool(cells) and not filled and any(cells)
    return cells if blank or (numbers and numbers > len(filled) - numbers) else None


def _looks(cell: str, decimal: str) -> bool:
    """Whether a cell is written as a number; zeros before an integer are what a wrong delimiter leaves."""
    return bool(_NUMBERS[decimal].fullmatch(cell)) and not _INTEGER_PART.match(cell)


def _best(
    source: str, lines: Sequence[str], readings: Sequence[_Rows], options: TextOptions
) -> tuple[_Rows, _Names | None]:
    """The reading with the least text among its numbers and with names above it."""
    named = [(rows, _names(lines, rows, options)) for rows in readings]
    wide = [pair for pair in named if pair[0].width > 1 and (pair[1] or options.header_row != 0)]
    if any(names for _, names in wide) or (wide and not any(names for _, names in named)):
        # Commas in the names as well as in the rows stand between columns.
        named = wide
    longest = max(len(rows.cells) for rows, _ in named)
    named = [pair for pair in named if 2 * len(pair[0].cells) > longest]
    least = min(rows.text / len(rows.cells) for rows, _ in named)
    named = [pair for pair in named if pair[0].text / len(pair[0].cells) == least]
    if any(rows.delimiter in ";\t" and rows.width > 1 for rows, _ in named):
        named = [pair for pair in named if pair[0].delimiter != " "]
    named = [pair for pair in named if pair[1] is not None] or named
    chosen = named[0]
    # Readings differ if they see other numbers: of the same cells, the first one is as good as the second.
    numbers = {tuple(number_of(cell, rows.decimal) for cell in rows.cells[0]): rows for rows, _ in reversed(named)}
    if len(numbers) > 1:
        wider = [(rows, names) for rows, names in named if rows.width > 1]
        if len(wider) != 1 or named[0][1] is not None:
            two, *_, one = numbers.values()
            raise FieldError(
                "delimiter",
                f"is not clear: line {one.start + 1} holds {_described(one)} or {_described(two)}; one of both is "
                "needed, with the decimal mark",
                source,
            )
        chosen = wider[0]
    rows = chosen[0]
    commas = [cell for row in rows.cells for cell in row if "," in cell]
    if options.decimal is None and rows.decimal == "," and commas and all(map(_THOUSANDS.fullmatch, commas)):
        raise FieldError(
            "decimal",
            f"is not clear: line {rows.start + 1} holds {commas[0]}, with a comma for decimals or for thousands; "
            ". or , is needed",
            source,
        )
    return chosen


def _described(rows: _Rows) -> str:
    names = {sign: name for name, sign in DELIMITERS.items()}
    mark = "comma" if rows.decimal == "," else "point"
    columns = f"{rows.width} column{'s' if rows.width > 1 else ''}"
    return f"{columns} (delimiter {names.get(rows.delimiter, rows.delimiter)}, decimal {mark})"


def _names(lines: Sequence[str], rows: _Rows, options: TextOptions) -> _Names | None:
    """The names above the rows, or None."""
    if options.header_row:
        return _names_in(lines, rows, [options.header_row - 1, *range(options.header_row, rows.start)], True)
    channels = [match for line in lines[: rows.start] if (match := _channel(line))]
    if channels and len(channels) <= rows.width:
        # Columns behind those that are described have no name.
        rest = ("",) * (rows.width - len(channels))
        cells = (*(match["name"] for match in channels), *rest)
        return _Names(cells, (*(match["unit"] for match in channels), *rest), ("",) * rows.width, None, {})
    # A row with a wrong cell may stand between the names and the rows that show how all are written.
    start = _first_row(lines, rows, 0)
    found = _names_in(lines, rows, range(start - 1, -1, -1), False)
    if found is None and start < rows.start:
        found = _names_in(lines, rows, range(rows.start - 1, -1, -1), False)
    found = found or _names_in_comments(lines, rows)
    if found is None and len(rows.cells) > 1 and _may_be_names([cell for cell in rows.cells[0] if cell], rows.decimal):
        # More channels that are numbered than columns that are named.
        return _Names(rows.cells[0], ("",) * rows.width, ("",) * rows.width, rows.start + 1, {})
    return found


def _first_row(lines: Sequence[str], rows: _Rows, least: int) -> int:
    """The first of the lines down to the rows that have as many cells, and a number among them; not below `least`."""
    start = rows.start
    while start > least and rows.start - start < _ENOUGH:
        try:
            cells = split(lines[start - 1], rows.delimiter)
        except ValueError:
            break
        filled = [cell for cell in cells if cell]
        numbers = [cell for cell in filled if number_of(cell, rows.decimal) is not None]
        if len(cells) != rows.width or not numbers or lines[start - 1][:1] in _MARKS:
            break
        start -= 1
    return start


def _names_in(lines: Sequence[str], rows: _Rows, indexes: Iterable[int], first: bool) -> _Names | None:
    """Names in one of some lines, with the units, rates and sensors around them.

    first: whether the first of the lines holds the names, whatever stands in it.
    """
    stated, rates, width = ("",) * rows.width, {}, rows.width
    found: tuple[int, tuple[str, ...]] | None = None
    for index in indexes:
        line = lines[index]
        if not line.strip():
            continue
        if line[:1] in _MARKS and not (found or first):
            # A commented line of names is looked for when nothing else is there.
            break
        try:
            cells = _header_cells(line, rows.delimiter)
        except ValueError:
            break
        filled = [cell for cell in cells if cell]
        if not filled and not first:
            continue
        if filled and all(_RATE.fullmatch(cell) for cell in filled) and len(cells) <= width:
            rates = {column: float(match[1]) for column, cell in enumerate(cells) if (match := _RATE.fullmatch(cell))}
            continue
        if found is None and not first and len(filled) > 0 and all(_is_measure(cell) for cell in filled):
            continue
        fitted = _fitted(cells, rows)
        as_units = fitted is not None and all(_unit_cell(cell) is not None for cell in filled) and bool(filled)
        if fitted is not None and as_units and (found or not _says_time(filled)):
            stated = tuple(_unit_cell(cell) or "" for cell in fitted)
            continue
        if found is None:
            if fitted is None or (not first and not _may_be_names(filled, rows.decimal)):
                break
            found = (index, fitted)
            if first:
                continue
            # A row of sensors may stand right above the names.
            above = (_groups(line, rows) for line in reversed(lines[max(0, index - 3) : index]))
            groups = next((groups for groups in above if groups), ("",) * width)
            return _Names(fitted, stated, groups, index + 1, rates)
    if found is None:
        return None
    return _Names(found[1], stated, ("",) * rows.width, found[0] + 1, rates)


def _may_be_names(cells: Sequence[str], decimal: str) -> bool:
    """Whether cells name columns: there is text, and no number but counts."""
    numbers = [cell for cell in cells if number_of(cell, decimal) is not None]
    return len(numbers) < len(cells) and all(cell.isdigit() for cell in numbers)


def _channel(line: str) -> re.Match[str] | None:
    """What a line says of one channel."""
    return _CHANNEL.fullmatch(line.strip()) if len(line) < _REMARK else None


def _says_time(cells: Sequence[str]) -> bool:
    named = [column_of(cell) for cell in cells]
    return any(column.says_time and column.name and column.name.lower() not in units.TIME for column in named)


def _header_cells(line: str, delimiter: str) -> tuple[str, ...]:
    if delimiter == " ":
        # A unit in brackets belongs to the name before it.
        line = " ".join(line.split()).replace(" [", "[").replace(" (", "(")
        line = re.sub(r"[\[(][^\[\]()]*[\])]", lambda match: match[0].replace(" ", ""), line)
    return split(line, delimiter)


def _fitted(cells: Sequence[str], rows: _Rows) -> tuple[str, ...] | None:
    """A row of the header, with as many cells as the rows below; None if it does not fit."""
    width, given = rows.width, list(cells)
    while len(given) > width and not given[-1]:
        given.pop()
    if len(given) == width:
        return tuple(given)
    if len(given) < width and not any(row[i] for row in rows.cells for i in range(len(given), width)):
        return (*given, *[""] * (width - len(given)))
    if len(given) == width - 1 and _counts([row[0] for row in rows.cells]):
        # Rows begin with their number or name, as R writes them.
        return ("", *given)
    return None


def _counts(cells: Sequence[str]) -> bool:
    return len(cells) > 1 and all(
        cell.isdigit() and int(cell) == int(cells[0]) + i if cells[0].isdigit() else False
        for i, cell in enumerate(cells)
    )


def _unit_cell(cell: str) -> str | None:
    """What a cell of a row of units says: a known unit, "" for none, or None if it is no unit."""
    bare = cell.strip("[](){} ")
    return "" if bare in {"", "-"} else units.unit_named(bare)


def _is_measure(cell: str) -> bool:
    """Whether a cell is a number with a unit, as in a row of periods."""
    number, _, unit = cell.partition(" ")
    return number_of(number, ".") is not None and units.unit_named(unit) is not None


def _groups(line: str, rows: _Rows) -> tuple[str, ...] | None:
    """The sensor of each column, from a line that names each at its first column; None if it is no such line."""
    try:
        cells = split(line, rows.delimiter)[: rows.width]
    except ValueError:
        return None
    filled = [cell for cell in cells if cell]
    if not cells or not cells[0] or len(filled) < 2 or len({*filled}) < len(filled):
        return None
    if any(number_of(cell, ".") is not None for cell in cells):
        return None
    names = [cells[0]]
    for index in range(1, rows.width):
        names.append((cells[index] if index < len(cells) else "") or names[-1])
    return tuple(names)


def _names_in_comments(lines: Sequence[str], rows: _Rows) -> _Names | None:
    """Names in the marked lines above the rows: as JSON, as labels, or as a line of cells."""
    for index in range(rows.start - 1, -1, -1):
        line = lines[index]
        if line[:1] not in {"#", "%"}:
            continue
        text = line.lstrip("#% \t")
        cells: Sequence[str] | None = _json_names(text)
        if cells is None and (match := _LABELS.match(text[:_REMARK])):
            cells = re.split(r"[\t,;]|\s{2,}", match[1].strip())
        line_of_cells = cells is None
        if cells is None:
            try:
                cells = _header_cells(text, rows.delimiter)
            except ValueError:
                continue
        fitted = _fitted(cells, rows)
        if fitted is None or any(number_of(cell, ".") is not None for cell in fitted):
            continue
        if line_of_cells and rows.width == 1:
            # Any remark could be the name of a single column.
            continue
        return _Names(fitted, ("",) * rows.width, ("",) * rows.width, index + 1 if line_of_cells else None, {})
    return None


def _json_names(text: str) -> list[str] | None:
    """The names of columns in OpenSignals' header, device after device."""
    devices = _json_devices(text)
    names = [str(name) for device in devices for name in device.get("column", ())]
    return names or None


def _json_devices(text: str) -> list[dict[str, Any]]:
    if not text.startswith("{"):
        return []
    try:
        content = json.loads(text)
    except (ValueError, RecursionError):
        return []
    return [
        device for device in content.values() if isinstance(device, dict) and isinstance(device.get("column", []), list)
    ]


def _stated_rates(preamble: Sequence[str], delimiter: str) -> tuple[float, ...]:
    """The rates (Hz) that the lines above the rows state."""
    rates: set[float] = set()
    for index, line in enumerate(preamble):
        text = line.lstrip("#% \t")
        devices = [device.get("sampling rate") for device in _json_devices(text)]
        rates.update(float(rate) for rate in devices if isinstance(rate, (int, float)))
        if devices:
            continue
        if (match := _channel(line)) is not None:
            rates.update(float(rate["rate"]) for rate in [_CHANNEL_RATE.search(match[0])] if rate)
        elif match := _STATED.search(text[:_REMARK]):
            rates.update(rate for rate in [number_of(match[1], ".")] if rate)
        else:
            rates.update(_rate_below(preamble, index, delimiter))
    return tuple(sorted(rate for rate in rates if 0.0 < rate <= 1e6))


def _rate_below(preamble: Sequence[str], index: int, delimiter: str) -> list[float]:
    """A rate in the line below its name: Noraxon's column `frequency`, Vicon's section `Devices`."""
    below = preamble[index + 1] if index + 1 < len(preamble) else ""
    if preamble[index].strip(' ,;\t"').lower() == "devices":
        rate = number_of(below.strip(" ,;\t"), ".")
        return [rate] if rate else []
    if "frequency" not in preamble[index].lower():
        return []
    try:
        names, cells = split(preamble[index], delimiter), split(below, delimiter)
    except ValueError:
        return []
    found = [number_of(cell, ".") for name, cell in zip(names, cells, strict=False) if name.lower() == "frequency"]
    return [rate for rate in found if rate]


def _promised(preamble: Sequence[str]) -> int | None:
    """How many rows the header promises."""
    channels = [int(match["count"]) for line in preamble if (match := _channel(line))]
    if channels:
        return max(channels)
    found = [int(match[1] or match[2]) for line in preamble if (match := _PROMISED.search(line[:_REMARK]))]
    return found[-1] if found and len(str(found[-1])) < 16 else None


def _no_rows(source: str, lines: Sequence[str]) -> str:
    named = next(i for i, line in enumerate(lines) if line.strip())
    if named == len([line for line in lines if line.strip()]) - 1:
        return f"{source}: no rows below the header; at least one is needed"
    return f"{source}: no rows below the header, in the first {len(lines)} lines; rows of numbers are needed"


def _no_names(source: str, lines: Sequence[str], rows: _Rows) -> str:
    above = [line for line in lines[: rows.start] if line.strip()]
    if not above:
        return (
            f"{source}, line {rows.start + 1}: is a row of numbers; names, for example time,RF,VM, are needed above "
            "it, or header row 0 for a file without"
        )
    return (
        f"{source}, line {rows.start + 1}: holds {_described(rows)}, and no line above names as many; a line of names "
        "is needed, or another delimiter, decimal mark or header row"
    )
