"""Bags as other programs write them: by rosbags and by mcap, of any type, for tests of what is read."""

from __future__ import annotations

import shutil
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from mcap.writer import CompressionType, IndexType
from mcap.writer import Writer as McapWriter
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from limb_nodes.bags.types import limb_typestore

MCAP, SQLITE = StoragePlugin.MCAP, StoragePlugin.SQLITE3
SUFFIX = {MCAP: "mcap", SQLITE: "db3"}
SECOND = 1_000_000_000
Row = tuple[int, Any]


def store_of(**definitions: str) -> Typestore:
    """The types of ROS 2 and some more, `Sample="float64[] volt"` for lab_msgs/msg/Sample."""
    store = get_typestore(Stores.ROS2_JAZZY)
    types: dict[str, Any] = {}
    for name, text in definitions.items():
        types |= get_types_from_msg(text, f"lab_msgs/msg/{name}")
    store.register(types)
    return store


def header(store: Typestore, stamp: int) -> Any:
    """A header with a stamp, ns."""
    time = store.types["builtin_interfaces/msg/Time"](sec=stamp // SECOND, nanosec=stamp % SECOND)
    return store.types["std_msgs/msg/Header"](stamp=time, frame_id="arm")


def array(values: Any, dims: Sequence[tuple[str, int, int]] = (), offset: int = 0, bits: int = 32) -> Any:
    """A std_msgs/Float32MultiArray or Float64MultiArray; dims: label, size, stride of each."""
    types = limb_typestore().types
    dimension, layout = types["std_msgs/msg/MultiArrayDimension"], types["std_msgs/msg/MultiArrayLayout"]
    dim = [dimension(label=label, size=size, stride=stride) for label, size, stride in dims]
    data = np.ascontiguousarray(values, dtype=f"float{bits}").reshape(-1)
    return types[f"std_msgs/msg/Float{bits}MultiArray"](layout=layout(dim=dim, data_offset=offset), data=data)


def write(
    path: Path,
    topic: str,
    rows: Iterable[Row],
    store: Typestore | None = None,
    plugin: StoragePlugin = MCAP,
    compression: CompressionMode = CompressionMode.NONE,
) -> Path:
    """A bag with one topic; rows: time of reception (ns) and message."""
    store = store or limb_typestore()
    writer = Writer(path, version=9, storage_plugin=plugin)
    if compression != CompressionMode.NONE:
        writer.set_compression(compression, CompressionFormat.ZSTD)
    with writer:
        connection = None
        for time, message in rows:
            msgtype = message.__msgtype__
            connection = connection or writer.add_connection(topic, msgtype, typestore=store)
            writer.write(connection, time, store.serialize_cdr(message, msgtype))
    return path


def write_split(path: Path, topic: str, rows: Sequence[Row], parts: int, plugin: StoragePlugin) -> Path:
    """A bag of several files with its metadata.yaml, as `ros2 bag record --max-bag-duration` makes."""
    path.mkdir()
    names = []
    for index, part in enumerate(np.array_split(np.arange(len(rows)), parts)):
        one = write(path.parent / f"{path.name}_part{index}", topic, [rows[i] for i in part], plugin=plugin)
        names.append(f"{path.name}_{index}.{SUFFIX[plugin]}")
        shutil.move(one / f"{one.name}.{SUFFIX[plugin]}", path / names[-1])
        metadata = (one / "metadata.yaml").read_text()
        shutil.rmtree(one)
    listed = "".join(f"  - {name}\n" for name in names)
    first = f"  - {path.name}_part{parts - 1}.{SUFFIX[plugin]}\n"
    assert first in metadata
    (path / "metadata.yaml").write_text(metadata.replace(first, listed))
    return path


def write_mcap(
    file: Path,
    topic: str,
    rows: Iterable[Row],
    compression: CompressionType = CompressionType.NONE,
    *,
    chunked: bool = True,
    indexed: bool = True,
    profile: str = "ros2",
) -> Path:
    """One MCAP file, as tools other than rosbag2's recorder write it."""
    store = limb_typestore()
    with file.open("wb") as stream:
        writer = McapWriter(
            stream,
            chunk_size=4096,
            compression=compression,
            use_chunking=chunked,
            index_types=IndexType.ALL if indexed else IndexType.NONE,
            use_statistics=indexed,
            repeat_channels=indexed,
            repeat_schemas=indexed,
            use_summary_offsets=indexed,
        )
        writer.start(profile=profile, library="test")
        channel = None
        for time, message in rows:
            msgtype = message.__msgtype__
            if channel is None:
                text = store.generate_msgdef(msgtype, ros_version=2)[0].encode()
                schema = writer.register_schema(msgtype, "ros2msg", text)
                channel = writer.register_channel(topic, "cdr", schema)
            writer.add_message(channel, time, bytes(store.serialize_cdr(message, msgtype)), time)
        writer.finish()
    return file
