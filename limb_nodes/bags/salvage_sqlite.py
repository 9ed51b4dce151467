"""Every message that can be read of a sqlite3 file of rosbag2, however it is damaged.

Tables are not asked for: every page that holds rows is read as it lies in the file, in a write-ahead log or in a
rollback journal beside it (https://www.sqlite.org/fileformat2.html), and a row is told by the shape of its columns.
Nothing of the database is executed. sqlite3 keeps no checksums of its pages: a value that was changed in place is not
noticed, unless its message no longer is as its type says.
"""

from __future__ import annotations

import struct
from bisect import bisect_right
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import zstandard

from limb_nodes.bags.files import unpack_message
from limb_nodes.bags.salvage import LATEST, Damage, Judge, Message, Origin

_HEAD = 100
_LEAF = 13
_PAGE_SIZES = [2**power for power in range(9, 17)]
_WAL_MAGIC = (0x377F0682, 0x377F0683)
_JOURNAL_MAGIC = b"\xd9\xd5\x05\xf9\x20\xa1\x63\xd7"
_FRAME = struct.Struct(">6I")
# No recorder makes messages of this size.
_MOST = 2**28
_FORMS = ("ros2msg", "ros2idl", "omgidl")


class Numbers:
    """A set of whole numbers that come in stretches."""

    def __init__(self) -> None:
        self._starts: list[int] = []
        self._ends: list[int] = []

    def add(self, number: int) -> bool:
        """Add a number; whether it is new."""
        at = bisect_right(self._starts, number) - 1
        if at >= 0 and number < self._ends[at]:
            return False
        if at >= 0 and number == self._ends[at]:
            self._ends[at] += 1
        else:
            at += 1
            self._starts.insert(at, number)
            self._ends.insert(at, number + 1)
        if at + 1 < len(self._starts) and self._ends[at] == self._starts[at + 1]:
            self._ends[at] = self._ends.pop(at + 1)
            del self._starts[at + 1]
        return True

    @property
    def missing(self) -> int:
        """How many numbers between the least and the greatest are not there."""
        return sum(start - end for end, start in zip(self._ends, self._starts[1:], strict=False))


class Pages:
    """The pages of a database as the last writer left them."""

    def __init__(self, file: Path) -> None:
        self._file = file.open("rb")
        self._length = self._file.seek(0, 2)
        self._log, self._logged, logged_size = self._beside(file, "-wal", self._log_places)
        self._journal, self._kept, kept_size = self._beside(file, "-journal", self._journal_places)
        head = self._read(0, _HEAD)
        stated = int.from_bytes(head[16:18], "big")
        stated = 2**16 if stated == 1 else stated
        known = [size for size in (stated, logged_size, kept_size) if size in _PAGE_SIZES]
        self.size = known[0] if head[:6] == b"SQLite" and stated in _PAGE_SIZES else self._guess(known)
        # Bytes at the end of each page that are not used.
        self.usable = self.size - (head[20] if head[:6] == b"SQLite" and head[20] < 32 else 0)
        if self.size != logged_size:
            self._logged = {}
        if self.size != kept_size:
            self._kept = {}
        self.count = max([-(-self._length // self.size), *self._logged, *self._kept])

    @property
    def unfinished(self) -> bool:
        """Whether the writer left a log or a journal."""
        return bool(self._logged or self._kept)

    def page(self, number: int) -> bytes:
        """A page by its number, from 1 on: as in the log, or as in the file; empty if it is in neither."""
        if number in self._logged:
            assert self._log is not None
            self._log.seek(self._logged[number])
            return bytes(self._log.read(self.size))
        return self._read((number - 1) * self.size, self.size)

    def before(self, number: int) -> bytes:
        """A page as it was before the last change, from the journal; empty if it is not in it."""
        if number not in self._kept:
            return b""
        assert self._journal is not None
        self._journal.seek(self._kept[number])
        return bytes(self._journal.read(self.size))

    def close(self) -> None:
        """Close the files."""
        for file in (self._file, self._log, self._journal):
            if file is not None:
                file.close()

    def _read(self, at: int, count: int) -> bytes:
        self._file.seek(at)
        return bytes(self._file.read(count))

    def _guess(self, known: list[int]) -> int:
        """The size of a page whose file's head does not tell it: that by which most rows are found."""
        scores = {}
        for size in known or _PAGE_SIZES:
            starts = range(size, min(self._length, 2**26), size)
            scores[size] = sum(len(_cells(self._read(at, size), size, 0)) for at in starts)
        return max(scores, key=lambda size: scores[size])

    @staticmethod
    def _beside(file: Path, ending: str, places: Any) -> tuple[Any, dict[int, int], int]:
        """A file beside the database, the places of the pages in it, and their size."""
        path = file.with_name(file.name + ending)
        if not path.is_file() or not path.stat().st_size:
            return None, {}, 0
        stream = path.open("rb")
        return (stream, *places(stream))

    @staticmethod
    def _log_places(stream: Any) -> tuple[dict[int, int], int]:
        """The newest place of each page in a write-ahead log, of frames whose checksum holds."""
        head = stream.read(32)
        if len(head) < 32:
            return {}, 0
        magic, _, size, _, *salts = struct.unpack(">6I", head[:24])
        if magic not in _WAL_MAGIC or size not in _PAGE_SIZES:
            return {}, 0
        order = ">" if magic & 1 else "<"
        sums = struct.unpack(">2I", head[24:32])
        places: dict[int, int] = {}
        while len(frame := stream.read(_FRAME.size)) == _FRAME.size:
            place, page = stream.tell(), stream.read(size)
            number, _, *own_salts, first, second = _FRAME.unpack(frame)
            if own_salts != salts or len(page) < size:
                break
            words = struct.unpack(f"{order}{(8 + size) // 4}I", frame[:8] + page)
            if _summed(words, *sums) == (first, second) and number:
                places[number] = place
            # Each frame's sums go on from those of the one before, whatever became of its page.
            sums = first, second
        return places, size

    @staticmethod
    def _journal_places(stream: Any) -> tuple[dict[int, int], int]:
        """The place of each page in a rollback journal, of those whose checksum holds."""
        head = stream.read(28)
        if len(head) < 28 or head[:8] != _JOURNAL_MAGIC:
            return {}, 0
        _, nonce, _, sector, size = struct.unpack(">5I", head[8:])
        if size not in _PAGE_SIZES or not 28 <= sector <= 2**16:
            return {}, 0
        places: dict[int, int] = {}
        stream.seek(sector)
        while len(record := stream.read(8 + size)) == 8 + size:
            page = record[4:-4]
            total = nonce + sum(page[at] for at in range(size - 200, 0, -200))
            if int.from_bytes(record[-4:], "big") != total & 0xFFFFFFFF:
                break
            places[int.from_bytes(record[:4], "big")] = stream.tell() - 4 - size
        return places, size


class SqliteSalvage:
    """Reads the messages of one file; what it cannot read is noted in `damage`."""

    def __init__(self, file: Path, judge: Judge, damage: Damage) -> None:
        self._file, self._judge, self._damage = file, judge, damage
        self._topics: dict[int, tuple[str, ...]] = {}
        self._types: dict[str, tuple[str, str]] = {}
        self._origins: dict[int, Origin | None] = {}

    def messages(self) -> Iterator[Message]:
        """The messages in the order of the pages of the file."""
        pages = Pages(self._file)
        try:
            self._describe(pages)
            self._damage.unfinished = pages.unfinished
            yield from self._messages(pages)
        finally:
            pages.close()

    def _describe(self, pages: Pages) -> None:
        """Find the rows of the tables of topics and of definitions."""
        for number in range(1, pages.count + 1):
            for image in (pages.page(number), pages.before(number)):
                for at in _cells(image, pages.usable, number):
                    if len(kinds := _kinds(image, at)) >= 4 and kinds[0] == 0 and kinds[1] > 12 and kinds[1] % 2:
                        self._note(*_row(pages, image, at))

    def _note(self, key: int, row: list[Any]) -> None:
        """Note a row of texts, if it is a topic or a definition."""
        texts = [cell.decode("utf-8", "replace") for cell in row[1:] if isinstance(cell, bytes)]
        if len(texts) < 3 or len(texts) != len(row) - 1:
            return
        if texts[1] in _FORMS:
            self._types.setdefault(texts[0], (texts[1], texts[2]))
        elif "/" in texts[1] and texts[0]:
            self._topics.setdefault(key, (*texts, "")[:4])

    def _messages(self, pages: Pages) -> Iterator[Message]:
        keys = Numbers()
        # Rows are numbered from 1 on.
        keys.add(0)
        for number in range(1, pages.count + 1):
            image = pages.page(number)
            cells = _cells(image, pages.usable, number)
            for page, places in ((image, cells), (pages.before(number), None)):
                for at in _cells(page, pages.usable, number) if places is None else places:
                    kinds = _kinds(page, at)
                    if len(kinds) != 4 or kinds[0] or not _INTEGERS.issuperset(kinds[1:3]) or kinds[3] not in _BLOBS:
                        continue
                    key, row = _row(pages, page, at)
                    if not row:
                        self._damage.note((number - 1) * pages.size, number * pages.size)
                    elif keys.add(key):
                        message = self._message(row)
                        if message is not None:
                            yield message
            if not any(image):
                self._damage.note((number - 1) * pages.size, number * pages.size)
        self._damage.missing += keys.missing

    def _message(self, row: list[Any]) -> Message | None:
        """The message in a row, or None if it cannot be right."""
        _, topic, stamp, data = row
        try:
            data = unpack_message(data)
        except (ValueError, zstandard.ZstdError):
            self._damage.broken += 1
            return None
        if topic not in self._origins:
            self._origins[topic] = self._origin(topic, data)
        origin = self._origins[topic]
        if origin is None:
            self._damage.unnamed += 1
        elif not 0 <= stamp <= LATEST or not self._judge.quick(origin, data):
            self._damage.broken += 1
        else:
            return Message(origin, stamp, data)
        return None

    def _origin(self, topic: int, data: bytes) -> Origin | None:
        """What a topic's number stands for."""
        if topic not in self._topics:
            return self._judge.guess(data, {name for name, *_ in self._topics.values()}, topic)
        name, kind, serialization, qos = self._topics[topic]
        return Origin(name, kind, *self._types.get(kind, ("", "")), serialization, qos)


# Types of a whole number in a row, and of bytes.
_INTEGERS = {1, 2, 3, 4, 5, 6, 8, 9}
_BLOBS = range(12, 2 * _MOST, 2)
_WIDTHS = {1: 1, 2: 2, 3: 3, 4: 4, 5: 6, 6: 8}


def _summed(words: tuple[int, ...], first: int, second: int) -> tuple[int, int]:
    """The checksum of a frame of a write-ahead log, which goes on from that of the one before."""
    for at in range(0, len(words), 2):
        first = (first + words[at] + second) & 0xFFFFFFFF
        second = (second + words[at + 1] + first) & 0xFFFFFFFF
    return first, second


def _varint(page: bytes, at: int) -> tuple[int, int]:
    """A number of one to nine bytes, and the place behind it. Raises IndexError."""
    value = 0
    for _ in range(8):
        byte = page[at]
        at += 1
        value = value << 7 | byte & 0x7F
        if byte < 0x80:
            return value, at
    return value << 8 | page[at], at + 1


def _cells(page: bytes, usable: int, number: int) -> list[int]:
    """Places of the rows in a page, none if it holds no rows of a table. number: of the page."""
    start = _HEAD if number == 1 else 0
    if len(page) < start + 8 or page[start] != _LEAF:
        return []
    count = int.from_bytes(page[start + 3 : start + 5], "big")
    end = start + 8 + 2 * count
    if not count or end > usable:
        return []
    places = struct.unpack(f">{count}H", page[start + 8 : end].ljust(2 * count, b"\0"))
    return [at for at in places if end <= at < usable - 2]


def _kinds(page: bytes, at: int) -> list[int]:
    """The types of the columns of a row, none if it is damaged."""
    try:
        size, at = _varint(page, at)
        _, at = _varint(page, at)
        start = at
        length, at = _varint(page, at)
        if not length <= size <= _MOST or length > 100:
            return []
        kinds = []
        while at < start + length:
            kind, at = _varint(page, at)
            kinds.append(kind)
    except IndexError:
        return []
    return kinds if at == start + length else []


def _row(pages: Pages, page: bytes, at: int) -> tuple[int, list[Any]]:
    """The key and the columns of a row: whole numbers and bytes; no columns if a part of it is lost."""
    kinds = _kinds(page, at)
    size, at = _varint(page, at)
    key, at = _varint(page, at)
    payload = _payload(pages, page, at, size)
    at = _varint(payload, 0)[0] if payload else 0
    row: list[Any] = []
    for kind in kinds:
        width = _WIDTHS.get(kind, 0) if kind < 12 else (kind - 12) // 2
        cell = payload[at : at + width]
        at += width
        row.append(cell if kind >= 12 else int.from_bytes(cell, "big", signed=True) + (kind == 9))
    return key, row if payload and at == len(payload) else []


def _payload(pages: Pages, page: bytes, at: int, size: int) -> bytes:
    """The bytes of a row, those on pages of their own too; empty if one of them is lost."""
    usable = pages.usable
    local = size
    if size > pages.count * usable:
        return b""
    if size > usable - 35:
        least = (usable - 12) * 32 // 255 - 23
        local = least + (size - least) % (usable - 4)
        local = local if local <= usable - 35 else least
    parts, missing = [page[at : at + local]], size - local
    following = int.from_bytes(page[at + local : at + local + 4], "big") if missing else 0
    while missing > 0:
        further = pages.page(following) if 1 < following <= pages.count else b""
        if len(further) < usable:
            return b""
        parts.append(further[4 : min(usable, 4 + missing)])
        missing -= len(parts[-1])
        following = int.from_bytes(further[:4], "big")
    payload = b"".join(parts)
    # The last page of a row names no further one.
    return payload if len(payload) == size and following == 0 else b""
