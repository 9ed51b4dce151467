"""Read a topic of named values, such as activations or raw EMG, from a bag."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import TYPE_CHECKING

import numpy as np

from limb_nodes.bags.folder import is_bag_file
from limb_nodes.errors import FieldError, UserError
from limb_nodes.foundation.arrays import FloatArray, IntArray
from limb_nodes.signals.bag_field import BagField, BagOptions, choose
from limb_nodes.signals.bag_samples import Samples

if TYPE_CHECKING:
    from limb_nodes.bags.fields import Block

_LEAST_IN_PACKETS = 30
APART = 1e-6
"""Stamps and times of reception that differ by more than this (s) are two things."""


@dataclass(frozen=True)
class NamedValues:
    """A topic's values over time.

    topic: its absolute name. names: one per column. values: [samples, names]. times: [samples], s from the first
    message on. stamped: whether they are stamps in the messages, not times of reception. start: the first message's
    time, ns. ticks: [samples], the counter in the messages if it rises, or the number of the message, from 1 on.
    counter: what `ticks` is called. notes: what a person should know, one sentence each.
    """

    topic: str
    names: tuple[str, ...]
    values: FloatArray
    times: FloatArray
    stamped: bool
    start: int
    ticks: IntArray
    counter: str
    notes: tuple[str, ...]

    def place(self, row: int) -> str:
        """How an error names a sample."""
        return f"topic {self.topic}, {self.counter} {self.ticks[row]}"


def is_bag(path: str | Path) -> bool:
    """Whether a path is to be read as a bag: a folder, or the file of messages in one."""
    # os.path, because a long line of constants is no path and makes pathlib raise.
    if os.path.isdir(path):
        return True
    return is_bag_file(PurePath(path))


def read_named_values(
    path: str | Path, topics: Sequence[str], options: BagOptions | None = None, rate: float | None = None
) -> NamedValues:
    """Read a field of numbers from a topic, with the names of its columns.

    topics: the first of these that has a message is read, if the options name no topic. If none has one, and one
    field of the whole bag holds floats with names, that one is read.
    rate: samples per second (Hz), which spaces the samples within a message; None takes it from the messages' times.

    Raises UserError if the bag cannot be read, has no such field, or its messages differ in their names; FieldError if
    an option is at fault or is needed.
    """
    # Only here: rosbags takes a fifth of a second to import, and most sources are no bags.
    from limb_nodes.bags.read import BagReader

    options = options or BagOptions()
    with BagReader(path) as reader:
        field, notes = choose(reader, topics, options)
        received, blocks = reader.blocks(field.topic, field.paths)
    samples = Samples(str(path), field, options)
    parts = [part for block in sorted(blocks, key=lambda one: one.rows[0]) for part in samples.arranged(block)]
    counts = np.zeros(len(received), dtype=np.int64)
    for rows, values in parts:
        counts[rows] = values.shape[1]
    filled = np.flatnonzero(counts)
    if not len(filled):
        raise UserError(f"{path}: topic {field.topic} holds no value in {field.path}; at least one sample is needed")
    if len(filled) < len(counts):
        notes += (f"messages without values on {field.topic}, left out: {len(counts) - len(filled)}",)
    stamped = _whole(blocks, field.stamp, filled)
    stamps, order, said = _stamps(str(path), field, options, received[filled], stamped)
    used = stamped is not None and np.array_equal(stamps, stamped[order])
    order = filled[order]
    starts = np.zeros(len(received), dtype=np.int64)
    starts[order[1:]] = np.cumsum(counts[order])[:-1]
    table = np.empty((int(counts.sum()), len(samples.names)))
    for rows, values in parts:
        table[starts[rows][:, np.newaxis] + np.arange(values.shape[1])] = values
    relative = stamps - stamps[0] if used else _in_packets(stamps - stamps[0])
    times, said_too = _times(str(path), field, relative, counts[order], rate)
    ticks = _whole(blocks, field.tick, order) if counts.max() == 1 else None
    counter = "tick"
    if ticks is None or not (np.diff(ticks) > 0).all():
        counter = "message"
        ticks = np.repeat(order + 1, counts[order])
    series = NamedValues(
        field.topic, samples.names, table, times, used, int(stamps[0]), ticks, counter, notes + said + said_too
    )
    _check_finite(str(path), series)
    return series


def _whole(blocks: Sequence[Block], path: str | None, rows: IntArray) -> IntArray | None:
    """A whole number of some messages, in their order; None without a path."""
    if path is None or not all(path in block.numbers for block in blocks):
        return None
    result = np.zeros(1 + max(int(block.rows[-1]) for block in blocks), dtype=np.int64)
    for block in blocks:
        result[block.rows] = block.numbers[path]
    return result[rows]


def _stamps(
    source: str, field: BagField, options: BagOptions, received: IntArray, stamped: IntArray | None
) -> tuple[IntArray, IntArray, tuple[str, ...]]:
    """The times (ns) of messages, rising, the order of messages in which they rise, and what is to be said of it.

    received: when the recorder got each message, ns. stamped: the stamps in the messages, ns.
    """
    order = np.arange(len(received))
    if options.stamps == "received":
        return received, order, ()
    if stamped is None:
        if options.stamps == "header":
            raise FieldError(
                "stamps", f"is header; received is needed, for messages on {field.topic} hold no stamp", source
            )
        return received, order, ()
    rises = np.diff(stamped) > 0
    if rises.all():
        apart = float(np.abs((stamped - stamped[0]) - (received - received[0])).max()) * 1e-9
        if options.stamps is None and apart > APART:
            said = f"times are the stamps in the messages; times of reception differ by up to {apart:.3g} s"
            return stamped, order, (said,)
        return stamped, order, ()
    row = int(rises.argmin()) + 1
    where = f"message {row + 1} of {field.topic} is stamped {_after(stamped, row)} s, the one before "
    where += f"{_after(stamped, row - 1)} s after the first"
    if options.stamps is None:
        return received, order, (f"times are those of reception, for the stamps do not rise: {where}",)
    order = np.argsort(stamped, kind="stable")
    if not (np.diff(stamped[order]) > 0).all():
        raise FieldError("stamps", f"is header; received is needed, for stamps are there twice: {where}", source)
    moved = int((order != np.arange(len(order))).sum())
    return stamped[order], order, (f"messages put in the order of their stamps: {moved}",)


def _in_packets(received: IntArray) -> IntArray:
    """Times of reception (ns); messages that came in packets, one right behind the other, all at that of the last."""
    steps = np.diff(received)
    behind = steps < 0.25 * received[-1] / max(1, len(steps))
    if len(steps) < _LEAST_IN_PACKETS or behind.mean() < 0.6:
        return received
    last = np.flatnonzero(np.concatenate([~behind, [True]]))
    result: IntArray = np.repeat(received[last], np.diff(last, prepend=-1))
    return result


def _after(stamps: IntArray, row: int) -> str:
    """How long (s) after the first stamp another is."""
    return f"{(int(stamps[row]) - int(stamps[0])) * 1e-9:.9g}"


def _times(
    source: str, field: BagField, stamps: IntArray, counts: IntArray, rate: float | None
) -> tuple[FloatArray, tuple[str, ...]]:
    """The time (s) of each sample, and a note if messages hold several.

    stamps: [messages], ns, of the last sample in each message. counts: [messages], samples in each.
    """
    times = np.asarray(stamps * 1e-9, dtype=np.float64)
    if counts.max() == 1:
        return times, ()
    if rate is not None:
        step = 1.0 / rate
    elif len(times) > 1:
        step = float(np.median(np.diff(times) / counts[1:]))
    else:
        raise FieldError(
            "rate",
            f"is missing, for all samples on {field.topic} are in one message; a number > 0 in Hz is needed",
            source,
        )
    behind = np.repeat(np.cumsum(counts), counts) - 1 - np.arange(counts.sum())
    several = f"{counts.min()}" if counts.min() == counts.max() else f"{counts.min()} to {counts.max()}"
    return (
        np.repeat(times, counts) - behind * step,
        (f"messages on {field.topic} hold {several} samples; each message's time is that of its last sample",),
    )


def _check_finite(source: str, series: NamedValues) -> None:
    """Raise UserError if a value is infinite; NaN is a value that is missing."""
    infinite = np.isinf(series.values).any(axis=1)
    if infinite.any():
        row = int(infinite.argmax())
        column = int(np.isinf(series.values[row]).argmax())
        raise UserError(
            f"{source}, {series.place(row)}: {series.names[column]} is {series.values[row, column]}; "
            "a finite number, or NaN if it is missing, is needed"
        )
