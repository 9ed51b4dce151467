"""Read a topic of named values, such as activations or raw EMG, from a bag."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from limb_nodes.errors import UserError
from limb_nodes.foundation.arrays import FloatArray


@dataclass(frozen=True)
class NamedValues:
    """A topic's values over time.

    topic: its absolute name. names: one per column. values: [messages, names]. times: [messages], s, as stamped.
    ticks: [messages].
    """

    topic: str
    names: tuple[str, ...]
    values: FloatArray
    times: FloatArray
    ticks: npt.NDArray[np.uint64]

    def place(self, row: int) -> str:
        """How an error names a message."""
        return f"topic {self.topic}, tick {self.ticks[row]}"


def is_bag(path: str | Path) -> bool:
    """Whether a path is to be read as a bag: a folder, or the file of messages in one."""
    # os.path, because a long line of constants is no path and makes pathlib raise.
    return os.path.isdir(path) or Path(path).suffix.lower() in {".mcap", ".db3"}


def read_named_values(path: str | Path, topics: Sequence[str]) -> NamedValues:
    """Read the first of several topics that a bag has, of a type with `name`, `activation` and `tick`.

    Raises UserError if the bag cannot be read, has none of the topics, or the topic is of another kind.
    """
    # Only here: rosbags takes a fifth of a second to import, and most sources are no bags.
    from limb_nodes.bags.read import BagReader

    with BagReader(path) as reader:
        topic = next((topic for topic in topics if reader.has(topic)), None)
        if topic is None:
            either = " or ".join(topics)
            raise UserError(f"{path}: no message on {either}; the bag has {', '.join(reader.topics) or 'no topic'}")
        table = reader.table(topic)
    missing = [field for field in ("name", "activation", "tick") if field not in table]
    if missing:
        raise UserError(
            f"{path}: topic {topic} has no field {', '.join(missing)}; "
            "messages like limb_msgs/MuscleActivation are needed"
        )
    names = tuple(str(name) for name in table["name"])
    values = table["activation"]
    if values.shape[1:] != (len(names),):
        raise UserError(
            f"{path}: topic {topic} has {len(names)} names and {values.shape[1]} values; one each is needed"
        )
    return NamedValues(topic, names, values, table["time"], table["tick"])
