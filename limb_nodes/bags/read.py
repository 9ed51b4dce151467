"""Read a bag: messages, or a whole topic as arrays."""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Collection, Iterator, Sequence
from contextlib import ExitStack
from operator import itemgetter
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from rosbags.interfaces import Connection, MessageDefinitionFormat
from rosbags.typesys.store import Typestore

from limb_nodes.bags.columns import Columns, columns
from limb_nodes.bags.fields import Block, blocks, kinds
from limb_nodes.bags.files import BagFile, most_bytes, one_line, open_files, unpack_message
from limb_nodes.bags.types import RUN_INFO, RUN_INFO_BYTES, absolute, typestore_of
from limb_nodes.errors import UserError
from limb_nodes.foundation.arrays import IntArray
from limb_nodes.foundation.yaml_text import parse_yaml

_BATCH = 2**15
_FIRST, _LAST = -(2**63), 2**63 - 1


class BagReader:
    """Reads one bag; a context manager.

    A bag is a rosbag2 folder, with or without its metadata.yaml, or one file of messages. Its files are MCAP or
    sqlite3, one or several; files, chunks or messages may be compressed.

    Topics may be asked for by their absolute name, or by the end of it if only one topic ends so: `joint_states`
    finds `/left/joint_states`. Messages are decoded by the definition in the bag, or by that of this installation if
    there is none.

    Args:
        path: the bag.

    Raises:
        UserError: there is no such bag, it is something else, or it was not closed (the line then says how to
            recover it).
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        with ExitStack() as stack:
            self._files = open_files(self.path, stack)
            self._most_bytes = most_bytes(self.path)
            self._stack = stack.pop_all()
        self._topics: dict[str, list[tuple[BagFile, Connection]]] = {}
        for file in self._files:
            for connection in file.connections:
                self._topics.setdefault(connection.topic, []).append((file, connection))
        self._stores: dict[str, Typestore] = {}

    @property
    def topics(self) -> dict[str, str]:
        """Absolute name of each topic -> its message type."""
        return {name: parts[0][1].msgtype for name, parts in sorted(self._topics.items())}

    def count(self, topic: str) -> int:
        """The number of messages of a topic, 0 if the bag does not have it."""
        name = self._find(topic)
        return sum(connection.msgcount for _, connection in self._topics[name]) if name else 0

    def has(self, topic: str) -> bool:
        """Whether the bag has a topic with at least one message."""
        return self.count(topic) > 0

    def name(self, topic: str) -> str:
        """The absolute name of a topic. Raises UserError if the bag does not have it, or with several types."""
        name = self._find(topic)
        if name is None:
            raise UserError(f"{self.path}: no topic {topic}; the bag has {', '.join(self.topics) or 'none'}")
        types = sorted({connection.msgtype for _, connection in self._topics[name]})
        if len(types) > 1:
            raise UserError(f"{self.path}: topic {name} has messages of the types {', '.join(types)}; one is needed")
        return name

    def run_info(self) -> dict[str, Any]:
        """What the recorder wrote down about the run: limb, limb_file, parameters, versions, seed, command.

        Raises:
            UserError: the bag has none, or it is not a mapping in YAML.
        """
        for _, message in self.read_topic(RUN_INFO):
            text = getattr(message, "data", None)
            info = parse_yaml(text, f"{self.path}: {RUN_INFO}", RUN_INFO_BYTES) if isinstance(text, str) else None
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
        name = self.name(topic)
        return self._decoded(name, self._types(name))

    def read_raw(self, topic: str) -> Iterator[tuple[int, bytes]]:
        """As `read_topic`, the messages serialised (CDR), as rclpy publishes them without decoding.

        Raises:
            UserError: as `read_topic`.
        """
        return self._raw(self.name(topic))

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
        name = self.name(topic)
        stamps, messages = self._messages(name)
        return {"time": stamps * 1e-9, "stamp": stamps, **self.decoded(name, messages)}

    def together(self, topics: Sequence[str]) -> Iterator[tuple[int, dict[str, bytes]]]:
        """The serialised messages of several topics, those of one time together, with no more than a chunk in memory.

        Returns:
            Pairs of bag time (ns), rising, and the message of each topic that has one then, by absolute name;
            of several messages of a topic the last.

        Raises:
            UserError: as `read_topic`.
        """
        return self._together([self.name(topic) for topic in topics])

    def decoded(self, topic: str, messages: Sequence[bytes]) -> Columns:
        """Serialised messages of a topic as arrays, at least one; `table` says in which shape.

        Raises:
            UserError: no such topic, or messages of different shape or with different names.
        """
        name = self.name(topic)
        try:
            return columns(messages, self.topics[name], self._types(name))
        except ValueError as error:
            raise UserError(f"{self.path}: topic {name}: {error}") from None

    def kinds(self, topic: str) -> dict[str, str]:
        """The fields of a topic's type by their path, `outer.inner`, and what they hold; `fields.kinds` says how.

        Raises:
            UserError: the bag has no such topic, or its type is not known.
        """
        name = self.name(topic)
        return kinds(self.topics[name], self._types(name))

    def blocks(self, topic: str, paths: Collection[str], most: int | None = None) -> tuple[IntArray, list[Block]]:
        """Some fields of a whole topic, whose messages may differ in shape.

        Args:
            topic: as for `read_topic`.
            paths: the fields, as `kinds` names them.
            most: how many messages, from the first on; None for all.

        Returns:
            The bag time of each message, ns, and the messages as arrays, those of one shape together.

        Raises:
            UserError: no such topic, no message in it, too many shapes, or a damaged bag.
        """
        name = self.name(topic)
        store, msgtype = self._types(name), self.topics[name]
        rows = itertools.islice(self._raw(name), most)
        stamps: list[int] = []
        result: list[Block] = []
        try:
            # Messages take several times the memory of the numbers in them.
            while batch := list(itertools.islice(rows, _BATCH)):
                result += blocks([data for _, data in batch], msgtype, store, paths, len(stamps))
                stamps += [stamp for stamp, _ in batch]
        except ValueError as error:
            raise UserError(f"{self.path}: topic {name}: {error}") from None
        if not stamps:
            raise UserError(f"{self.path}: topic {name} has no message")
        return np.array(stamps, dtype=np.int64), result

    def close(self) -> None:
        """Close the file. Safe to call again."""
        self._stack.close()

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

    def _types(self, name: str) -> Typestore:
        """The types to decode a topic with, by the definition in the bag if there is one."""
        if name not in self._stores:
            connections = [connection for _, connection in self._topics[name]]
            for connection in connections:
                form = connection.ext.serialization_format  # type: ignore[union-attr]
                if form != "cdr":
                    raise UserError(f"{self.path}: topic {name} is serialised as {form}; cdr is needed")
            defined = (one for one in connections if one.msgdef.format != MessageDefinitionFormat.NONE)
            connection = next(defined, connections[0])
            try:
                self._stores[name] = typestore_of(connection.msgtype, connection.msgdef)
            except ValueError as error:
                raise UserError(
                    f"{self.path}: topic {name} has the unknown type {connection.msgtype}: {error}"
                ) from None
        return self._stores[name]

    def _messages(self, name: str) -> tuple[IntArray, list[bytes]]:
        """Time (ns) and bytes of all messages of a topic, at least one."""
        rows = list(self._raw(name))
        if not rows:
            raise UserError(f"{self.path}: topic {name} has no message")
        return np.array([stamp for stamp, _ in rows], dtype=np.int64), [data for _, data in rows]

    def _raw(self, name: str) -> Iterator[tuple[int, bytes]]:
        """Time (ns) and bytes of each message of a topic, which together must not be too large."""
        size = 0
        for _, stamp, message in self._merged([name]):
            size += len(message)
            if size > self._most_bytes:
                raise UserError(
                    f"{self.path}: topic {name} takes more than {self._most_bytes} bytes unpacked; a bag of measured "
                    "values is needed"
                )
            yield stamp, message

    def _merged(self, names: Collection[str]) -> Iterator[tuple[str, int, bytes]]:
        """Topic, time (ns) and bytes of each message of topics, of all files in the order of time."""
        parts: dict[int, list[Connection]] = {}
        for name in names:
            for file, connection in self._topics[name]:
                parts.setdefault(self._files.index(file), []).append(connection)
        try:
            files = [self._files[index].messages(connections) for index, connections in parts.items()]
            for connection, stamp, data in heapq.merge(*files, key=itemgetter(1)):
                if not _FIRST <= stamp <= _LAST:
                    raise ValueError(f"a message is of the time {stamp} ns")
                yield connection.topic, int(stamp), unpack_message(data)
        except Exception as error:
            raise self._damaged(error) from None

    def _together(self, names: Collection[str]) -> Iterator[tuple[int, dict[str, bytes]]]:
        now: int | None = None
        messages: dict[str, bytes] = {}
        for topic, stamp, data in self._merged(names):
            if stamp != now:
                if now is not None:
                    yield now, messages
                now, messages = stamp, {}
            messages[topic] = data
        if now is not None:
            yield now, messages

    def _decoded(self, name: str, store: Typestore) -> Iterator[tuple[int, Any]]:
        msgtype = self.topics[name]
        for stamp, data in self._raw(name):
            try:
                message = store.deserialize_cdr(data, msgtype)
            except Exception as error:
                raise self._damaged(error) from None
            yield stamp, message

    def _damaged(self, error: Exception) -> UserError:
        return UserError(f"{self.path}: the bag is damaged: {one_line(error)}; try `limb recover {self.path}`")
