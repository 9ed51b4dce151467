"""The files that a bag consists of, opened for reading: MCAP or sqlite3, one or several, compressed or not."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path, PurePath
from tempfile import TemporaryDirectory
from typing import IO, Any
from urllib.parse import quote

import lz4.frame  # type: ignore[import-untyped]
import zstandard
from rosbags.rosbag2 import storage_mcap
from rosbags.rosbag2.storage_mcap import McapReader
from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader

from limb_nodes.bags.folder import PACKED, is_bag_file
from limb_nodes.errors import UserError
from limb_nodes.foundation.yaml_text import read_yaml

BagFile = McapReader | Sqlite3Reader

_UNPACKERS: dict[str, Callable[[IO[bytes]], Any]] = {
    ".zstd": lambda stream: zstandard.ZstdDecompressor().stream_reader(stream, read_across_frames=True),
    ".zst": lambda stream: zstandard.ZstdDecompressor().stream_reader(stream, read_across_frames=True),
    ".lz4": lz4.frame.open,
}
_MAGIC: dict[bytes, type[McapReader] | type[Sqlite3Reader]] = {b"\x89MCAP0\r\n": McapReader, b"SQLite f": Sqlite3Reader}
_ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
_BLOCK = 2**20
# A chunk holds a second or so of messages; no recorder makes chunks of more than a few MB.
_MOST_UNPACKED = 2**28
# Recorded numbers are packed to a tenth of their size at best.
_MOST_RATIO = 200


def open_files(path: Path, stack: ExitStack) -> list[BagFile]:
    """Open every file of a bag.

    Args:
        path: the folder with or without a metadata.yaml, or one file of messages.
        stack: closes the files, and removes what was unpacked for them.

    Raises:
        UserError: there is no such bag, it is something else, or it was not closed.
    """
    if not path.exists():
        raise UserError(f"{path}: no such bag")
    files = _files_of(path) if path.is_dir() else [path]
    return [_open(path, _wholly_unpacked(file, stack), stack) for file in files]


def files_there(path: Path) -> list[Path]:
    """The files of messages of a bag, whatever its metadata.yaml says, in the order of their numbers.

    path: its folder, or one file. Of a file that is there packed and unpacked, the unpacked one.
    """
    if not path.is_dir():
        return [path]
    files = [file for file in path.iterdir() if file.is_file() and is_bag_file(file)]
    return sorted((file for file in files if file == plain_name(file) or plain_name(file) not in files), key=_numbered)


def metadata_of(file: Path) -> dict[str, Any]:
    """What a metadata.yaml says of its bag. Raises UserError if it can't be read."""
    content, _ = read_yaml(file)
    information = content.get("rosbag2_bagfile_information") if isinstance(content, dict) else None
    if not isinstance(information, dict):
        raise UserError(f"{file}: rosbag2_bagfile_information is missing")
    return information


def is_database(file: Path) -> bool:
    """Whether a file is one of sqlite3, by its first bytes or its name."""
    with file.open("rb") as stream:
        magic = stream.read(8)
    return (magic not in _MAGIC and file.suffix.lower() == ".db3") or _MAGIC.get(magic) is Sqlite3Reader


def plain_name(file: Path) -> Path:
    """A file's name without the suffix of its packing."""
    return file.with_suffix("") if file.suffix.lower() in PACKED else file


def unpacked(file: Path, stack: ExitStack) -> tuple[Path, bool]:
    """The file itself, or a copy that is unpacked as far as it can be, and whether that is all of it.

    stack: removes the copy. Raises UserError if there is no room, or if it is too large for a bag.
    """
    if file.suffix.lower() not in PACKED:
        return file, True
    folder = Path(stack.enter_context(TemporaryDirectory(prefix="limb_bag_")))
    most = most_bytes(file)
    if shutil.disk_usage(folder).free < file.stat().st_size:
        raise UserError(f"{file}: cannot be unpacked, for {folder.parent} is full; room is needed there")
    copy = folder / plain_name(file).name
    size = 0
    with copy.open("wb") as out:
        try:
            with file.open("rb") as packed, _UNPACKERS[file.suffix.lower()](packed) as stream:
                while block := stream.read(_BLOCK):
                    size += len(block)
                    if size > most:
                        raise UserError(
                            f"{file}: takes more than {most} bytes unpacked; a bag of measured values is needed"
                        )
                    out.write(block)
        except (EOFError, RuntimeError, zstandard.ZstdError):
            return copy, False
        except OSError as error:
            raise UserError(f"{file}: cannot be unpacked: {one_line(error)}; a whole file is needed") from None
    return copy, True


def most_bytes(path: Path) -> int:
    """How many bytes the messages of a bag may take unpacked: in proportion to what it takes on the disk."""
    files = path.iterdir() if path.is_dir() else [path]
    return max(_MOST_UNPACKED, _MOST_RATIO * sum(file.stat().st_size for file in files))


def unpack_message(data: bytes) -> bytes:
    """A serialised message that the recorder may have compressed. Raises ValueError if it can't be unpacked."""
    if data[:4] != _ZSTD_MAGIC:  # the first byte of CDR is 0
        return data
    size = zstandard.frame_content_size(data)
    return _unzstd(data, _MOST_UNPACKED if size < 0 else size)


def one_line(error: Exception) -> str:
    """The text of a library's error in one line."""
    return " ".join(str(error).split()) or "it is damaged"


def unfinished(path: Path) -> UserError:
    """The error for a bag that was not closed."""
    return UserError(f"{path}: the recorder did not close this bag; `limb recover {path}` makes a readable one of it")


def _files_of(folder: Path) -> list[Path]:
    """The files of messages in a bag's folder, in order."""
    metadata = folder / "metadata.yaml"
    if metadata.exists():
        return _listed(metadata)
    files = files_there(folder)
    if not files:
        raise UserError(f"{folder}: is no bag; a folder with a metadata.yaml and a file of messages is needed")
    kinds = {(re.sub(r"_\d+$", "", plain_name(file).stem), plain_name(file).suffix.lower()) for file in files}
    if len(kinds) > 1:
        names = ", ".join(file.name for file in files[:6]) + (", ..." if len(files) > 6 else "")
        raise UserError(f"{folder}: holds several bags and no metadata.yaml; one of the files {names} is needed")
    return files


def _listed(metadata: Path) -> list[Path]:
    """The files that a metadata.yaml names."""
    folder = metadata.parent
    try:
        names = metadata_of(metadata)["relative_file_paths"]
        if not isinstance(names, list) or not all(isinstance(name, str) and PurePath(name).name for name in names):
            raise UserError("relative_file_paths is no list of names")
        there = {file.name for file in folder.iterdir()}
    except (OSError, UserError, KeyError) as error:
        raise UserError(
            f"{folder}: is no bag that can be read, for its metadata.yaml is damaged: {one_line(error)}; a bag is read "
            "without that file too"
        ) from None
    files = [folder / PurePath(name).name for name in names]
    for index, file in enumerate(files):
        if file.name not in there and plain_name(file).name in there:
            files[index] = plain_name(file)
        elif file.name not in there:
            raise UserError(
                f"{folder}: the file {file.name}, which its metadata.yaml names, is missing; it is needed, or no "
                "metadata.yaml to read the files that are there"
            )
    if not files:
        raise UserError(f"{folder}: is no bag that can be read, for its metadata.yaml names no file of messages")
    return files


def _wholly_unpacked(file: Path, stack: ExitStack) -> Path:
    """The file itself, or a copy that is unpacked."""
    copy, whole = unpacked(file, stack)
    if not whole:
        raise UserError(f"{file}: cannot be unpacked, for it is damaged; a whole file is needed")
    return copy


def _numbered(file: Path) -> list[tuple[int, str]]:
    """The name of a file in the order in which a recorder numbers its files: a_2 before a_10."""
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", file.name)]


def _open(path: Path, file: Path, stack: ExitStack) -> BagFile:
    """Open a file of messages. path: the bag, as the user named it."""
    try:
        with file.open("rb") as stream:
            magic = stream.read(8)
        if not magic and file.suffix.lower() == ".mcap":
            raise unfinished(path)
        if magic == b"#ROSBAG ":
            raise UserError(
                f"{path}: is a bag of ROS 1; `rosbags-convert --src {file} --dst {file.with_suffix('')}` makes one of "
                "ROS 2 of it"
            )
        kind = _MAGIC.get(magic)
        if kind is None:
            raise UserError(f"{path}: is no bag that can be read: {file.name} is neither MCAP nor sqlite3")
        if kind is Sqlite3Reader:
            _check_journal(path, file)
            # The library makes a URI of the path and leaves it as it is.
            file = Path(quote(str(file)))
        reader = kind(file)
        reader.open()
    except UserError:
        raise
    except Exception as error:  # the library has no one class for what damage can do to it
        text = one_line(error)
        if "end magic" in text:
            raise unfinished(path) from None
        if isinstance(error, KeyError):
            text = f"messages are defined in the unknown form {text}; ros2msg, ros2idl or omgidl is needed"
        if "Profile" in text:
            text = (
                f"its messages are not marked as ROS 2's; `limb recover {path}` makes a readable bag of it if they are"
            )
        raise UserError(f"{path}: is no bag that can be read: {text}") from None
    stack.callback(reader.close)
    return reader


def _check_journal(path: Path, file: Path) -> None:
    """Raise UserError if some of a database's messages are still beside it, or half written."""
    for suffix in ("-wal", "-journal"):
        journal = file.with_name(file.name + suffix)
        if journal.exists() and journal.stat().st_size:
            raise UserError(
                f"{path}: the recorder did not close this bag, {journal.name} holds messages; "
                f"`limb recover {path}` makes a readable one of both"
            )


def _unzstd(data: bytes, size: int) -> bytes:
    """Unpack, at most one byte more than `size`."""
    if size > _MOST_UNPACKED:
        raise ValueError(f"a chunk takes {size} bytes unpacked; at most {_MOST_UNPACKED} are read")
    with zstandard.ZstdDecompressor().stream_reader(data) as stream:
        result: bytes = stream.read(size + 1)
    return result


def _unlz4(data: bytes, size: int) -> bytes:
    """Unpack, at most one byte more than `size`."""
    if size > _MOST_UNPACKED:
        raise ValueError(f"a chunk takes {size} bytes unpacked; at most {_MOST_UNPACKED} are read")
    result: bytes = lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=size + 1)
    return result


# The library's own unpack all that a chunk holds, whatever size the chunk states.
storage_mcap.DECOMPRESSORS.update(zstd=_unzstd, lz4=_unlz4)
