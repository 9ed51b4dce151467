"""Read a text table: named columns of numbers, separated by tabs or commas."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from limb_nodes.errors import UserError
from limb_nodes.foundation.arrays import FloatArray, IntArray
from limb_nodes.foundation.section import describe

TIME_UNITS = {"": 1.0, "s": 1.0, "sec": 1.0, "seconds": 1.0, "ms": 1e-3, "us": 1e-6}
VOLTAGE_UNITS = frozenset({"V", "mV", "uV", "µV", "μV", "nV"})
ANGLE_UNITS = {"deg": np.pi / 180, "degree": np.pi / 180, "degrees": np.pi / 180, "°": np.pi / 180, "rad": 1.0}
_OTHER_UNITS = frozenset({"Hz", "N", "Nm", "N m", "g", "m", "mm", "m/s", "m/s2", "m/s^2", "deg/s", "rad/s", "%"})
_KNOWN_UNITS = frozenset(TIME_UNITS) | VOLTAGE_UNITS | frozenset(ANGLE_UNITS) | _OTHER_UNITS
_NAME_AND_UNIT = re.compile(r"(?P<name>.*?)\s*[\[(](?P<unit>[^\])]*)[\])]")
_MISSING = frozenset({"", "na", "n/a", "nan"})


@dataclass(frozen=True)
class Table:
    """Columns of numbers with their names.

    source: the file, as the user named it.
    names, units: one per column; the unit is "" where the file does not state one.
    values: [rows, columns]; NaN where a cell is empty.
    lines: [rows], the line of the file that each row stands on, counted from 1.
    """

    source: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    values: FloatArray
    lines: IntArray

    def time_column(self) -> int | None:
        """Index of the column of times (named `time`, `timestamp` or `t`), or None."""
        for index, (name, unit) in enumerate(zip(self.names, self.units, strict=True)):
            if (name.lower() in {"time", "timestamp"} or name == "t") and unit in TIME_UNITS:
                return index
        return None


def read_table(path: str | Path) -> Table:
    """Read a tab- or comma-separated file whose first line names the columns.

    A column's name may carry its unit, `RF [mV]` or `time (s)`. Lines that start with `#` above the
    header are passed over. Empty cells (also `nan`, `NA`) become NaN.

    Raises UserError where the file is not there, is not text, has no header line, or holds a
    row of another width or a cell that is not a finite number.
    """
    lines = read_lines(path)
    first = next((i for i, line in enumerate(lines) if line.strip() and not line.startswith("#")), None)
    if first is None:
        raise UserError(f"{path}: the file is empty; a header line and rows of numbers are needed")
    header = lines[first]
    delimiter = delimiter_of(header)
    try:
        cells = [cell.strip() for cell in next(csv.reader([header], delimiter=delimiter))]
    except csv.Error as error:
        raise UserError(f"{path}, line {first + 1}: not a line of column names ({error})") from None
    if all(_is_number(cell) for cell in cells):
        raise UserError(
            f"{path}, line {first + 1}: numbers where the header is expected; "
            "the first line must name the columns, for example time,RF,VM"
        )
    names, units = zip(*(_split_unit(cell) for cell in cells), strict=True)
    check_names(path, first + 1, names)
    values, numbers = parse_rows(path, lines, first + 1, delimiter, names)
    return Table(str(path), tuple(names), tuple(units), values, numbers)


def read_lines(path: str | Path) -> list[str]:
    """Read the lines of a text file. Raises UserError where there is no such text file."""
    file = Path(path)
    if file.is_dir():
        raise UserError(f"{path}: is a folder; a text file is expected")
    if not file.exists():
        raise UserError(f"{path}: no such file")
    try:
        content = file.read_bytes()
    except OSError as error:
        raise UserError(f"{path}: cannot be read ({error.strerror})") from error
    if b"\0" in content:
        raise UserError(f"{path}: not a text file; tab- or comma-separated text is expected")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = content.decode("latin-1")
    return text.splitlines()


def delimiter_of(line: str) -> str:
    """Return the separator of a line's cells: a tab where it has one, else a comma."""
    return "\t" if "\t" in line else ","


def check_names(path: str | Path, line: int, names: Sequence[str]) -> None:
    """Raise UserError where a column has no name or a name stands twice."""
    for index, name in enumerate(names):
        if not name:
            raise UserError(f"{path}, line {line}: column {index + 1} has no name; every column needs one")
        if name in names[:index]:
            raise UserError(f"{path}, line {line}: the column name '{name}' stands twice; names must differ")


def parse_rows(
    path: str | Path, lines: Sequence[str], start: int, delimiter: str, names: Sequence[str]
) -> tuple[FloatArray, IntArray]:
    """Parse the rows of numbers below a header.

    lines: all lines of the file; start: index of the first line after the header.
    Returns values [rows, columns], NaN where a cell is empty, and line numbers [rows], from 1.
    Blank lines at the end do not count. Raises UserError that names the line and column.
    """
    end = len(lines)
    while end > start and not lines[end - 1].strip(" \r\n"):
        end -= 1
    if end == start:
        raise UserError(f"{path}: no rows below the header; at least one is needed")
    width = len(names)
    rows: list[list[float]] = []
    numbers: list[int] = []
    reader = csv.reader(lines[start:end], delimiter=delimiter)
    try:
        for row in reader:
            number = start + reader.line_num
            cells = row or [""]
            if len(cells) != width:
                raise UserError(f"{path}, line {number}: {len(cells)} columns; the header has {width}")
            rows.append([_number(path, number, name, cell) for name, cell in zip(names, cells, strict=True)])
            numbers.append(number)
    except csv.Error as error:
        raise UserError(f"{path}, line {start + reader.line_num}: not a row of numbers ({error})") from None
    return np.array(rows, dtype=np.float64).reshape(len(rows), width), np.array(numbers, dtype=np.int64)


def _number(path: str | Path, line: int, name: str, cell: str) -> float:
    try:
        value = float(cell)
    except ValueError:
        if cell.strip().lower() in _MISSING:
            return float("nan")
        raise UserError(f"{path}, line {line}, column {name}: {describe(cell.strip())} is not a number") from None
    if value in (float("inf"), float("-inf")):
        raise UserError(f"{path}, line {line}, column {name}: {describe(cell.strip())} is not finite")
    return value


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _split_unit(cell: str) -> tuple[str, str]:
    """Split `RF [mV]` into name and unit; brackets that hold no known unit belong to the name."""
    match = _NAME_AND_UNIT.fullmatch(cell)
    if match and match["unit"] and match["unit"] in _KNOWN_UNITS:
        return match["name"], match["unit"]
    return cell, ""
