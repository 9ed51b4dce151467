"""Read a bag: messages, or a whole topic as arrays."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from rosbags.interfaces import Connection, MessageDefinitionFormat
from rosbags.rosbag2 import Reader
from rosbags.typesys import get_types_from_msg
from rosbags.typesys.store import Typestore
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from limb_nodes.bags.columns import Columns, columns
from limb_nodes.bags.types import RUN_INFO, absolute, limb_typestore
from limb_nodes.errors import UserError
from limb_nodes.foundation.arrays import IntArray


class BagReader:
    """Reads one bag (a rosbag2 folder, or the MCAP or sqlite3 file in it); a context manager.

    Topics may be asked for by their absolute name, or by the end of it if only one topic ends so: `joint_states`
    finds `/left/joint_states`. Types that this installation does not know are read by the definition in the bag.

    Args:
        path: the bag.

    Raises:
        UserError: there is no such bag, it is something else, or it was not closed (the line then says how to
            recover it).
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        if not self.path.exists():
            raise UserError(f"{self.path}: no such bag")
        if self.path.is_dir() and not (self.path / "metadata.yaml").exists():
            if any(self.path.glob("*.mcap")):
                raise _unfinished(self.path)
            raise UserError(f"{self.path}: is no bag; a folder with a metadata.yaml and a file of messages is needed")
        try:
            self._reader = Reader(self.path)
            self._reader.open()
        except Exception as error:  # the library has no one class for what damage can do to it
            if "end magic" in str(error):
                raise _unfinished(self.path) from None
            raise UserError(f"{self.path}: is no bag that can be read: {_one_line(error)}") from None
        self._topics: dict[str, Connection] = {}
        for connection in self._reader.connections:
            self._topics.setdefault(connection.topic, connection)

    @property
    def topics(self) -> dict[str, str]:
        """Absolute name of each topic -> its message type."""
        return {name: connection.msgtype for name, connection in sorted(self._topics.items())}

    def count(self, topic: str) -> int:
        """The number of messages of a topic, 0 if the bag does not have it."""
        name = self._find(topic)
        return sum(c.msgcount for c in self._reader.connections if c.topic == name) if name else 0

    def has(self, topic: str) -> bool:
        """Whether the bag has a topic with at least one message."""
        return self.count(topic) > 0

    def run_info(self) -> dict[str, Any]:
        """What the recorder wrote down about the run: limb, limb_file, parameters, versions, seed, command.

        Raises:
            UserError: the bag has none, or it is not a mapping in YAML.
        """
        for _, message in self.read_topic(RUN_INFO):
            try:
                info = YAML(typ="safe", pure=True).load(message.data)
            except YAMLError:
                info = None
            if isinstance(info, dict):
                return info
            raise UserError(f"{self.path}: {RUN_INFO} is no mapping in YAML; a bag that limb wrote is needed")
        raise UserError(f"{self.path}: {RUN_INFO} has no message; a bag that limb wrote is needed")

    def read_topic(self, topic: str) -> Iterator[tuple[int, Any]]:
        """The messages of a topic in the order of time.

        Returns:
            Pairs of bag time (ns; the stamp of the message in a bag of a limb) and message, which has the fields of
            the ROS message as attributes, numbers in sequences as arrays.

        Raises:
            UserError: the bag has no such topic (at the call, not at the first message), or is damaged.
        """
        connection = self._connection(topic)
        store = self._types(connection)
        return self._decoded(connection, store)

    def read_raw(self, topic: str) -> Iterator[tuple[int, bytes]]:
        """As `read_topic`, the messages serialised (CDR), as rclpy publishes them without decoding.

        Raises:
            UserError: as `read_topic`.
        """
        return self._raw(self._connection(topic))

    def table(self, topic: str) -> Columns:
        """A whole topic as arrays, for topics whose messages all have the same shape.

        Returns:
            `time`: bag time in s, shape [ticks]; `stamp`: the same in ns, int64;
            each number of the message by name: [ticks]; each sequence of n numbers: [ticks, n];
            each sequence of n messages of k numbers, such as points: [ticks, n, k];
            each text, such as the names of joints, once: [n] for a sequence, a scalar array for a single text.
            Fields of nested messages are named `outer.inner`. The header is left out.

        Raises:
            UserError: no such topic, no message in it, messages of different shape or with different names,
                or a damaged bag.
        """
        connection = self._connection(topic)
        rows = list(self._raw(connection))
        if not rows:
            raise UserError(f"{self.path}: topic {connection.topic} has no message")
        stamps: IntArray = np.array([stamp for stamp, _ in rows], dtype=np.int64)
        try:
            fields = columns([data for _, data in rows], connection.msgtype, self._types(connection))
        except ValueError as error:
            raise UserError(f"{self.path}: topic {connection.topic}: {error}") from None
        return {"time": stamps * 1e-9, "stamp": stamps, **fields}

    def close(self) -> None:
        """Close the file. Safe to call again."""
        if self._reader.is_open:
            self._reader.close()

    def __enter__(self) -> BagReader:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _find(self, topic: str) -> str | None:
        """The absolute name of a topic, or None if the bag does not have it."""
        name = absolute(topic)
        if name in self._topics:
            return name
        matches = [] if topic.startswith("/") else [known for known in self._topics if known.endswith(name)]
        if len(matches) > 1:
            raise UserError(f"{self.path}: topic {topic} is there twice; one of {', '.join(sorted(matches))} is needed")
        return matches[0] if matches else None

    def _connection(self, topic: str) -> Connection:
        name = self._find(topic)
        if name is None:
            raise UserError(f"{self.path}: no topic {topic}; the bag has {', '.join(self.topics) or 'none'}")
        return self._topics[name]

    def _types(self, connection: Connection) -> Typestore:
        """The types to decode a topic with, completed from the bag if they are not known."""
        store = limb_typestore()
        if connection.msgtype not in store.fielddefs:
            definition = connection.msgdef
            if definition.format != MessageDefinitionFormat.MSG:
                raise UserError(f"{self.path}: topic {connection.topic} has the unknown type {connection.msgtype}")
            types = get_types_from_msg(definition.data, connection.msgtype)
            store.register({name: value for name, value in types.items() if name not in store.fielddefs})
        return store

    def _raw(self, connection: Connection) -> Iterator[tuple[int, bytes]]:
        """Time (ns) and bytes of each message of the connection's topic."""
        same = [other for other in self._reader.connections if other.topic == connection.topic]
        try:
            for _, stamp, data in self._reader.messages(same):
                yield stamp, data
        except Exception as error:
            raise self._damaged(error) from None

    def _decoded(self, connection: Connection, store: Typestore) -> Iterator[tuple[int, Any]]:
        for stamp, data in self._raw(connection):
            try:
                message = store.deserialize_cdr(data, connection.msgtype)
            except Exception as error:
                raise self._damaged(error) from None
            yield stamp, message

    def _damaged(self, error: Exception) -> UserError:
        return UserError(f"{self.path}: the bag is damaged: {_one_line(error)}; try `limb recover {self.path}`")


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split()) or "it is damaged"


def _unfinished(path: Path) -> UserError:
    return UserError(f"{path}: the recorder did not close this bag; `limb recover {path}` makes a readable one of it")
