"""Read a text table: named columns of numbers, whatever program wrote it, and the times beside them.

`text_layout` concludes from the first lines how the file is written; pandas parses the rest, block by block.
"""

from __future__ import annotations

import csv
import io
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from limb_nodes.errors import FieldError, UserError
from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.foundation.section import describe
from limb_nodes.signals import units
from limb_nodes.signals.column import Column, numbered
from limb_nodes.signals.text_file import TextFile
from limb_nodes.signals.text_layout import MISSING, Layout, number_of, read_layout, split
from limb_nodes.signals.text_options import TextOptions

if TYPE_CHECKING:
    import pandas as pd

# So many cells of a column of numbers may hold something else; they count as missing, and are told.
MOST_WRONG = 1e-3
# Seconds since 1970 in our century, and the same in smaller units.
_EPOCH = (9e8, 5e9)
_TRUTH = (b"rue", b"RUE", b"alse", b"ALSE")
_LONGEST_NAME = 80
_SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs", " ": "blanks"}


@dataclass(frozen=True)
class Clock:
    """A column of times and what it belongs to.

    name: as the header has it. unit: as stated or concluded. times: [rows], s, NaN if a cell is empty.
    columns: indexes of the columns beside it.
    """

    name: str
    unit: str
    times: FloatArray
    columns: tuple[int, ...]


@dataclass(frozen=True)
class TextTable:
    """Columns of numbers with their names, and the times beside them.

    source: the file, as the user named it.
    layout: how the file is written.
    columns: one for each column but those of times; `name` is never empty nor given twice.
    values: [rows, columns], in the columns' units; NaN if a cell is empty.
    clocks: the columns of times; more than one if columns of several rates stand side by side.
    rates: by column, the rate (Hz) that is stated above it.
    lines: blocks of rows, each as its first row and the line of that row, or the lines of all its rows.
    nameless: columns that the header does not name. repeated: names that several columns had.
    skipped: columns that were left out as asked.
    notes: what a person should know of how the file was read, one sentence each.
    """

    source: str
    layout: Layout
    columns: tuple[Column, ...]
    values: FloatArray
    clocks: tuple[Clock, ...]
    rates: dict[int, float]
    lines: tuple[tuple[int, int | npt.NDArray[np.int64]], ...]
    nameless: frozenset[str] = frozenset()
    repeated: tuple[str, ...] = ()
    skipped: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """The columns' names."""
        return tuple(column.name for column in self.columns)

    @property
    def units(self) -> tuple[str, ...]:
        """The columns' units; "" if the file does not state one."""
        return tuple(column.unit for column in self.columns)

    def place(self, row: int) -> str:
        """How an error names a row."""
        first, lines = next(block for block in reversed(self.lines) if block[0] <= row)
        return f"line {lines + row - first if isinstance(lines, int) else lines[row - first]}"

    def needed_times(self) -> FloatArray:
        """Times [rows] in s. Raises UserError if there are none, or if one is not after the one before."""
        if not self.clocks:
            raise UserError(f"{self.source}: no column 'time' in s; there are {', '.join(self.names)}")
        if len(self.clocks) > 1:
            named = ", ".join(clock.name for clock in self.clocks)
            raise FieldError("time", f"is not clear: there are {named}; one column of times is needed", self.source)
        check_times(self.source, self.clocks[0].times, self.place)
        return self.clocks[0].times


def read_table(path: str | Path, options: TextOptions | None = None) -> TextTable:
    """Read the numbers of a text file.

    Empty cells (also `nan`, `NA`, `null`) become NaN. Columns of text are left out, and noted.

    Raises UserError if the file is not there, is no text, has no header, or has a row of another width or too many
    cells that are no number; FieldError if more than one reading is possible or an option does not fit.
    """
    options = (options or TextOptions()).checked()
    file = TextFile(path, options.encoding)
    try:
        lines = file.head()
        layout = read_layout(str(path), lines, options)
        names = _Naming(str(path), layout, options)
        cells = _Cells(str(path), layout, names.parsed, names.labels, several=len(names.times) > 1)
        for block in file.blocks(layout.start):
            if not cells.take(block):
                break
        cells.finish()
    finally:
        file.close()
    return _table(str(path), file.encoding, names, cells)


def check_times(source: str, times: FloatArray, place: Callable[[int], str]) -> None:
    """Raise UserError if a time is missing or not after the one before.

    times: [rows], s. place: how an error names a row.
    """
    good = np.concatenate([np.isfinite(times[:1]), np.diff(times) > 0.0])
    if not good.all():
        row = int(good.argmin())
        allowed = f"a number > {times[row - 1]:.12g}, the time before," if row else "a number"
        raise UserError(f"{source}, {place(row)}: time {is_value(times[row])}; {allowed} in s is needed")


def is_value(value: float) -> str:
    """What an error says of a number: `is 1.5`, or `is missing` for NaN."""
    return "is missing" if np.isnan(value) else f"is {value:.12g}"


class _Naming:
    """Which columns there are, under which names, and what is parsed of them."""

    def __init__(self, source: str, layout: Layout, options: TextOptions) -> None:
        self.layout = layout
        self.columns = list(layout.columns)
        self.notes: list[str] = []
        self.repeated: tuple[str, ...] = ()
        self.labels = self._unique_names()
        self.nameless = frozenset(
            label for label, column in zip(self.labels, self.columns, strict=True) if not column.name
        )
        self._units(source, options)
        self.skipped = tuple(dict.fromkeys(options.skip))
        skip = {self.index(source, "skip", name) for name in self.skipped}
        self.text = {index for index in range(len(self.columns)) if index not in skip and self._is_text(index)}
        # A delimiter at the end of the lines makes a column without name and cells.
        last = len(self.columns) - 1
        trailing = {last} if not layout.columns[last].name and not any(row[last] for row in layout.sample) else set()
        self.candidates = [i for i in range(last + 1) if i not in skip | self.text | trailing]
        self.times = self._times(source, options)
        self.parsed = self.candidates

    def index(self, source: str, field_: str, name: str) -> int:
        """The column that a person names, with or without its unit. Raises FieldError if there is none."""
        if name in self.labels:
            return self.labels.index(name)
        raise FieldError(field_, f"names {name!r}; one of {', '.join(self.labels)} is needed", source)

    def _unique_names(self) -> list[str]:
        names = [_shortened(column.name) or f"column {i + 1}" for i, column in enumerate(self.columns)]
        kept = [i for i, column in enumerate(self.columns) if not column.says_time]
        twice = {name for name, count in Counter(names[i] for i in kept).items() if count > 1}
        groups = self.layout.groups
        if twice and all(groups[i] for i in kept if names[i] in twice):
            names = [f"{groups[i]} {name}" if name in twice else name for i, name in enumerate(names)]
        seen = Counter(names)
        again = sorted({name for i, name in enumerate(names) if i in kept and seen[name] > 1})
        if again:
            self.repeated = tuple(again)
            self.notes += [f"{seen[name]} columns are named {name}: {name}, {name} (2) ..." for name in again]
        return numbered(names)

    def _units(self, source: str, options: TextOptions) -> None:
        for name, text in options.units.items():
            unit = units.unit_named(text) or text
            for index in [self.index(source, "units", name)] if name else range(len(self.columns)):
                column = self.columns[index]
                if name or (not column.unit and not column.says_time):
                    self.columns[index] = Column(column.name, unit)

    def _is_text(self, index: int) -> bool:
        cells = [row[index] for row in self.layout.sample if row[index].lower() not in MISSING]
        numbers = sum(self.layout.number(cell) is not None for cell in cells)
        return len(cells) > 2 * numbers

    def _numbers(self, index: int) -> FloatArray:
        cells = [self.layout.number(row[index]) for row in self.layout.sample]
        return np.array([np.nan if cell is None else cell for cell in cells])

    def _times(self, source: str, options: TextOptions) -> list[int]:
        """The columns of times among those that are parsed."""
        if options.time is not None:
            index = self.index(source, "time", options.time)
            if index not in self.candidates:
                raise FieldError(
                    "time", f"names {options.time!r}, which holds no numbers; a column that does is needed", source
                )
            if self.columns[index].unit not in units.TIME:
                raise FieldError(
                    "time", f"names {options.time!r} in {self.columns[index].unit}; s, ms or us is needed", source
                )
            self._leave_out_times(index)
            return [index]
        if options.no_times:
            self._leave_out_times(None)
            return []
        said = [i for i, column in enumerate(self.columns) if column.says_time and column.name not in options.wanted]
        named = [i for i in said if i in self.candidates]
        # Times of columns that are left out have nothing beside them.
        ends = dict(zip(said, [*said[1:], len(self.columns)], strict=False))
        alone = [i for i in named if ends[i] > i + 1 and not any(i < k < ends[i] for k in self.candidates)]
        if len(alone) < len(named):
            named = [i for i in named if i not in alone]
            self.candidates = [i for i in self.candidates if i not in alone]
        if len(named) > 1 and not self._side_by_side(named):
            self._one_of(source, named)
            self._leave_out_times(named[0])
            return named[:1]
        return named or self._even(source, options)

    def _leave_out_times(self, kept: int | None) -> None:
        others = [i for i in self.candidates if self.columns[i].says_time and i != kept]
        self.candidates = [i for i in self.candidates if i not in others]
        if others:
            self.notes.append(f"times not used: {', '.join(self.labels[i] for i in others)}")

    def _side_by_side(self, named: Sequence[int]) -> bool:
        """Whether each column of times is followed by columns of its own."""
        ends = [*named[1:], len(self.columns)]
        first = [i for i in self.candidates if i < named[0] and not self.columns[i].kind]
        return not first and all(
            any(begin < i < end and i not in named for i in self.candidates)
            for begin, end in zip(named, ends, strict=True)
        )

    def _one_of(self, source: str, named: Sequence[int]) -> None:
        """Raise FieldError if columns of times disagree."""
        relative = []
        for index in named:
            numbers = self._numbers(index)
            relative.append((numbers - numbers[0]) * units.TIME[_time_unit(self.columns[index], numbers)])
        step = np.nanmedian(np.diff(relative[0])) if len(relative[0]) > 1 else 0.0
        if any(not np.allclose(other, relative[0], atol=0.5 * step, rtol=1e-4, equal_nan=True) for other in relative):
            listed = " or ".join(repr(self.labels[i]) for i in named)
            raise FieldError("time", f"is not clear: {listed} holds times; one of both, or no times, is needed", source)

    def _even(self, source: str, options: TextOptions) -> list[int]:
        """A column without a name of times whose values rise evenly, and no count of rows."""
        if self.layout.stated or self.layout.rates or len(self.layout.sample) < 10:
            return []
        found = []
        for index in self.candidates:
            column, values = self.columns[index], self._numbers(index)
            steps = np.diff(values)
            if column.unit in units.TIME and not column.kind and self.labels[index] not in options.wanted:
                even = np.isfinite(steps).all() and steps[0] > 0.0 and np.ptp(steps) < 0.05 * steps.mean()
                if even and not np.array_equal(values, np.rint(values)):
                    found.append(index)
        if len(found) > 1:
            listed = " or ".join(repr(self.labels[i]) for i in found)
            raise FieldError(
                "time", f"is not clear: {listed} rises evenly; one of both, or no times, is needed", source
            )
        if found:
            self.notes.append(f"times are those of {self.labels[found[0]]}, which rises evenly")
        return found


def _shortened(name: str) -> str:
    """A name that fits into a line."""
    return name if len(name) <= _LONGEST_NAME else f"{name[: _LONGEST_NAME - 3]}..."


def _time_unit(column: Column, values: FloatArray) -> str:
    """The unit of a column of times; if none is stated, by the size of times since 1970, else s."""
    first = float(np.nanmax(np.abs(values))) if np.isfinite(values).any() else 0.0
    if not column.unit:
        for unit in ("ms", "us", "ns"):
            if _EPOCH[0] <= first * units.TIME[unit] <= _EPOCH[1] and first > _EPOCH[1]:
                return unit
    return column.unit or "s"


@dataclass
class _Wrong:
    """Cells of one column that hold no number: how many, and the first: its row and text. numbers: cells that do."""

    count: int = 0
    row: int = 0
    text: str = ""
    numbers: int = 0


@dataclass
class _Cells:
    """The cells of all rows, filled block by block.

    parsed: indexes of the columns that are parsed. labels: the names of all columns.
    several: whether columns of several rates stand side by side, so that rows may end early.
    texts: columns that are parsed as text, for a cell of them was no number.
    """

    source: str
    layout: Layout
    parsed: list[int]
    labels: list[str]
    several: bool
    blocks: list[FloatArray] = field(default_factory=list)
    lines: list[tuple[int, int | npt.NDArray[np.int64]]] = field(default_factory=list)
    texts: set[int] = field(default_factory=set)
    wrong: dict[int, _Wrong] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    rows: int = 0
    line: int = -1
    blank_before: bool = False
    blanks: int = 0
    short: str = ""
    longest: int = 0

    def take(self, block: bytes) -> bool:
        """Add the rows of a block of lines; False if the table has ended."""
        if self.short:
            raise UserError(self.short)
        if self.line < 0:
            self.line = self.layout.start
        if not block:
            return True
        # The first line of the block, counted from 1.
        first = self.line + 1
        ends = _ends(block)
        counts = self._counts(block, ends)
        other = np.flatnonzero(counts != len(self.layout.columns))
        kept = np.ones(len(ends), dtype=bool)
        more = True
        for index in other.tolist():
            text = _line(block, ends, index)
            if not text.strip():
                kept[index] = False
                continue
            if self._is_after_blank(index, kept) and self._is_no_row(text):
                self._note_rest(first + int(index), text)
                kept[index:] = False
                more = False
                break
            if counts[index] < len(self.layout.columns) and self.several:
                continue
            problem = (
                f"{self.source}, line {first + index}: holds {counts[index]} columns; "
                f"{len(self.layout.columns)} are needed, as in the header"
            )
            if (
                counts[index] < len(self.layout.columns)
                and index == len(ends) - 1
                and len(text) < max(self.longest, int(np.diff(ends).max(initial=0)))
            ):
                # The last line of a file that was cut.
                self.short = problem
                kept[index] = False
                continue
            raise UserError(problem)
        self.longest = max(self.longest, int(np.diff(ends).max(initial=0)))
        self.blank_before = bool(len(kept)) and not kept[-1]
        self.line += len(ends)
        numbers: int | npt.NDArray[np.int64] = first
        if not kept.all():
            lines = np.flatnonzero(kept)
            starts = _starts(ends)
            block = b"".join(block[starts[i] : ends[i] + 1] for i in lines)
            numbers = lines + first
        count = int(kept.sum())
        if count:
            self.lines.append((self.rows, numbers))
            self.blocks.append(self._parsed(block, count))
            self.rows += count
        return more

    def finish(self) -> None:
        """What is known after the last block. Raises UserError if there is no row or a column holds too much text."""
        if self.short:
            self.notes.append(f"line {self.line} is not complete, as if the file was cut: left out")
        if not self.rows:
            raise UserError(f"{self.source}: no rows below the header; at least one is needed")

    def place(self, row: int) -> int:
        """The line of a row."""
        first, lines = next(block for block in reversed(self.lines) if block[0] <= row)
        return int(lines + row - first if isinstance(lines, int) else lines[row - first])

    def _counts(self, block: bytes, ends: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
        """How many cells each line holds."""
        signs = np.frombuffer(block, dtype=np.uint8)
        starts = _starts(ends)
        if self.layout.delimiter == " ":
            filled = signs > 32
            begins = filled.copy()
            begins[1:] &= ~filled[:-1]
            counts = np.add.reduceat(begins, starts, dtype=np.int64)
        else:
            counts = np.add.reduceat(signs == ord(self.layout.delimiter), starts, dtype=np.int64) + 1
        if b'"' in block:
            for index in np.flatnonzero(np.add.reduceat(signs == ord('"'), starts, dtype=np.int64)).tolist():
                try:
                    counts[index] = len(split(_line(block, ends, index), self.layout.delimiter))
                except ValueError:
                    counts[index] = 0
        return counts

    def _is_after_blank(self, index: int, kept: npt.NDArray[np.bool_]) -> bool:
        return self.blank_before if index == 0 else not kept[index - 1]

    def _is_no_row(self, text: str) -> bool:
        try:
            cells = split(text, self.layout.delimiter)
        except ValueError:
            return True
        filled = [cell for cell in cells if cell]
        return bool(filled) and sum(self.layout.number(cell) is not None for cell in filled) <= len(filled) / 2

    def _note_rest(self, line: int, text: str) -> None:
        self.notes.append(f"another table, from line {line} on ({describe(text.strip())}): left out")

    def _parsed(self, block: bytes, count: int) -> FloatArray:
        """The numbers of a block: [rows, parsed columns]; NaN if a cell is empty or wrong."""
        # pandas takes the words of truth for numbers.
        texts = set(self.parsed) if any(word in block for word in _TRUTH) else self.texts
        frame = self._frame(block, texts)
        if frame is None:
            self.texts |= {column for column in self.parsed if self._frame(block, self.texts, [column]) is None}
            texts = self.texts
            frame = self._frame(block, texts)
        if frame is None or len(frame) != count:
            raise UserError(
                f"{self.source}, line {self.place(self.rows)} or below: a cell in quotation marks goes on in the next "
                "line; a row in one line is needed"
            )
        values = np.empty((count, len(self.parsed)))
        for index, column in enumerate(self.parsed):
            wrong = self.wrong.setdefault(column, _Wrong())
            if column in texts:
                values[:, index] = self._tolerant(frame[column].to_numpy(dtype=object), wrong)
            else:
                values[:, index] = frame[column].to_numpy()
                wrong.numbers += int(np.isfinite(values[:, index]).sum())
        return values

    def _frame(self, block: bytes, texts: set[int], columns: list[int] | None = None) -> pd.DataFrame | None:
        """Columns of a block, numbers but for those of text; None if there is something else among the numbers."""
        # Only here: pandas takes a third of a second to import.
        import pandas as pd

        columns = self.parsed if columns is None else columns
        numbers = [column for column in columns if column not in texts]
        try:
            frame = pd.read_csv(
                io.BytesIO(block),
                sep=r"\s+" if self.layout.delimiter == " " else self.layout.delimiter,
                decimal=self.layout.decimal,
                header=None,
                names=list(range(len(self.layout.columns))),
                usecols=columns,
                index_col=False,
                dtype={column: np.float64 if column in numbers else str for column in columns},
                na_values={column: list(MISSING) for column in numbers},
                keep_default_na=False,
                skipinitialspace=True,
                skip_blank_lines=False,
                engine="c",
                low_memory=False,
                encoding_errors="replace",
                **(
                    {}
                    if tuple(map(int, pd.__version__.split(".")[:2])) >= (3, 1)
                    else {"float_precision": "round_trip"}
                ),
            )  # type: ignore[call-overload]
        except (ValueError, pd.errors.ParserError):
            return None
        infinite = any(np.isinf(frame[column].to_numpy()).any() for column in numbers)
        return None if infinite else frame

    def _tolerant(self, cells: npt.NDArray[np.object_], wrong: _Wrong) -> FloatArray:
        """Numbers of cells [rows]; what is neither number nor missing becomes NaN and is kept in mind."""
        values = np.full(len(cells), np.nan)
        decimal = self.layout.decimal
        for row, cell in enumerate(cells):
            text = cell if isinstance(cell, str) else ""
            number = number_of(text, decimal)
            if number is not None and abs(number) < float("inf"):
                values[row] = number
                wrong.numbers += 1
            elif text.strip().lower() not in MISSING:
                if not wrong.count:
                    wrong.row, wrong.text = self.rows + row, text.strip()
                wrong.count += 1
        return values


def _ends(block: bytes) -> npt.NDArray[np.int64]:
    """Where the lines of a block end."""
    return np.flatnonzero(np.frombuffer(block, dtype=np.uint8) == 10)


def _starts(ends: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Where the lines that end there begin."""
    return np.concatenate([[0], ends[:-1] + 1])


def _line(block: bytes, ends: npt.NDArray[np.int64], index: int) -> str:
    start = int(ends[index - 1]) + 1 if index else 0
    return block[start : int(ends[index])].decode("utf-8", errors="replace")


def _table(source: str, encoding: str, names: _Naming, cells: _Cells) -> TextTable:
    """The table of what was parsed: columns of numbers, times aside."""
    layout = names.layout
    left, notes = _left_out(source, names, cells)
    times = [i for i in names.times if i not in left]
    kept = [i for i in names.candidates if i not in left and i not in times]
    at = {index: column for column, index in enumerate(cells.parsed)}
    values = np.empty((cells.rows, len(kept)))
    clock = {index: np.empty(cells.rows) for index in times}
    chosen, row = [at[index] for index in kept], 0
    # Each block goes when it is copied, so that memory holds the numbers once.
    cells.blocks.reverse()
    while cells.blocks:
        block = cells.blocks.pop()
        values[row : row + len(block)] = block[:, chosen]
        for index in times:
            clock[index][row : row + len(block)] = block[:, at[index]]
        row += len(block)
    clocks = []
    for number, index in enumerate(times):
        end = times[number + 1] if number + 1 < len(times) else len(layout.columns)
        beside = tuple(k for k, i in enumerate(kept) if len(times) == 1 or index < i < end)
        unit = _time_unit(names.columns[index], clock[index][:: max(1, cells.rows // 100)])
        if unit != (names.columns[index].unit or "s"):
            notes.append(f"times of {names.labels[index]} taken in {unit}, by their size")
        clock[index] *= units.TIME[unit]
        clocks.append(Clock(_cell_name(names, index), unit, clock[index], beside))
    return TextTable(
        source, layout,
        tuple(Column(names.labels[i], names.columns[i].unit) for i in kept),
        values, tuple(clocks), {kept.index(i): rate for i, rate in layout.rates.items() if i in kept},
        tuple(cells.lines), names.nameless, names.repeated, names.skipped,
        (*_reading(encoding, layout), *names.notes, *notes, *cells.notes),
    )  # fmt: skip


def _cell_name(names: _Naming, index: int) -> str:
    return names.columns[index].name or names.labels[index]


def _left_out(source: str, names: _Naming, cells: _Cells) -> tuple[set[int], list[str]]:
    """The columns that hold no numbers, and what is to be told of them and of single wrong cells.

    Raises UserError if text and numbers are mixed in a column.
    """
    left, notes = set(), []
    if names.text:
        notes.append(f"columns of text, left out: {', '.join(names.labels[i] for i in sorted(names.text))}")
    for index, wrong in cells.wrong.items():
        name = names.labels[index]
        if not wrong.numbers and (not names.layout.columns[index].unit or wrong.count):
            if index in names.times:
                continue
            left.add(index)
            notes.append(f"{name} holds no number: left out")
        elif wrong.count > max(1, MOST_WRONG * cells.rows) or (wrong.count and cells.rows < 1 / MOST_WRONG):
            place = f"{source}, line {cells.place(wrong.row)}"
            raise UserError(
                f"{place}: {name} is {describe(wrong.text)}; a finite number is needed, or the column skipped"
            )
        elif wrong.count:
            others = f", and {wrong.count - 1} other cells" if wrong.count > 1 else ""
            notes.append(
                f"{name} is {describe(wrong.text)} in line {cells.place(wrong.row)}{others}: no number, taken as "
                "missing"
            )
    if left and not [i for i in names.candidates if i not in left and i not in names.times]:
        raise UserError(f"{source}: holds no value; at least one sample is needed")
    return left, notes


def _reading(encoding: str, layout: Layout) -> Iterator[str]:
    """How the file is written, if it is not the plainest way."""
    ways = []
    if layout.delimiter not in ",\t":
        ways.append(f"{_SEPARATORS[layout.delimiter]} between columns")
    if layout.decimal == ",":
        ways.append("decimal comma")
    if layout.names_line not in (None, 1):
        ways.append(f"names in line {layout.names_line}")
    if encoding not in {"utf-8", "ascii"}:
        ways.append(f"encoding {encoding}")
    if ways:
        yield f"read with {', '.join(ways)}"


# The widest cell that csv reads.
csv.field_size_limit(131_072)
