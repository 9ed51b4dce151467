"""The messages of an MCAP bag in the order in which they were written, whether it was closed or is being written."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from mcap.records import Channel, Message, Schema
from mcap.stream_reader import StreamReader

from limb_nodes.errors import UserError


class Stored(NamedTuple):
    """A message of a bag: topic, type, time (ns), and itself in CDR."""

    topic: str
    type: str
    time: int
    data: bytes


def stored(bag: str | Path) -> Iterator[Stored]:
    """Every message up to the end, or to the first damage.

    Raises UserError if there is no such bag, or no MCAP file in it.
    """
    path = Path(bag)
    if not path.exists():
        raise UserError(f"{path}: no such bag")
    files = [path] if path.is_file() else sorted(path.glob("*.mcap"))
    if not files:
        raise UserError(f"{path}: holds no .mcap file; the bag of a run is needed")
    for file in files:
        yield from _stored(file)


def _stored(file: Path) -> Iterator[Stored]:
    schemas: dict[int, Schema] = {}
    channels: dict[int, Channel] = {}
    with file.open("rb") as stream:
        records = StreamReader(stream, validate_crcs=True, record_size_limit=file.stat().st_size).records
        while True:
            try:
                record = next(records)
            except OSError:
                raise
            except Exception:  # the end, or what damage can do to the library, which has no one class for it
                return
            if isinstance(record, Schema):
                schemas[record.id] = record
            elif isinstance(record, Channel):
                channels[record.id] = record
            elif isinstance(record, Message) and (channel := channels.get(record.channel_id)):
                schema = schemas.get(channel.schema_id)
                yield Stored(channel.topic, schema.name if schema else "", record.log_time, record.data)
