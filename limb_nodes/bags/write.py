"""Write a bag: rosbag2's folder with one MCAP file, which ROS 2, Foxglove and `BagReader` read."""

from __future__ import annotations

import io
from collections import deque
from collections.abc import Callable, Collection, Iterable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from threading import Event, Thread
from types import TracebackType
from typing import Any

from rosbags.interfaces import (
    Connection,
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2.errors import WriterError
from ruamel.yaml import YAML
from ruamel.yaml.scalarstring import LiteralScalarString

from limb_nodes.bags.folder import refuse_existing
from limb_nodes.bags.storage import Storage
from limb_nodes.bags.types import RUN_INFO, absolute, limb_typestore, make_message
from limb_nodes.errors import RunError, UserError

_BATCH = 64


class BagWriter:
    """Writes one bag; a context manager that leaves a readable bag however the block ends.

    Messages are handed to a thread of the writer's own. Ctrl-C raises KeyboardInterrupt in the main thread only, so it
    can't cut a record in two, and compression runs beside the caller. What a killed process had handed over is on disk
    up to the last `flush_period`, whether more came or not, and run_info and the types of topics that were expected at
    once; `limb_nodes.bags.recover` makes a bag of it.

    Args:
        path: the folder to make; its parents are made too.
        run_info: what is needed to run again what the bag holds (limb, parameters, versions, seed, ...), a mapping
            that YAML can hold, or its YAML text. It is the bag's first message, on the topic `run_info`, at time 0.
        namespace: put before every relative topic, for example `left`.
        latched: topics whose newest message a late subscriber still gets (transient-local); `run_info` is one anyway.
        compressed: compress chunks with zstd. On a run's own topics (120,000 messages, 39 MB) that makes the file 3.4
            times smaller, 13 against 44 MB, at the same processor time within the noise.
        flush_period: most wall time, s, that messages wait in memory.
        most_waiting: bytes of messages, or so, that may wait for the thread; then who writes waits for it.

    Raises:
        UserError: the folder exists, or can't be made; nothing has been written then.
        RunError: its first message cannot be written.
    """

    def __init__(
        self,
        path: str | Path,
        run_info: Mapping[str, Any] | str,
        *,
        namespace: str = "",
        latched: Collection[str] = (),
        compressed: bool = True,
        flush_period: float = 0.2,
        most_waiting: int = 2**25,
    ) -> None:
        self.path = Path(path)
        self.counts: dict[str, int] = {}
        """Topic, as the bag names it -> messages handed over so far."""
        self._namespace = namespace.strip("/")
        self._latched = {RUN_INFO, *latched}
        self._most_waiting, self._handed_over = most_waiting, 0
        self._store = limb_typestore()
        self._connections: dict[str, Connection] = {}
        self._pending: deque[tuple[Connection, int, bytes | memoryview]] = deque()
        self._failure: Exception | None = None
        self._told = self._finished = False
        self._closed = Event()
        text = run_info if isinstance(run_info, str) else _yaml_text(run_info)

        self._writer = open_writer(self.path, compressed=compressed)
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="bag")
        self._drained = self._thread.submit(self._drain)
        self.write(RUN_INFO, 0, make_message("std_msgs/msg/String", data=text))
        self._thread.submit(self._flush).result()
        if self._failure is not None:
            self.close()
        Thread(target=self._keep_flushing, args=(flush_period,), name="bag_flush", daemon=True).start()

    def expect(self, types: Mapping[str, str]) -> None:
        """Get topics ready, so that their first messages take no longer than the others.

        Args:
            types: topic, relative to the namespace or absolute -> message type.
        """
        for topic, msgtype in types.items():
            self._connect(topic, msgtype)
        self._thread.submit(self._flush)

    def write(self, topic: str, stamp_ns: int, message: Any) -> None:
        """Write a message of `make_message`, or as `BagReader.read_topic` gives it.

        Args:
            topic: relative to the namespace, or absolute.
            stamp_ns: simulation time of the message, ns.
            message: of the topic's one type.

        Raises:
            RunError: an earlier message could not be written, for example because the disk is full.
        """
        self.write_raw(topic, stamp_ns, self._store.serialize_cdr(message, message.__msgtype__), message.__msgtype__)

    def write_raw(self, topic: str, stamp_ns: int, data: bytes | memoryview, msgtype: str) -> None:
        """Write a serialised message (CDR with its four bytes of header, as a raw subscription gets it).

        Args:
            topic: relative to the namespace, or absolute.
            stamp_ns: simulation time of the message, ns.
            data: the message; kept, not copied.
            msgtype: for example `limb_msgs/msg/JointTorque`; read when the topic is new.

        Raises:
            RunError: an earlier message could not be written, for example because the disk is full.
        """
        connection = self._connections.get(topic) or self._connect(topic, msgtype)
        self._pending.append((connection, stamp_ns, data))
        self.counts[connection.topic] += 1
        self._handed_over += len(data)
        self._pass_on()

    def write_many(self, topic: str, messages: Iterable[tuple[int, bytes | memoryview]], msgtype: str) -> None:
        """Write serialised messages of a topic: pairs of what `write_raw` takes as stamp_ns and data."""
        connection = self._connections.get(topic) or self._connect(topic, msgtype)
        entries = [(connection, stamp_ns, data) for stamp_ns, data in messages]
        self._pending.extend(entries)
        self.counts[connection.topic] += len(entries)
        self._handed_over += sum(len(data) for _, _, data in entries)
        self._pass_on()

    def _pass_on(self) -> None:
        """Let the thread write when enough is waiting; wait for it if it falls far behind."""
        much = self._handed_over > self._most_waiting
        if self._drained.done():
            if much or len(self._pending) >= _BATCH:
                self._check()
                self._handed_over = 0
                self._drained = self._thread.submit(self._drain)
        elif much:
            self._drained.result()

    def flush(self) -> Future[None]:
        """Ask for all that has been handed over to be brought to the disk; done when it is there.

        Raises:
            RunError: an earlier message could not be written.
        """
        self._check()
        return self._thread.submit(self._flush)

    def close(self) -> None:
        """Write what is waiting, the index and metadata.yaml. Safe to call again.

        Raises:
            RunError: a message could not be written, which has not been told yet.
        """
        if self._closed.is_set():
            return
        self._closed.set()
        try:
            self._thread.submit(self._finish).result()
        finally:
            self._thread.shutdown()
        if not self._told:
            self._check()

    def __enter__(self) -> BagWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self.close()
        except RunError as failure:
            # Neither of two errors hides the other; what is none for a person goes on by itself.
            if error is None:
                raise
            if isinstance(error, UserError):
                raise RunError(f"{error}; {failure}") from None

    def _connect(self, topic: str, msgtype: str) -> Connection:
        """The bag's connection for a topic, made in the writer's thread if it is new."""
        name = topic if topic.startswith("/") or not self._namespace else f"{self._namespace}/{topic}"
        connection = self._thread.submit(self._add_connection, absolute(name), msgtype, topic in self._latched).result()
        self._connections[topic] = connection
        self.counts.setdefault(connection.topic, 0)
        return connection

    def _add_connection(self, topic: str, msgtype: str, latched: bool) -> Connection:
        for connection in self._writer.connections:
            if connection.topic == topic:
                return connection
        return self._writer.add_connection(
            topic, msgtype, typestore=self._store, offered_qos_profiles=[_qos(latched=latched)]
        )

    def _check(self) -> None:
        """Tell that the thread could not write."""
        if self._failure is not None:
            self._told = True
            raise RunError(
                f"{self.path}: cannot be written: {self._failure or type(self._failure).__name__}; "
                f"`limb recover {self.path}` makes a readable bag of what is there"
            )

    def _keep_flushing(self, period: float) -> None:
        """Let the thread bring to the disk what is there, every `period` s until the bag is closed."""
        while not self._closed.wait(period):
            try:
                self._thread.submit(self._flush)
            except RuntimeError:  # closed just now
                return

    def _attempt(self, write: Callable[[], None]) -> None:
        """Write in the thread; nothing more once the bag is finished, or that has failed: its file ends in a record."""
        try:
            if self._failure is None and not self._finished:
                write()
        except Exception as error:
            self._failure = error
        if self._failure is not None:
            self._pending.clear()

    def _drain(self) -> None:
        """Write what is waiting; in the thread, as all below."""
        pending = self._pending
        self._attempt(lambda: self._writer.write_all(pending.popleft() for _ in iter(pending.__len__, 0)))

    def _flush(self) -> None:
        """Write what is waiting, to the disk."""
        self._drain()
        self._attempt(self._writer.flush)

    def _finish(self) -> None:
        self._drain()
        self._attempt(self._writer.close)
        # A flush may have been asked for just before.
        self._finished = True
        if self._failure is not None:
            with suppress(Exception):
                self._writer.abort()


def open_writer(path: Path, *, compressed: bool) -> Storage:
    """Make the folder of a bag and the file in it.

    Raises:
        UserError: the folder exists, or can't be made.
    """
    refuse_existing(path)
    try:
        return Storage(path, compressed=compressed)
    except (OSError, WriterError) as error:
        raise UserError(f"{path}: cannot be made: {error}") from None


def _qos(*, latched: bool) -> Qos:
    """Reliable; transient-local if latched."""
    forever = QosTime(0x7FFFFFFFFFFFFFFF // 1_000_000_000, 0x7FFFFFFFFFFFFFFF % 1_000_000_000)
    return Qos(
        history=QosHistory.KEEP_LAST,
        depth=1 if latched else 10,
        reliability=QosReliability.RELIABLE,
        durability=QosDurability.TRANSIENT_LOCAL if latched else QosDurability.VOLATILE,
        deadline=forever,
        lifespan=forever,
        liveliness=QosLiveliness.AUTOMATIC,
        liveliness_lease_duration=forever,
        avoid_ros_namespace_conventions=False,
    )


def _yaml_text(mapping: Mapping[str, Any]) -> str:
    """YAML text of a mapping, texts of several lines as blocks so that a person can read them."""
    blocks = {
        key: LiteralScalarString(value) if isinstance(value, str) and "\n" in value else value
        for key, value in mapping.items()
    }
    stream = io.StringIO()
    YAML().dump(blocks, stream)
    return stream.getvalue()
