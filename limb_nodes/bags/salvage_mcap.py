"""Every message that can be read of an MCAP file, however it is damaged.

Behind damage the next record is searched for: an opcode with a plausible length and well-formed content, or a frame of
zstd. A chunk whose checksum is wrong is not kept, for nothing tells which of its messages are right: a missing value is
better than a wrong one. Of a chunk that the end of the file cuts short, the whole messages before the cut are.
"""

from __future__ import annotations

import struct
from binascii import crc32
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import lz4.frame  # type: ignore[import-untyped]
import numpy as np
import numpy.typing as npt
import zstandard

from limb_nodes.bags.files import unpack_message
from limb_nodes.bags.salvage import LATEST, Damage, Judge, Message, Origin

_MAGIC = b"\x89MCAP0\r\n"
_FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _CHUNK_INDEX = 2, 3, 4, 5, 6, 8
_HEAD = struct.Struct("<BQ")
_MESSAGE_HEAD = struct.Struct("<HIQQ")
# Start and end time, size unpacked, checksum, length of the name of the compression.
_CHUNK_HEAD = struct.Struct("<QQQII")
_ZSTD = b"\x28\xb5\x2f\xfd"
# The shape of each record: sizes of numbers, "s" a length and so many bytes, "S" the same with a long length.
_SHAPES: dict[int, str] = {
    1: "ss",
    _FOOTER: "884",
    _SCHEMA: "2sss",
    _CHANNEL: "22sss",
    7: "2s",
    _CHUNK_INDEX: "8888s8s88",
    9: "88ssS4",
    10: "88888ss",
    11: "824444" + "88s",
    12: "ss",
    13: "88s",
    14: "188",
    15: "4",
}
# Those whose length is fixed, or told by their content in several places.
_SURE = (_FOOTER, _SCHEMA, _CHANNEL, _CHUNK, 14, 15)
_BLOCK = 2**20
# No recorder makes records or chunks of this size.
_MOST = 2**28
_LARGEST_BLOCK = 2**17


class Record(NamedTuple):
    """A record: its kind, and where it, its content and the next one start."""

    opcode: int
    start: int
    body: int
    end: int


class Source:
    """Bytes that are read piece by piece: a file, or a chunk that was unpacked."""

    def __init__(self, content: BinaryIO | bytes) -> None:
        self._content = content
        self._block, self._start = b"", 0
        if isinstance(content, bytes):
            self._block, self.size = content, len(content)
        else:
            self.size = content.seek(0, 2)

    def read(self, at: int, count: int) -> bytes:
        """So many bytes, fewer at the end."""
        count = max(0, min(count, self.size - at))
        inside = at - self._start
        if inside < 0 or inside + count > len(self._block):
            assert not isinstance(self._content, bytes)
            self._content.seek(at)
            self._block, self._start, inside = self._content.read(max(count, _BLOCK)), at, 0
        return self._block[inside : inside + count]


class McapSalvage:
    """Reads the messages of one file; what it cannot read is noted in `damage`."""

    def __init__(self, file: Path, judge: Judge, damage: Damage) -> None:
        self._file, self._judge, self._damage = file, judge, damage
        # Name, form and definition of a type; type, topic, serialisation and QoS of a channel; what these make.
        self._schemas: dict[int, Any] = {}
        self._channels: dict[int, Any] = {}
        self._origins: dict[int, Origin] = {}
        self._lost: set[int] = set()
        self._searched = False

    def messages(self) -> Iterator[Message]:
        """The messages in the order of the file."""
        with self._file.open("rb") as stream:
            source = Source(stream)
            for record, place, vouched in self._records(source, self._damage):
                if record.opcode == _MESSAGE:
                    message = self._message(place, record, vouched)
                    if message is not None:
                        yield message

    def _records(self, source: Source, damage: Damage) -> Iterator[tuple[Record, Source, bool]]:
        """Every record, those of chunks too, with the bytes that it is in, and whether a checksum vouches for it."""
        damage.unfinished = True
        at = len(_MAGIC) if source.read(0, len(_MAGIC)) == _MAGIC else 0
        if not at and source.size:
            damage.note(0, min(len(_MAGIC), source.size))
        loose = 0
        while (record := self._found(source, at, False, damage)) is not None:
            # Messages right behind damage stood in a chunk, if chunks follow; its checksum is lost.
            if record.opcode == _MESSAGE:
                loose += bool(loose) or record.start != at
            elif record.opcode in (_CHUNK, _CHUNK_INDEX):
                damage.doubtful += loose
                loose = 0
            at = record.end
            if record.opcode != _CHUNK:
                self._define(source, record, False)
                damage.unfinished &= record.opcode != _FOOTER
                yield record, source, False
                continue
            cut = record.end > source.size
            unpacked = self._unpacked(source, record)
            if unpacked is None or cut or not (unpacked[1] or _in_order(Source(unpacked[0]))):
                within = None if cut else self._chunk_within(source, record, unpacked is not None)
                at = record.end if within is None else within.start
                damage.note(record.start, min(at, source.size))
            if unpacked is None:
                continue
            (raw, vouched), inner, place = unpacked, Damage(), 0
            # What is not packed ends where the next chunk starts, if bytes of it are missing.
            chunk = Source(raw[: len(raw) - (record.end - at)] if at < record.end else raw)
            while (part := self._found(chunk, place, vouched, inner)) is not None:
                place = part.end
                self._define(chunk, part, vouched)
                damage.doubtful += cut and part.opcode == _MESSAGE
                yield part, chunk, vouched
            if inner.places and not cut:
                damage.note(record.start, record.end)

    def _found(self, source: Source, at: int, vouched: bool, damage: Damage) -> Record | None:
        """The record at a place in a file or a chunk, or the next one behind damage; None at the end."""
        if at >= source.size or (source.size - at == len(_MAGIC) and source.read(at, len(_MAGIC)) == _MAGIC):
            return None
        record = _record_at(source, at)
        if record is None or not (vouched or self._ends_well(source, record)):
            record = next(filter(partial(self._believable, source), _candidates(source, at + 1, source.size)), None)
            damage.note(at, source.size if record is None else record.start)
        return record

    def _chunk_within(self, source: Source, damaged: Record, plain: bool) -> Record | None:
        """The first whole chunk that starts within a damaged one, as if bytes of that one were missing.

        plain: whether one without a checksum will do.
        """
        for record in _candidates(source, damaged.start + 1, damaged.end):
            if record.opcode == _CHUNK and record.end <= source.size:
                unpacked = self._unpacked(source, record)
                if unpacked is not None and (plain or unpacked[1]):
                    return record
        return None

    def _ends_well(self, source: Source, record: Record) -> bool:
        """Whether the length of a record without a checksum can be right: the next one or its content say so."""
        if record.opcode in _SURE or record.end == source.size:
            return True
        return _record_at(source, record.end) is not None or (
            record.opcode == _MESSAGE and self._believable(source, record)
        )

    def _believable(self, source: Source, record: Record) -> bool:
        """Whether what looks like a record behind damage is one."""
        if record.opcode != _MESSAGE:
            return True
        channel, _, stamp, _ = _MESSAGE_HEAD.unpack(source.read(record.body, _MESSAGE_HEAD.size))
        origin = self._origin(channel)
        if origin is None or stamp > LATEST:
            return False
        body = record.body + _MESSAGE_HEAD.size
        return self._judge.fits(origin, source.read(body, record.end - body))

    def _unpacked(self, source: Source, record: Record) -> tuple[bytes, bool] | None:
        """The content of a chunk, and whether a checksum vouches for it; None if it is damaged."""
        crc, name, data, cut = 0, b"zstd", record.start, record.end > source.size
        if record.body != record.start:
            *_, crc, length = _CHUNK_HEAD.unpack(source.read(record.body, _CHUNK_HEAD.size))
            name = source.read(record.body + _CHUNK_HEAD.size, length)
            data = record.body + _CHUNK_HEAD.size + length + 8
        packed = source.read(data, record.end - data)
        raw = _UNPACKERS[name](packed, cut)
        if raw is None or cut:
            return None if raw is None else (raw, False)
        if name == b"zstd" and has_checksum(packed):
            return raw, True
        return (raw, crc != 0) if crc in (0, crc32(raw)) else None

    def _define(self, source: Source, record: Record, vouched: bool) -> None:
        """Note the definition of a topic or a type: the first that is there, or one that a checksum vouches for."""
        if record.opcode not in (_SCHEMA, _CHANNEL):
            return
        number, *fields = _fields(_SHAPES[record.opcode], source.read(record.body, record.end - record.body))
        try:
            texts = [field.decode() for field in fields if isinstance(field, bytes)]
            qos = _qos(fields[-1]) if record.opcode == _CHANNEL else ""
        except (UnicodeDecodeError, struct.error):
            return
        known = self._schemas if record.opcode == _SCHEMA else self._channels
        if vouched or number not in known:
            known[number] = tuple(texts) if record.opcode == _SCHEMA else (fields[0], texts[0], texts[1], qos)
            self._origins.clear()

    def _origin(self, channel: int) -> Origin | None:
        """The topic of a channel; if it has not been seen yet, as it is defined anywhere in the file."""
        origin = self._origins.get(channel)
        if origin is None:
            known = self._channels.get(channel)
            if (known is None or known[0] not in self._schemas) and not self._searched:
                self._searched = True
                with self._file.open("rb") as stream:
                    for _ in self._records(Source(stream), Damage()):
                        pass
                known = self._channels.get(channel)
            if known is not None:
                schema, topic, serialization, qos = known
                kind, form, text = self._schemas.get(schema, (self._judge.kind(topic), "", ""))
                origin = self._origins[channel] = Origin(topic, kind, form, text, serialization, qos)
        return origin

    def _message(self, source: Source, record: Record, vouched: bool) -> Message | None:
        """The message in a record, or None if it cannot be right."""
        body = source.read(record.body, record.end - record.body)
        channel, _, stamp, _ = _MESSAGE_HEAD.unpack_from(body)
        try:
            data = unpack_message(body[_MESSAGE_HEAD.size :])
        except (ValueError, zstandard.ZstdError):
            self._damage.broken += 1
            return None
        origin = self._origins.get(channel) or self._origin(channel)
        if origin is None and channel not in self._lost:
            origin = self._judge.guess(data, {known[1] for known in self._channels.values()}, channel)
            if origin is None:
                self._lost.add(channel)
            else:
                self._origins[channel] = origin
        if origin is None:
            self._damage.unnamed += 1
        elif stamp > LATEST or not (vouched or self._judge.quick(origin, data)):
            self._damage.broken += 1
        else:
            return Message(origin, stamp, data)
        return None


def has_checksum(frame: bytes) -> bool:
    """Whether a frame of zstd has a checksum."""
    return bool(zstandard.get_frame_parameters(frame).has_checksum)


def frame_end(source: Source, at: int) -> int | None:
    """Where a frame of zstd ends that starts at a place; None if there is none, or it is not whole."""
    head = source.read(at, 5)
    if len(head) < 5 or head[:4] != _ZSTD or head[4] & 8:
        return None
    descriptor = head[4]
    single = descriptor >> 5 & 1
    at += 5 + (not single) + (0, 1, 2, 4)[descriptor & 3] + (single, 2, 4, 8)[descriptor >> 6]
    last = False
    while not last:
        block = int.from_bytes(source.read(at, 3), "little")
        last, kind, size = bool(block & 1), block >> 1 & 3, block >> 3
        at += 3 + (1 if kind == 1 else size)
        if kind == 3 or size > _LARGEST_BLOCK or at > source.size:
            return None
    at += 4 * (descriptor >> 2 & 1)
    return at if at <= source.size else None


def _unzstd(packed: bytes, cut: bool) -> bytes | None:
    """Unpack a frame, of one that is cut short what is whole; None if it is damaged."""
    if not cut and frame_end(Source(packed), 0) != len(packed):
        return None
    raw = bytearray()
    try:
        with zstandard.ZstdDecompressor().stream_reader(packed) as stream:
            while block := stream.read(_BLOCK):
                raw += block
                if len(raw) > _MOST:
                    return None
    except zstandard.ZstdError:
        return bytes(raw) if cut else None
    return bytes(raw)


def _unlz4(packed: bytes, cut: bool) -> bytes | None:
    unpacker, raw = lz4.frame.LZ4FrameDecompressor(), bytearray()
    try:
        raw += unpacker.decompress(packed, max_length=_MOST)
    except RuntimeError:
        return None
    return bytes(raw) if cut or unpacker.eof else None


_UNPACKERS: dict[bytes, Callable[[bytes, bool], bytes | None]] = {
    b"": lambda packed, _: packed,
    b"zstd": _unzstd,
    b"lz4": _unlz4,
}


def _candidates(source: Source, at: int, end: int) -> Iterator[Record]:
    """What looks like a record, or like a chunk without a head, and starts between two places."""
    while at < end:
        block = np.frombuffer(source.read(at, min(_BLOCK, end - at) + _HEAD.size - 1), dtype=np.uint8)
        for place in _places(block, source.size - at):
            record = _record_at(source, at + place) or _frame_at(source, at + place)
            if record is not None:
                yield record
        at += _BLOCK


def _places(block: npt.NDArray[np.uint8], room: int) -> list[int]:
    """Places in a block of bytes at which a record or a frame may start. room: bytes from its start to the end."""
    count = len(block) - _HEAD.size + 1
    if count <= 0:
        return []
    parts = [block[i : i + count] for i in range(_HEAD.size)]
    length = sum(part.astype(np.int64) << 8 * i for i, part in enumerate(parts[1:5]))
    record = (length <= room - _HEAD.size - np.arange(count)) | (parts[0] == _CHUNK)
    record &= (parts[0] >= 1) & (parts[0] <= max(_SHAPES))
    for part in parts[5:]:
        record &= part == 0
    frame = np.logical_and.reduce([part == byte for part, byte in zip(parts, _ZSTD, strict=False)])
    places: list[int] = np.flatnonzero(record | frame).tolist()
    return places


def _in_order(chunk: Source) -> bool:
    """Whether one record follows another up to the end of a chunk."""
    at = 0
    while at < chunk.size:
        record = _record_at(chunk, at)
        if record is None:
            return False
        at = record.end
    return at == chunk.size


def _record_at(source: Source, at: int) -> Record | None:
    """The record at a place, if what is there is well-formed; a chunk may be cut short by the end of the file."""
    head = source.read(at, _HEAD.size)
    if len(head) < _HEAD.size:
        return None
    opcode, length = _HEAD.unpack(head)
    record = Record(opcode, at, at + _HEAD.size, at + _HEAD.size + length)
    if length > _MOST or (record.end > source.size and opcode != _CHUNK):
        return None
    if opcode == _MESSAGE:
        good = length >= _MESSAGE_HEAD.size
    elif opcode == _CHUNK:
        head = source.read(record.body, _CHUNK_HEAD.size + 12)
        size = _CHUNK_HEAD.unpack_from(head)[-1] if len(head) >= _CHUNK_HEAD.size else _MOST
        name, packed = head[_CHUNK_HEAD.size :][:size], head[_CHUNK_HEAD.size + size :][:8]
        room = length - _CHUNK_HEAD.size - size - 8
        good = size < 5 and name in _UNPACKERS and len(packed) == 8 and int.from_bytes(packed, "little") == room
    elif opcode in _SHAPES:
        good = bool(_fields(_SHAPES[opcode], source.read(record.body, length)))
    else:
        # Others may have records of their own.
        good = opcode >= 0x80 and (source.read(record.end, 1) or b"\1")[0] in {*_SHAPES, _MESSAGE, _CHUNK}
    return record if good else None


def _frame_at(source: Source, at: int) -> Record | None:
    """A frame of zstd at a place, as a chunk without a head."""
    end = frame_end(source, at)
    return None if end is None else Record(_CHUNK, at, at, end)


def _fields(shape: str, body: bytes) -> list[Any]:
    """The fields of a record; none if they do not take up all of it."""
    fields: list[Any] = []
    at = 0
    for letter in shape:
        size = {"s": 4, "S": 8}.get(letter) or int(letter)
        number = int.from_bytes(body[at : at + size], "little")
        at += size
        if letter in "sS":
            fields.append(body[at : at + number])
            at += number
        else:
            fields.append(number)
        if at > len(body):
            return []
    return fields if at == len(body) else []


def _qos(metadata: bytes) -> str:
    """The QoS in the metadata of a channel, "" if there is none. Raises UnicodeDecodeError."""
    texts, at = [], 0
    while at < len(metadata):
        size = int.from_bytes(metadata[at : at + 4], "little")
        texts.append(metadata[at + 4 : at + 4 + size].decode())
        at += 4 + size
    return dict(zip(texts[::2], texts[1::2], strict=False)).get("offered_qos_profiles", "")
