"""Read raw recordings (EMG and the joint angles beside it) from text files and bags."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from limb_nodes.errors import FieldError, UserError
from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.foundation.parameter import Parameter
from limb_nodes.signals.named_values import is_bag, read_named_values
from limb_nodes.signals.table import TextTable, check_times, read_table

RAW_TOPIC = "emg_raw"
RATE = Parameter("rate", "Hz", "samples per second", above=0.0, maximum=1e6)


@dataclass(frozen=True)
class Recording:
    """Channels sampled together at one rate.

    source: the file or bag, as the user named it.
    names, units: one per channel; the unit is "" if the recording does not state one.
    values: [samples, channels], in the channels' units; NaN if a value is missing. Samples at
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

    A file is a text table (`limb_nodes.signals.table`), with or without a column of times. A bag holds its channels
    as messages with `name` and `activation` on `topic`.

    rate: samples per second; if None, it follows from the times, or from the header.

    Raises UserError if the input cannot be read, its rate is unknown or contradicts its times, or its times do not
    rise evenly; FieldError if the rate that was given is at fault.
    """
    if rate is not None:
        RATE.check(rate)
    if is_bag(path):
        return _from_bag(path, rate, topic)
    return _from_table(read_table(path), rate)


def _from_table(table: TextTable, rate: float | None) -> Recording:
    if not table.names:
        raise UserError(f"{table.source}: no column beside the times; at least one channel is needed")
    values, notes = _without_empty_end(table.source, table.values)
    if table.times is not None:
        times = table.times[: len(values)]
        values, rate, missing = _on_even_times(table.source, times, values, table.place, rate)
        notes += missing
    elif rate is None:
        rate = _stated_rate(table)
    promised = table.header.rows
    if promised not in (None, len(values)):
        notes += (f"the header promises {promised} values, {len(values)} are there",)
    return Recording(table.source, table.names, table.units, values, rate, notes)


def _stated_rate(table: TextTable) -> float:
    """The one rate (Hz) that the header states."""
    rates = table.header.rates
    if len(rates) == 1 and rates[0] > 0.0:
        return rates[0]
    stated = f"states {' and '.join(f'{rate:g}' for rate in rates)}" if rates else "states no"
    raise FieldError(
        "rate",
        f"is missing: there are no times, and the header {stated} samples per second; {RATE.allowed()} is needed",
        table.source,
    )


def _from_bag(path: str | Path, rate: float | None, topic: str) -> Recording:
    series = read_named_values(path, (topic,))
    values, empty = _without_empty_end(f"{path}: topic {series.topic}", series.values)
    values, rate, missing = _on_even_times(str(path), series.times[: len(values)], values, series.place, rate)
    return Recording(str(path), series.names, ("",) * len(series.names), values, rate, empty + missing)


def _without_empty_end(source: str | Path, values: FloatArray) -> tuple[FloatArray, tuple[str, ...]]:
    """Leave out the rows at the end that hold no value at all, and note how many."""
    filled = np.flatnonzero(np.isfinite(values).any(axis=1))
    if not filled.size:
        raise UserError(f"{source}: holds no value; at least one sample is needed")
    kept = int(filled[-1]) + 1
    empty = len(values) - kept
    return values[:kept], (f"rows without any value at the end, left out: {empty}",) if empty else ()


def _on_even_times(
    source: str, times: FloatArray, values: FloatArray, place: Callable[[int], str], rate: float | None
) -> tuple[FloatArray, float, tuple[str, ...]]:
    """Find the rate of evenly spaced times, and put NaN where rows between are missing.

    times: [rows] in s; values: [rows, channels]; place: how an error names a row.
    Returns values [samples, channels], the rate in Hz, and notes.
    """
    if len(times) < 2:
        raise UserError(f"{source}: holds one row; at least 2 are needed for a rate")
    check_times(source, times, place)
    steps, duration = np.diff(times), times[-1] - times[0]
    step = float(np.median(steps)) if rate is None else 1.0 / rate
    ticks = np.concatenate([[0], np.cumsum(np.maximum(1, np.rint(steps / step)).astype(np.int64))])
    measured = _plain_rate(ticks[-1] / duration, duration)
    if rate is not None and abs(measured - rate) * duration > 1.0:
        raise FieldError("rate", f"is {rate:g}; {measured:g} in Hz is needed, as the times say, or no rate", source)
    rate = measured if rate is None else rate
    late = np.abs(times - times[0] - ticks / rate) * rate
    if late.max() > 0.5:
        worst = int(late.argmax())
        raise UserError(
            f"{source}, {place(worst)}: time is {times[worst]:.9g}; times at an even distance, here {1 / rate:g} s, "
            "are needed"
        )
    missing = int(ticks[-1]) + 1 - len(ticks)
    if not missing:
        return values, rate, ()
    whole = np.full((int(ticks[-1]) + 1, values.shape[1]), np.nan)
    whole[ticks] = values
    return whole, rate, (f"rows missing between the first and the last time: {missing}",)


def _plain_rate(rate: float, duration: float) -> float:
    """Round a rate to six digits if that moves the last sample by less than 1 % of a step."""
    plain = float(f"{rate:.6g}")
    return plain if abs(plain - rate) * duration < 0.01 else rate
