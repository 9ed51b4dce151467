"""Make a readable bag of what a killed recorder left: MCAP without an end, no metadata.yaml."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mcap.records import Channel, McapRecord, Message, Schema
from mcap.stream_reader import StreamReader
from rosbags.interfaces import Connection
from rosbags.rosbag2 import Writer
from rosbags.rosbag2.errors import ReaderError, WriterError
from rosbags.rosbag2.metadata import parse_qos
from rosbags.typesys import Stores, TypesysError, get_types_from_msg, get_typestore

from limb_nodes.bags.folder import refuse_existing
from limb_nodes.bags.write import open_writer
from limb_nodes.errors import UserError


@dataclass
class Recovered:
    """What `recover` could still read.

    Attributes:
        path: the new bag.
        counts: topic -> messages.
        end_ns: time of the last message, ns.
        truncated: whether a file ended in the middle of a record, so that messages after it are lost.
        left_out: topics whose messages are not defined in a form of ROS 2, or whose definition is damaged.
    """

    path: Path
    counts: dict[str, int] = field(default_factory=dict)
    end_ns: int = 0
    truncated: bool = False
    left_out: set[str] = field(default_factory=set)


def recover(bag_dir: str | Path, out_dir: str | Path) -> Recovered:
    """Copy every message that can still be read into a new bag.

    Args:
        bag_dir: the bag that was not closed; it is left as it is.
        out_dir: the folder to make.

    Raises:
        UserError: `bag_dir` has no MCAP file or nothing readable in it, `out_dir` exists or can't be made; nothing
            has been written then.
    """
    source, path = Path(bag_dir), Path(out_dir)
    files = [source] if source.is_file() else sorted(source.glob("*.mcap"))
    if not source.exists():
        raise UserError(f"{source}: no such bag")
    if not files:
        raise UserError(f"{source}: holds no .mcap file; one is needed")
    refuse_existing(path)
    if not any(isinstance(record, Message) for file in files for record in _records(file, Recovered(path))):
        raise UserError(f"{source}: holds no whole message; at least one is needed")
    recovered = Recovered(path)
    writer = open_writer(path, compressed=True)
    try:
        for file in files:
            _copy(file, writer, recovered)
        writer.close()
    except OSError as error:
        raise UserError(f"{path}: cannot be written: {error}") from None
    return recovered


def _copy(file: Path, writer: Writer, recovered: Recovered) -> None:
    """Copy the messages of one file."""
    schemas: dict[int, Schema] = {}
    connections: dict[int, Connection] = {}
    for record in _records(file, recovered):
        if isinstance(record, Schema):
            schemas[record.id] = record
        elif isinstance(record, Channel) and record.id not in connections:
            try:
                connections[record.id] = _connect(record, schemas[record.schema_id], writer)
            except (KeyError, TypeError, ValueError, ReaderError, TypesysError, WriterError):
                recovered.left_out.add(record.topic)
        elif isinstance(record, Message) and record.channel_id in connections:
            connection = connections[record.channel_id]
            writer.write(connection, record.log_time, record.data)
            recovered.counts[connection.topic] = recovered.counts.get(connection.topic, 0) + 1
            recovered.end_ns = max(recovered.end_ns, record.log_time)


def _connect(channel: Channel, schema: Schema, writer: Writer) -> Connection:
    qos: Any = parse_qos(channel.metadata.get("offered_qos_profiles", ""))
    for connection in writer.connections:
        if (connection.topic, connection.msgtype) == (channel.topic, schema.name):
            return connection
    return writer.add_connection(
        channel.topic,
        schema.name,
        msgdef=schema.data.decode(),
        rihs01=_type_hash(schema),
        serialization_format=channel.message_encoding,
        offered_qos_profiles=qos,
    )


def _type_hash(schema: Schema) -> str:
    """The hash by which ROS 2 tells versions of a type apart; zeros if the definition isn't in .msg syntax."""
    if schema.encoding != "ros2msg":
        return "RIHS01_" + "0" * 64
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(schema.data.decode(), schema.name))
    return store.hash_rihs01(schema.name)


def _records(file: Path, recovered: Recovered) -> Iterator[McapRecord]:
    """The records of a file up to the first that is damaged or not whole."""
    with file.open("rb") as stream:
        try:
            # A length beyond the file's own can only be damage.
            yield from StreamReader(stream, validate_crcs=True, record_size_limit=file.stat().st_size).records
        except Exception as error:  # the library has no one class for what damage can do to it
            if isinstance(error, OSError):
                raise
            recovered.truncated = True
