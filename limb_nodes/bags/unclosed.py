"""The messages of an MCAP bag in the order in which they were written, whether it was closed or is being written."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from mcap.records import Channel, Message, Schema
from mcap.stream_reader import StreamReader

from limb_nodes.errors import UserError

# What stands between the name of a bag and the number of one of its parts.
PART = ".part"


class Stored(NamedTuple):
    """A message of a bag: topic, type, time (ns), and itself in CDR."""

    topic: str
    type: str
    time: int
    data: bytes


def parts_of(bag: str | Path) -> list[Path]:
    """The folders of what recorders wrote that went on with a bag whose recorder was killed, in their order."""
    path = Path(bag)
    found = {folder: folder.name.removeprefix(f"{path.name}{PART}") for folder in path.parent.glob(f"*{PART}*")}
    return sorted((folder for folder, number in found.items() if number.isdigit()), key=lambda one: int(found[one]))


def new_part(bag: str | Path) -> Path:
    """The folder of the next part of a bag."""
    path, parts = Path(bag), parts_of(bag)
    last = int(parts[-1].name.rpartition(PART)[2]) if parts else 0
    return path.with_name(f"{path.name}{PART}{last + 1}")


def stored(bag: str | Path) -> Iterator[Stored]:
    """Every message of a bag and then of its parts, of each up to its end or to the first damage.

    Raises UserError if there is no such bag, or no MCAP file in it.
    """
    path = Path(bag)
    if not path.exists():
        raise UserError(f"{path}: no such bag")
    files = [path] if path.is_file() else sorted(path.glob("*.mcap"))
    if not files:
        raise UserError(f"{path}: holds no .mcap file; the bag of a run is needed")
    for file in (*files, *(file for part in parts_of(path) for file in sorted(part.glob("*.mcap")))):
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
