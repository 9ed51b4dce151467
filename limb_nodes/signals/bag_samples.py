"""The samples in messages of many values: which value belongs to which channel, and to which sample."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from limb_nodes.errors import FieldError, UserError
from limb_nodes.foundation.arrays import FloatArray, IntArray
from limb_nodes.signals.bag_field import BagField, BagOptions

if TYPE_CHECKING:
    from limb_nodes.bags.fields import Block

MOST_CHANNELS = 10_000
_CHANNEL = ("ch", "muscle", "electrode", "sensor", "emg", "lead", "col")
_SAMPLE = ("sample", "time", "frame", "tick", "row", "scan")


@dataclass(frozen=True)
class _Layout:
    """What a std_msgs/MultiArrayLayout says: labels, sizes and strides of its dimensions, the first outermost."""

    labels: tuple[str, ...]
    sizes: tuple[int, ...]
    strides: tuple[int, ...]
    offset: int

    def names(self, count: int) -> tuple[str, ...]:
        """The channels' names, if labels hold them; count: values in a message."""
        for label, size in zip(self.labels, self.sizes, strict=True):
            parts = tuple(part.strip() for part in label.split(","))
            if len(parts) == size > 1:
                return parts
        each = len(self.labels) == count > 1 and set(self.sizes) <= {0, 1} and len(set(self.labels)) == count
        return self.labels if each and all(self.labels) else ()

    def shape(self) -> tuple[tuple[str, int, int], ...]:
        """Label, size and step of each dimension that has more than one place; empty if the strides fit no order."""
        sizes, strides = self.sizes, self.strides
        inner = [int(np.prod(sizes[i + 1 :], dtype=object)) for i in range(len(sizes))]
        by_definition = [*strides[1:], 1]
        if not any(strides):
            steps = inner
        elif all(step >= own for step, own in zip(by_definition, inner, strict=True)) and strides[0] in (
            0,
            by_definition[0] * sizes[0],
        ):
            steps = by_definition
        elif sorted(zip(strides, sizes, strict=True))[0][0] == 1 and _steps_fit(strides, sizes):
            # Many writers put the step of each dimension there, as numpy has it.
            steps = list(strides)
        else:
            return ()
        return tuple(zip(self.labels, sizes, steps, strict=True))


def _steps_fit(steps: Sequence[int], sizes: Sequence[int]) -> bool:
    """Whether steps lead to a different value for each place, without a value between."""
    expected = 1
    for step, size in sorted(zip(steps, sizes, strict=True)):
        if step != expected:
            return False
        expected *= size
    return True


class Samples:
    """Arranges the values of messages as [messages, samples, channels].

    source: the bag, as the user named it. field: which is read. names: of the channels, once there is a message.
    """

    def __init__(self, source: str, field: BagField, options: BagOptions) -> None:
        self.names: tuple[str, ...] = ()
        self._source = source
        self._field = field
        self._options = options

    def arranged(self, block: Block) -> Iterator[tuple[IntArray, FloatArray]]:
        """The messages of a block that hold values: their rows, [messages], and values [messages, samples, channels].

        Raises UserError if their names are not those of the messages before; FieldError if it is not told which value
        belongs to which channel.
        """
        raw = block.numbers.get(self._field.path)
        if raw is None or raw.size == 0:
            return
        if raw.ndim == 3:
            names = self._names_in(block, None, raw.shape[1])
            if len(names) != raw.shape[1]:
                raise self._wrong_count(block.rows[0], raw.shape[1], names)
            yield block.rows, self._in_order(np.swapaxes(raw, 1, 2), names, block.rows[0])
            return
        values = raw.reshape(len(raw), -1)
        for members, layout in self._layouts(block):
            names = self._names_in(block, layout, values.shape[1])
            places = self._places(layout, block.rows[members[0]], values.shape[1], names)
            yield block.rows[members], self._in_order(values[members][:, places], names, block.rows[members[0]])

    def _layouts(self, block: Block) -> Iterator[tuple[IntArray, _Layout | None]]:
        """The members of a block that share a layout, by their index."""
        path = self._field.layout
        sizes = None if path is None else block.numbers.get(f"{path}.dim.size")
        if sizes is None or not sizes.size:
            yield np.arange(len(block.rows)), None
            return
        strides, offset = block.numbers[f"{path}.dim.stride"], block.numbers[f"{path}.data_offset"]
        every = np.concatenate([sizes, strides, offset[:, np.newaxis]], axis=1).astype(np.int64)
        kinds, kind_of = np.unique(every, axis=0, return_inverse=True)
        labels = block.texts[f"{path}.dim.label"]
        for index, kind in enumerate(kinds.tolist()):
            count = len(labels)
            layout = _Layout(labels, tuple(kind[:count]), tuple(kind[count : 2 * count]), kind[-1])
            yield np.flatnonzero(kind_of.reshape(-1) == index), layout

    def _names_in(self, block: Block, layout: _Layout | None, count: int) -> tuple[str, ...]:
        """The names of the channels, as they stand in the messages of a block that hold `count` values."""
        names, own = tuple(self._options.names), block.texts.get(self._field.names or "", ())
        labels = () if layout is None else layout.names(count)
        if own or not names or set(names) < set(labels):
            names = own or labels
        if not names:
            raise FieldError(
                "names",
                f"is missing, for {self._place(block.rows[0])} names no channels of its {count} values; "
                "a name for each channel, such as RF,VM, is needed",
                self._source,
            )
        if len(names) > MOST_CHANNELS:
            raise UserError(
                f"{self._source}: {self._place(block.rows[0])} has {len(names)} names; at most {MOST_CHANNELS} are read"
            )
        for name, times in Counter(names).items():
            if not name or times > 1:
                problem = f"{'names two channels' if name else 'has the name'} {name!r}; different names are needed"
                if names == tuple(self._options.names):
                    raise FieldError("names", problem)
                raise UserError(f"{self._source}: {self._place(block.rows[0])} {problem}")
        return names

    def _in_order(self, values: FloatArray, names: tuple[str, ...], row: int) -> FloatArray:
        """Values [messages, samples, channels] in the order of the first message's names."""
        self.names = self.names or names
        if names != self.names:
            if sorted(names) != sorted(self.names):
                raise UserError(
                    f"{self._source}: {self._place(row)} names {_short(names)}; the names of the first message, "
                    f"{_short(self.names)}, are needed"
                )
            values = values[..., [names.index(name) for name in self.names]]
        return values.astype(np.float64, copy=False)

    def _places(self, layout: _Layout | None, row: int, count: int, names: Sequence[str]) -> IntArray:
        """Where the value of each sample and channel stands in a message of `count` values: [samples, channels]."""
        channels = len(names)
        shape = () if layout is None else layout.shape()
        offset = 0 if layout is None else layout.offset
        inside = count - offset
        if self._options.rows is None and layout is not None:
            shape = tuple(part for part in shape if part[1] != 1) if len(shape) > 1 else shape
            if len(shape) == 2:
                return self._two_dimensions(shape, offset, row, count, names)
        if inside <= 0 or inside % channels:
            raise self._wrong_count(row, inside, names)
        samples = inside // channels
        if samples > 1 and channels > 1 and self._options.rows is None:
            raise self._ambiguous(row, inside, names)
        places = offset + np.arange(inside)
        if self._options.rows == "channels":
            return places.reshape(channels, samples).T
        return places.reshape(samples, channels)

    def _two_dimensions(
        self, shape: Sequence[tuple[str, int, int]], offset: int, row: int, count: int, names: Sequence[str]
    ) -> IntArray:
        """As `_places`, for dimensions of channels and of samples."""
        labels = [label.strip().lower() for label, _, _ in shape]
        told = {i for i in (0, 1) if labels[i].startswith(_CHANNEL)}
        told |= {1 - i for i in (0, 1) if labels[i].startswith(_SAMPLE) or labels[i] == "t"}
        told = told or {i for i in (0, 1) if shape[i][1] == len(names)}
        if len(told) != 1:
            raise self._ambiguous(row, count, names)
        across = told.pop()
        (_, channels, channel_step), (_, samples, sample_step) = shape[across], shape[1 - across]
        if channels != len(names):
            raise self._wrong_count(row, channels, names)
        last = offset + (channels - 1) * channel_step + (samples - 1) * sample_step
        if last >= count:
            raise UserError(
                f"{self._source}: {self._place(row)} holds {count} values; {last + 1} are needed, as its layout says"
            )
        return offset + sample_step * np.arange(samples)[:, np.newaxis] + channel_step * np.arange(channels)

    def _ambiguous(self, row: int, count: int, names: Sequence[str]) -> FieldError:
        return FieldError(
            "rows",
            f"is missing: {self._place(row)} holds {count} values of {len(names)} channels and does not tell "
            "their order; samples, if one sample stands after the other, or channels, if one channel does, is needed",
            self._source,
        )

    def _wrong_count(self, row: int, count: int, names: Sequence[str]) -> UserError:
        needed = f"{len(names)} are needed, one for each of {_short(names)}"
        place = self._place(row)
        if tuple(names) == tuple(self._options.names):
            return FieldError("names", f"is {_short(names)}; {count} names are needed, as {place} has", self._source)
        return UserError(f"{self._source}: {place} holds {count} values; {needed}")

    def _place(self, row: int) -> str:
        return f"topic {self._field.topic}, message {int(row) + 1}"


def _short(names: Sequence[str]) -> str:
    return ", ".join(names[:8]) + (f" and {len(names) - 8} more" if len(names) > 8 else "")
