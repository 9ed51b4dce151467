"""rosbags' writer of MCAP bags, with many messages in one call."""

from __future__ import annotations

import struct
from collections.abc import Iterable
from pathlib import Path

import zstandard
from rosbags.interfaces import Connection
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.rosbag2.storage_mcap import McapWriter, write_channel, write_schema

_ZSTD_LEVEL = 3
# A message's record in MCAP: opcode, length of the rest, channel, sequence, log time, publish time.
_MESSAGE = struct.Struct("<BQHIQQ")
_MESSAGE_OPCODE = 0x05
_BEFORE_DATA = _MESSAGE.size - 9
_CHUNK_SIZE = 2**20


class Storage(Writer):
    """A bag that is open for writing.

    `Writer.write` builds each record from some ten small writes. `write_all` writes the same bytes in two, which takes
    a third of the time, index included; a run's recorder hands over ten thousands of messages a second.

    Args:
        path: the folder to make.
        compressed: compress chunks with zstd.

    Raises:
        OSError, WriterError: the folder can't be made.
    """

    def __init__(self, path: Path, *, compressed: bool) -> None:
        super().__init__(path, version=self.VERSION_LATEST, storage_plugin=StoragePlugin.MCAP)
        if compressed:
            self.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
        self._announced = 0
        self.open()
        if compressed:
            # With a checksum, so that readers notice damage; the library's own compressor writes none.
            self._mcap.compressor = zstandard.ZstdCompressor(level=_ZSTD_LEVEL, write_checksum=True).compress

    def write_all(self, messages: Iterable[tuple[Connection, int, bytes | memoryview]]) -> None:
        """Write messages: connection, time (ns), serialised message."""
        mcap = self._mcap
        for connection, stamp, data in messages:
            chunk, channel = mcap.chunk, connection.id
            out = chunk.bio
            if not chunk.message_start_time <= stamp <= chunk.message_end_time:
                chunk.message_start_time = min(stamp, chunk.message_start_time)
                chunk.message_end_time = max(stamp, chunk.message_end_time)
                mcap.message_start_time = self.min_timestamp = min(stamp, self.min_timestamp)
                mcap.message_end_time = self.max_timestamp = max(stamp, self.max_timestamp)
            mcap.channel_stats[channel] += 1
            self.counts[channel] += 1
            chunk.msgs[channel].append((stamp, out.tell()))
            out.write(_MESSAGE.pack(_MESSAGE_OPCODE, _BEFORE_DATA + len(data), channel, 0, stamp, stamp))
            out.write(data)
            if out.tell() > _CHUNK_SIZE:
                mcap.close_chunk()

    def flush(self) -> None:
        """Bring what has been written to the disk, and what a reader needs to know of new topics.

        That stands outside of the chunks too: with the chunk that holds it a reader would lose all messages.
        """
        mcap = self._mcap
        for channel in mcap.channels[self._announced :]:
            write_schema(mcap.bio, next(schema for schema in mcap.schemas if schema.name == channel.schema))
            write_channel(mcap.bio, channel, mcap.schemas)
        self._announced = len(mcap.channels)
        if mcap.chunk.msgs:
            mcap.close_chunk()
        mcap.bio.flush()

    @property
    def _mcap(self) -> McapWriter:
        assert isinstance(self.storage, McapWriter)
        return self.storage
