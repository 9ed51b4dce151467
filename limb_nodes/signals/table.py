"""Read a text table: named columns of numbers, separated by tabs or commas."""

from __future__ import annotations

import csv
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from limb_nodes.errors import UserError
from limb_nodes.foundation.arrays import FloatArray, IntArray
from limb_nodes.foundation.section import describe
from limb_nodes.signals import units
from limb_nodes.signals.header import Header, read_header

_MISSING = frozenset({"", "na", "n/a", "nan"})


@dataclass(frozen=True)
class TextTable:
    """Columns of numbers with their names, and the times beside them.

    source: the file, as the user named it.
    header: what stands above the numbers.
    names, units: one per column but that of times; the unit is "" if the file does not state one.
    values: [rows, columns], in the columns' units; NaN if a cell is empty.
    times: [rows], s, NaN if a cell is empty; None if no column holds times.
    lines: [rows], the line of the file that each row ends on, counted from 1.
    """

    source: str
    header: Header
    names: tuple[str, ...]
    units: tuple[str, ...]
    values: FloatArray
    times: FloatArray | None
    lines: IntArray

    def place(self, row: int) -> str:
        """How an error names a row."""
        return f"line {self.lines[row]}"

    def needed_times(self) -> FloatArray:
        """Times [rows] in s. Raises UserError if there are none, or if one is not after the one before."""
        if self.times is None:
            raise UserError(f"{self.source}: no column 'time' in s; there are {', '.join(self.names)}")
        check_times(self.source, self.times, self.place)
        return self.times


def read_table(path: str | Path) -> TextTable:
    """Read a tab- or comma-separated file with a header, of which `limb_nodes.signals.header` knows two kinds.

    Empty cells (also `nan`, `NA`) become NaN. Times are the column named `time`, `timestamp` or `t`.

    Raises UserError if the file is not there, is no text, has no header, or has a row of another width or a cell
    that is no finite number.
    """
    lines = _read_lines(path)
    header = read_header(str(path), lines)
    cells, numbers = _read_rows(str(path), lines, header)
    time = header.time_column()
    others = [index for index in range(len(header.names)) if index != time]
    return TextTable(
        str(path),
        header,
        tuple(header.names[index] for index in others),
        tuple(header.units[index] for index in others),
        cells[:, others],
        None if time is None else cells[:, time] * units.TIME[header.units[time]],
        numbers,
    )


def check_times(source: str, times: FloatArray, place: Callable[[int], str]) -> None:
    """Raise UserError if a time is missing or not after the one before.

    times: [rows], s. place: how an error names a row.
    """
    good = np.concatenate([np.isfinite(times[:1]), np.diff(times) > 0.0])
    if not good.all():
        row = int(good.argmin())
        allowed = f"a number > {times[row - 1]:.9g}, the time before," if row else "a number"
        raise UserError(f"{source}, {place(row)}: time {is_value(times[row])}; {allowed} in s is needed")


def is_value(value: float) -> str:
    """What an error says of a number: `is 1.5`, or `is missing` for NaN."""
    return "is missing" if np.isnan(value) else f"is {value:.9g}"


def _read_lines(path: str | Path) -> list[str]:
    """The lines of a text file. Raises UserError if there is no such text file."""
    file = Path(path)
    if file.is_dir():
        raise UserError(f"{path}: is a folder; a text file is needed")
    if not file.exists():
        raise UserError(f"{path}: no such file")
    try:
        content = file.read_bytes()
    except OSError as error:
        raise UserError(f"{path}: cannot be read: {error.strerror}") from error
    if b"\0" in content:
        raise UserError(f"{path}: is no text file; tab- or comma-separated text is needed")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = content.decode("latin-1")
    return text.splitlines()


def _read_rows(source: str, lines: Sequence[str], header: Header) -> tuple[FloatArray, IntArray]:
    """The rows below a header: [rows, columns], and their lines [rows]. Blank lines at the end do not count."""
    start, end, width = header.end, len(lines), len(header.names)
    while end > start and not lines[end - 1].strip(" \r\n"):
        end -= 1
    if end == start:
        raise UserError(f"{source}: no rows below the header; at least one is needed")
    rows: list[list[float]] = []
    numbers: list[int] = []
    reader = csv.reader(lines[start:end], delimiter=header.delimiter)
    try:
        for row in reader:
            cells, number = row or [""], start + reader.line_num
            if len(cells) != width:
                raise UserError(
                    f"{source}, line {number}: holds {len(cells)} columns; {width} are needed, as in the header"
                )
            rows.append([_number(source, number, name, cell) for name, cell in zip(header.names, cells, strict=True)])
            numbers.append(number)
    except csv.Error as error:
        raise UserError(f"{source}, line {start + reader.line_num}: is no row of numbers: {error}") from None
    return np.array(rows, dtype=np.float64).reshape(len(rows), width), np.array(numbers, dtype=np.int64)


def _number(source: str, line: int, name: str, cell: str) -> float:
    try:
        value = float(cell)
    except ValueError:
        if cell.strip().lower() in _MISSING:
            return float("nan")
        value = float("inf")
    if value in (float("inf"), float("-inf")):
        raise UserError(f"{source}, line {line}: {name} is {describe(cell.strip())}; a finite number is needed")
    return value
