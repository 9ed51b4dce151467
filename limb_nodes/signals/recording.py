"""Read raw recordings (EMG and the joint angles beside it) from text files, bags and C3D files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from limb_nodes.errors import FieldError, UserError
from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.signals import units
from limb_nodes.signals.bag_field import BagOptions
from limb_nodes.signals.c3d import read_c3d
from limb_nodes.signals.clock import RATE, Fitted, fit_clock
from limb_nodes.signals.named_values import is_bag
from limb_nodes.signals.table import Clock, TextTable, read_table
from limb_nodes.signals.text_options import TextOptions

# Muscles are not recorded that slowly: such times are in another unit than s, or count samples.
_SLOWEST = 10.0


# Seconds in a stamp of ROS are a number of 32 bits.
LONGEST = 2**31


@dataclass(frozen=True)
class Recording:
    """Channels sampled together at one rate.

    source: the file or bag, as the user named it.
    names, units: one per channel; the unit is "" if the recording does not state one.
    values: [samples, channels], in the channels' units; NaN if a value is missing. Samples at
        the end that miss every channel are left out.
    rate: samples per second (Hz).
    notes: what a person should know about this recording, one sentence each.
    start: time of the first sample (s) as the recording counts it, from 1970 on if its times do; None without times.
    skipped: columns that were left out as asked, before they were read.
    """

    source: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    values: FloatArray
    rate: float
    notes: tuple[str, ...] = ()
    start: float | None = None
    skipped: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Raise UserError if it lasts longer than the stamps of ROS can tell."""
        if not len(self.values) < LONGEST * self.rate:
            raise UserError(
                f"{self.source}: lasts {len(self.values) / self.rate:.6g} s at {self.rate:g} Hz; less than "
                f"{LONGEST} s, as the stamps of ROS hold, is needed"
            )

    def unit(self, name: str) -> str:
        """The unit of a channel."""
        return self.units[self.names.index(name)]


def read_recording(
    path: str | Path, *, rate: float | None = None, text: TextOptions | None = None, bag: BagOptions | None = None
) -> Recording:
    """Read a recording from a text file, from a bag or from a C3D file.

    A file is a text table (`limb_nodes.signals.table`), with or without a column of times. A bag holds its channels as
    numbers in messages, with their names (`limb_nodes.signals.bag_recording`). Times give an even clock
    (`limb_nodes.signals.clock`). Of a C3D file the analog channels are read (`limb_nodes.signals.c3d`).

    rate: samples per second, whatever the times say; if None, it follows from them, or from the header.
    text: how a text file is to be read. bag: what of a bag is read.

    Raises UserError if the input cannot be read, its rate is unknown, or its times have no even clock; FieldError if
    an option is at fault or could decide.
    """
    if rate is not None:
        RATE.check(rate)
    if is_bag(path):
        # Only here: it reads recordings too.
        from limb_nodes.signals.bag_recording import read_bag_recording

        return read_bag_recording(path, rate, bag)
    if Path(path).suffix.lower() == ".c3d":
        names, unit_names, values, own_rate, notes = read_c3d(path)
        return Recording(str(path), names, unit_names, values, own_rate if rate is None else rate, notes)
    return _from_table(read_table(path, text), text or TextOptions(), rate)


def _from_table(table: TextTable, text: TextOptions, rate: float | None) -> Recording:
    if not table.names:
        raise UserError(f"{table.source}: no column beside the times; at least one channel is needed")
    notes = list(table.notes)
    kept = _signals(table, text.wanted, notes)
    if not kept:
        raise UserError(
            f"{table.source}: no channel of EMG is left of {', '.join(table.names)}; at least one is needed"
        )
    chosen = [i for i in kept if table.columns[i].unit in units.VOLTAGE or not table.columns[i].unit] or kept
    chosen = [i for i in chosen if table.names[i] in text.wanted] or chosen
    clock, beside = _clock(table, chosen, kept)
    values = table.values if beside == list(range(len(table.names))) else table.values[:, beside]
    values, empty = without_empty_end(table.source, values)
    notes += empty
    promised = table.layout.promised
    if promised not in (None, len(values)):
        notes.append(f"the header promises {promised} values, {len(values)} are there")
    stated = _stated(table, chosen)
    start = None
    if clock is None:
        rate = _needed_rate(table, stated) if rate is None else rate
    else:
        fitted = fit_clock(table.source, clock.times[: len(values)], table.place, rate, stated)
        if rate is None:
            _check_unit(table, clock, fitted)
            notes += _clock_notes(table, clock, fitted.rate, stated)
        values, rate, start = fitted.even(values), fitted.rate, fitted.start
        notes += fitted.notes
        others = [i for i in kept if i not in beside]
        values, beside = _with_slower_angles(table, fitted, values, beside, others, notes)
    return Recording(
        table.source, tuple(table.names[i] for i in beside), tuple(table.columns[i].unit for i in beside), values, rate,
        tuple(notes), start, table.skipped,
    )  # fmt: skip


def _signals(table: TextTable, wanted: Sequence[str], notes: list[str]) -> list[int]:
    """The columns that may be EMG or angles, or that are asked for; what the others are is noted."""
    kept = []
    for index, column in enumerate(table.columns):
        nameless = column.name in table.nameless and not column.unit
        kind = "a column without a name" if nameless else column.kind
        if kind and column.name not in wanted:
            notes.append(f"{column.name} left out: {kind}")
        else:
            kept.append(index)
    return kept


def _clock(table: TextTable, chosen: list[int], kept: list[int]) -> tuple[Clock | None, list[int]]:
    """The times of the chosen columns, and all columns that share them."""
    if not table.clocks:
        return None, kept
    if len(table.clocks) == 1:
        return table.clocks[0], kept
    clocks = [clock for clock in table.clocks if any(i in clock.columns for i in chosen)]
    first = clocks[0]
    for other in clocks[1:]:
        # Both end where their stamps do; rows that only one of them has are missing in the other.
        both = np.isfinite(first.times) & np.isfinite(other.times)
        step = _median_step(first.times)
        same = both.any() and np.abs(first.times[both] - other.times[both]).max() <= 0.5 * step
        ends = np.isfinite(first.times).sum(), np.isfinite(other.times).sum()
        if not same or abs(int(ends[0]) - int(ends[1])) > 0.01 * max(ends):
            names = [table.names[next(i for i in clock.columns if i in chosen)] for clock in (first, other)]
            rates = [1.0 / max(_median_step(clock.times), 1e-300) for clock in (first, other)]
            raise FieldError(
                "skip",
                f"is not clear: {names[0]} has {rates[0]:.6g} Hz and {names[1]} {rates[1]:.6g} Hz; channels of one "
                "rate are needed, the others skipped",
                table.source,
            )
    shared = [i for i in kept if any(i in clock.columns for clock in clocks)]
    longest = max(clocks, key=lambda clock: int(np.isfinite(clock.times).sum()))
    return longest, shared


def _median_step(times: FloatArray) -> float:
    good = times[np.isfinite(times)]
    return float((good[-1] - good[0]) / (len(good) - 1)) if len(good) > 1 else 0.0


def _with_slower_angles(
    table: TextTable, fitted: Fitted, values: FloatArray, beside: list[int], others: list[int], notes: list[str]
) -> tuple[FloatArray, list[int]]:
    """Angles with times of their own at the times of the EMG; what else has another clock is left out, and noted."""
    added = []
    ticks = fitted.start + np.arange(len(values)) / fitted.rate
    for index in others:
        column = table.columns[index]
        clock = next(clock for clock in table.clocks if index in clock.columns)
        good = np.isfinite(clock.times) & np.isfinite(table.values[:, index])
        rate = f"{1.0 / _median_step(clock.times):.6g} Hz" if _median_step(clock.times) > 0.0 else "no rate"
        if column.unit in units.ANGLE and good.any() and (np.diff(clock.times[good]) > 0.0).all():
            added.append(np.interp(ticks, clock.times[good], table.values[good, index], np.nan, np.nan))
            beside = [*beside, index]
            notes.append(f"{column.name} taken from {rate} by straight lines")
        else:
            unit = f" ({column.unit})" if column.unit else ""
            notes.append(f"{column.name}{unit} left out: it has {rate}")
    return (np.column_stack([values, *added]) if added else values), beside


def _stated(table: TextTable, chosen: list[int]) -> float | None:
    """The one rate (Hz) that the header states for the chosen columns, or None."""
    rates = {table.rates[i] for i in chosen if i in table.rates} or set(table.layout.stated)
    return rates.pop() if len(rates) == 1 else None


def _needed_rate(table: TextTable, stated: float | None) -> float:
    if stated is not None:
        return stated
    rates = table.layout.stated
    said = f"states {' and '.join(f'{rate:g}' for rate in rates)}" if rates else "states no"
    raise FieldError(
        "rate",
        f"is missing: there are no times, and the header {said} samples per second; {RATE.allowed()} is needed",
        table.source,
    )


def _check_unit(table: TextTable, clock: Clock, fitted: Fitted) -> None:
    """Raise FieldError if whole numbers without a unit may be seconds, milliseconds or a count."""
    stated = next((column.unit for column in table.layout.columns if column.name == clock.name), "")
    whole = np.array_equal(clock.times[:100], np.rint(clock.times[:100]), equal_nan=True)
    if not stated and clock.unit == "s" and whole and fitted.rate <= _SLOWEST and fitted.count >= 20:
        raise FieldError(
            "units",
            f"of {clock.name} is not clear: {fitted.rate:g} Hz if it is in s, {1e3 * fitted.rate:g} Hz if in ms; "
            f"{clock.name}=s or {clock.name}=ms is needed, or a rate",
            table.source,
        )


def _clock_notes(table: TextTable, clock: Clock, rate: float, stated: float | None) -> list[str]:
    if stated is not None and stated == rate:
        return [f"rate {rate:.9g} Hz as the header states; the times of {clock.name} agree"]
    if stated is not None:
        return [f"rate {rate:.9g} Hz from the times of {clock.name}; the header states {stated:g} Hz"]
    return [f"rate {rate:.9g} Hz from the times of {clock.name}"] if len(table.clocks) > 1 else []


def without_empty_end(source: str | Path, values: FloatArray) -> tuple[FloatArray, tuple[str, ...]]:
    """Leave out the rows at the end that hold no value at all, and note how many."""
    kept = len(values)
    while kept and not np.isfinite(values[kept - 1]).any():
        kept -= 1
    if not kept:
        raise UserError(f"{source}: holds no value; at least one sample is needed")
    empty = len(values) - kept
    return values[:kept], (f"rows without any value at the end, left out: {empty}",) if empty else ()
