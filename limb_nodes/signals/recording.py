"""Read raw recordings (EMG and the joint angles beside it) from text files and bags."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from limb_nodes.errors import UserError
from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.signals.named_values import is_bag, read_named_values
from limb_nodes.signals.table import TIME_UNITS, Table, check_names, delimiter_of, parse_rows, read_lines, read_table

RAW_TOPIC = "emg_raw"
MOST_RATE = 1e6

_CHANNEL = re.compile(
    r"Channel\s+\d+:\s*'(?P<name>[^']*)'\s*,\s*(?P<count>\d+)\s+values\s*,"
    r"\s*engineering units:\s*(?P<unit>[^,\s]+?)\s*[,.]?(?:\s.*)?"
)
_CHANNEL_RATE = re.compile(r"(?P<rate>\d+(?:\.\d+)?)\s+samples per second")


@dataclass(frozen=True)
class Recording:
    """Channels sampled together at one rate.

    source: the file or bag, as the user named it.
    names, units: one per channel; the unit is "" where the recording does not state one.
    values: [samples, channels], in the channels' units; NaN where a value is missing. Samples at
        the end that miss every channel are left out.
    rate: samples per second (Hz).
    notes: what a person should know about this recording, one sentence each.
    """

    source: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    values: FloatArray
    rate: float
    notes: tuple[str, ...] = ()

    def unit(self, name: str) -> str:
        """The unit of a channel."""
        return self.units[self.names.index(name)]


def read_recording(path: str | Path, *, rate: float | None = None, topic: str = RAW_TOPIC) -> Recording:
    """Read a recording from a text file or from a bag.

    A file is tab- or comma-separated text under either a line of column names, with an optional column
    of times, or a header of lines such as `Channel 1: 'RF', 13480 values, engineering units: mV, ...`.
    A bag (a folder) holds its channels as messages with `name` and `activation` on `topic`.

    rate: samples per second; where None it follows from the times, or from the header.

    Raises UserError where the input cannot be read, its rate is unknown or contradicts its times, or
    its times do not rise evenly.
    """
    if rate is not None and not 0 < rate <= MOST_RATE:
        raise UserError(f"rate {rate:g}: must be greater than 0 Hz and at most {MOST_RATE:g}")
    if is_bag(path):
        return _read_bag(path, rate, topic)
    lines = read_lines(path)
    heads = {i: match for i, line in enumerate(lines[:200]) if (match := _CHANNEL.fullmatch(line.strip()))}
    if heads:
        return _read_channel_header(path, lines, heads, rate)
    return _from_table(read_table(path), rate)


def _read_channel_header(
    path: str | Path, lines: Sequence[str], heads: Mapping[int, re.Match[str]], rate: float | None
) -> Recording:
    """Read rows below lines that describe the channels. heads: the match of each such line, by index."""
    start = max(heads) + 1
    while start < len(lines) and not lines[start].strip(" \r\n"):
        start += 1
    names = tuple(match["name"] for match in heads.values())
    units = tuple(match["unit"] for match in heads.values())
    check_names(path, max(heads) + 1, names)
    if rate is None:
        rate = _header_rate(path, heads)
    separator = delimiter_of(lines[start]) if start < len(lines) else ","
    values, _ = parse_rows(path, lines, start, separator, names)
    values, notes = _without_empty_end(path, values)
    expected = max(int(match["count"]) for match in heads.values())
    if expected != len(values):
        notes += (f"the header promises {expected} values, {len(values)} are there",)
    return Recording(str(path), names, units, values, rate, notes)


def _header_rate(path: str | Path, heads: Mapping[int, re.Match[str]]) -> float:
    found = {_CHANNEL_RATE.search(match[0]) for match in heads.values()}
    rates = {float(match["rate"]) for match in found if match}
    if not rates:
        raise UserError(f"{path}: the header does not state samples per second; give --rate HZ")
    if len(rates) > 1 or min(rates) <= 0:
        shown = " and ".join(f"{rate:g}" for rate in sorted(rates))
        raise UserError(f"{path}: the header states {shown} samples per second; give --rate HZ")
    return rates.pop()


def _from_table(table: Table, rate: float | None) -> Recording:
    column = table.time_column()
    if column is None:
        if rate is None:
            raise UserError(f"{table.source}: no column of times and no rate; give --rate HZ")
        values, notes = _without_empty_end(table.source, table.values)
        return Recording(table.source, table.names, table.units, values, rate, notes)
    keep = [i for i in range(len(table.names)) if i != column]
    if not keep:
        raise UserError(f"{table.source}: no column beside the times; at least one channel is needed")
    values, empty = _without_empty_end(table.source, table.values[:, keep])
    times = table.values[: len(values), column] * TIME_UNITS[table.units[column]]
    places = [f"line {line}" for line in table.lines[: len(values)]]
    values, rate, notes = _on_even_times(table.source, times, values, places, rate)
    names = tuple(table.names[i] for i in keep)
    units = tuple(table.units[i] for i in keep)
    return Recording(table.source, names, units, values, rate, empty + notes)


def _read_bag(path: str | Path, rate: float | None, topic: str) -> Recording:
    series = read_named_values(path, (topic,))
    values, empty = _without_empty_end(f"{path}: topic {series.topic}", series.values)
    places = [f"tick {tick}" for tick in series.ticks[: len(values)]]
    values, rate, notes = _on_even_times(str(path), series.times[: len(values)], values, places, rate)
    return Recording(str(path), series.names, ("",) * len(series.names), values, rate, empty + notes)


def _without_empty_end(source: str | Path, values: FloatArray) -> tuple[FloatArray, tuple[str, ...]]:
    """Leave out the rows at the end that hold no value at all, and note how many."""
    filled = np.flatnonzero(np.isfinite(values).any(axis=1))
    if not filled.size:
        raise UserError(f"{source}: nothing but missing values; at least one sample is needed")
    kept = int(filled[-1]) + 1
    empty = len(values) - kept
    return values[:kept], (f"rows without any value at the end, left out: {empty}",) if empty else ()


def _on_even_times(
    source: str, times: FloatArray, values: FloatArray, places: Sequence[str], rate: float | None
) -> tuple[FloatArray, float, tuple[str, ...]]:
    """Find the rate of evenly spaced times, and put NaN where rows between are missing.

    times: [rows] in s; values: [rows, channels]; places: [rows], how an error names a row.
    Returns values [samples, channels], the rate in Hz, and notes.
    """
    if len(times) < 2:
        raise UserError(f"{source}: one row; at least two are needed for a rate")
    bad = np.flatnonzero(~np.isfinite(times))
    if bad.size:
        raise UserError(f"{source}, {places[bad[0]]}: the time is missing; every row needs one")
    steps = np.diff(times)
    bad = np.flatnonzero(steps <= 0)
    if bad.size:
        raise UserError(
            f"{source}, {places[bad[0] + 1]}: time {times[bad[0] + 1]:g} s; must be later than the row before"
        )
    step = float(np.median(steps)) if rate is None else 1.0 / rate
    ticks = np.concatenate([[0], np.cumsum(np.maximum(1, np.rint(steps / step)).astype(np.int64))])
    found = _plain_rate(ticks[-1] / (times[-1] - times[0]), times[-1] - times[0])
    if rate is not None and abs(found - rate) * (times[-1] - times[0]) > 1.0:
        raise UserError(f"{source}: the times give {found:g} Hz, not the rate of {rate:g} Hz; leave out --rate")
    rate = found if rate is None else rate
    late = np.abs(times - times[0] - ticks / rate) * rate
    if late.max() > 0.5:
        worst = int(late.argmax())
        raise UserError(
            f"{source}, {places[worst]}: time {times[worst]:g} s; times must be evenly spaced, here by {1 / rate:g} s"
        )
    missing = int(ticks[-1]) + 1 - len(ticks)
    if not missing:
        return values, rate, ()
    whole = np.full((int(ticks[-1]) + 1, values.shape[1]), np.nan)
    whole[ticks] = values
    return whole, rate, (f"rows missing between the first and the last time: {missing}",)


def _plain_rate(rate: float, duration: float) -> float:
    """Round a rate to six digits where that moves the last sample by less than 1 % of a step."""
    plain = float(f"{rate:.6g}")
    return plain if abs(plain - rate) * duration < 0.01 else rate
