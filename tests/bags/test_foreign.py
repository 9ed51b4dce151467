"""Bags of other programs are read: both kinds of storage, split, compressed, without metadata, as bare files."""

from __future__ import annotations

import shutil
from pathlib import Path

import lz4.frame
import numpy as np
import pytest
import zstandard
from mcap.writer import CompressionType
from rosbags.rosbag2 import CompressionMode, StoragePlugin

from limb_nodes.bags import files
from limb_nodes.bags.read import BagReader
from limb_nodes.bags.types import limb_typestore, make_message
from limb_nodes.errors import UserError
from tests.bags import foreign
from tests.bags.foreign import MCAP, SQLITE, SUFFIX

COUNT = 300
PERIOD = 1_000_000
BOTH = pytest.mark.parametrize("plugin", [MCAP, SQLITE], ids=["mcap", "sqlite3"])


def rows(count: int = COUNT) -> list[foreign.Row]:
    noise = np.random.default_rng(3).normal(size=(count, 2))
    return [
        (
            k * PERIOD,
            make_message("limb_msgs/msg/MuscleActivation", k * PERIOD, tick=k, name=["a", "b"], activation=row),
        )
        for k, row in enumerate(noise)
    ]


def check(path: Path) -> None:
    """The bag holds `rows()`."""
    with BagReader(path) as bag:
        assert bag.topics == {"/emg": "limb_msgs/msg/MuscleActivation"}
        table = bag.table("emg")
    assert table["stamp"].tolist() == [k * PERIOD for k in range(COUNT)]
    np.testing.assert_array_equal(table["activation"], np.random.default_rng(3).normal(size=(COUNT, 2)))


def refusal(path: Path) -> str:
    with pytest.raises(UserError) as caught, BagReader(path) as bag:
        bag.table("emg")
    line = str(caught.value)
    assert line.startswith(str(path))
    assert "\n" not in line
    return line


@BOTH
@pytest.mark.parametrize("mode", [CompressionMode.NONE, CompressionMode.MESSAGE, CompressionMode.FILE])
@pytest.mark.parametrize("metadata", [True, False])
def test_compressed_with_and_without_metadata(
    plugin: StoragePlugin, mode: CompressionMode, metadata: bool, tmp_path: Path
) -> None:
    path = foreign.write(tmp_path / "a", "/emg", rows(), plugin=plugin, compression=mode)
    if not metadata:
        (path / "metadata.yaml").unlink()
    check(path)


@BOTH
@pytest.mark.parametrize("mode", [CompressionMode.NONE, CompressionMode.MESSAGE, CompressionMode.FILE])
def test_bare_file(plugin: StoragePlugin, mode: CompressionMode, tmp_path: Path) -> None:
    path = foreign.write(tmp_path / "a", "/emg", rows(), plugin=plugin, compression=mode)
    ending = ".zstd" if mode == CompressionMode.FILE else ""
    file = shutil.move(path / f"a.{SUFFIX[plugin]}{ending}", tmp_path / f"50% #1?.{SUFFIX[plugin]}{ending}")
    check(Path(file))


@BOTH
@pytest.mark.parametrize("metadata", [True, False])
@pytest.mark.parametrize("parts", [2, 12])
def test_split(plugin: StoragePlugin, metadata: bool, parts: int, tmp_path: Path) -> None:
    path = foreign.write_split(tmp_path / "a", "/emg", rows(), parts, plugin)
    assert len(list(path.glob("a_*"))) == parts
    if not metadata:
        (path / "metadata.yaml").unlink()
    check(path)


def test_chunks_compressed_by_zstd_of_rosbags(tmp_path: Path) -> None:
    check(foreign.write(tmp_path / "a", "/emg", rows(), compression=CompressionMode.STORAGE))


@pytest.mark.parametrize("compression", list(CompressionType), ids=str)
@pytest.mark.parametrize("chunked", [True, False])
@pytest.mark.parametrize("indexed", [True, False])
def test_variants_of_mcap(compression: CompressionType, chunked: bool, indexed: bool, tmp_path: Path) -> None:
    check(foreign.write_mcap(tmp_path / "a.mcap", "/emg", rows(), compression, chunked=chunked, indexed=indexed))


def test_a_file_compressed_by_lz4(tmp_path: Path) -> None:
    file = foreign.write_mcap(tmp_path / "a.mcap", "/emg", rows())
    (tmp_path / "bag").mkdir()
    (tmp_path / "bag" / "a_0.mcap.lz4").write_bytes(lz4.frame.compress(file.read_bytes()))
    check(tmp_path / "bag")
    check(tmp_path / "bag" / "a_0.mcap.lz4")


def test_a_file_that_was_unpacked_by_hand_beside_its_packed_one(tmp_path: Path) -> None:
    path = foreign.write(tmp_path / "a", "/emg", rows(), compression=CompressionMode.FILE)
    packed = path / "a.mcap.zstd"
    (path / "a.mcap").write_bytes(zstandard.ZstdDecompressor().stream_reader(packed.read_bytes()).read())
    check(path)
    packed.unlink()
    check(path)
    (path / "metadata.yaml").unlink()
    check(path)


def test_upper_case_and_another_ending(tmp_path: Path) -> None:
    check(foreign.write_mcap(tmp_path / "A.MCAP", "/emg", rows()))
    check(foreign.write_mcap(tmp_path / "recording", "/emg", rows()))


def test_a_type_is_read_by_the_definition_in_the_bag(tmp_path: Path) -> None:
    """An older limb_msgs/MuscleActivation, without last_tick."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_JAZZY)
    name = "limb_msgs/msg/MuscleActivation"
    store.register(
        get_types_from_msg("std_msgs/Header header\nuint64 tick\nstring[] name\nfloat64[] activation\n", name)
    )
    message = store.types[name](header=foreign.header(store, 7), tick=7, name=["a"], activation=np.array([0.5]))
    old = foreign.write(tmp_path / "old", "/emg", [(7, message)], store)
    new = foreign.write(tmp_path / "new", "/emg", rows())
    for path in (old, new, old):
        with BagReader(path) as bag:
            assert ("last_tick" in bag.table("emg")) == (path == new)
    check(new)


def test_what_is_no_bag_or_two(tmp_path: Path) -> None:
    folder = tmp_path / "two"
    folder.mkdir()
    foreign.write_mcap(folder / "a_0.mcap", "/emg", rows(2))
    foreign.write_mcap(folder / "b_0.mcap", "/emg", rows(2))
    assert "holds several bags and no metadata.yaml; one of the files a_0.mcap, b_0.mcap is needed" in refusal(folder)
    foreign.write(tmp_path / "a", "/emg", rows(2))
    (tmp_path / "a" / "a.mcap").unlink()
    assert "the file a.mcap, which its metadata.yaml names, is missing" in refusal(tmp_path / "a")
    (tmp_path / "a" / "metadata.yaml").write_bytes(b"\xff\xfe\0")
    assert "its metadata.yaml is damaged" in refusal(tmp_path / "a")
    for text in ("", "- 1", "rosbag2_bagfile_information: {relative_file_paths: []}"):
        (tmp_path / "a" / "metadata.yaml").write_text(text)
        assert "metadata.yaml" in refusal(tmp_path / "a")
    for name, data in (("x.db3", b""), ("x.db3", b"SQLite format 3\0" + b"\0" * 4000), ("y.mcap", b"text")):
        (tmp_path / name).write_bytes(data)
        assert "is no bag that can be read" in refusal(tmp_path / name)
    file = foreign.write_mcap(tmp_path / "plain.mcap", "/emg", rows(), profile="")
    assert "`limb recover" in refusal(file)


def test_messages_beside_a_database_are_not_lost_without_a_word(tmp_path: Path) -> None:
    path = foreign.write(tmp_path / "a", "/emg", rows(), plugin=SQLITE)
    (path / "a.db3-wal").write_bytes(b"some")
    assert "the recorder did not close this bag, a.db3-wal holds messages; `limb recover " in refusal(path)


def test_a_time_that_no_clock_shows_is_damage(tmp_path: Path) -> None:
    message = rows(1)[0][1]
    assert "the bag is damaged: a message is of the time 1844674407370955" in refusal(
        foreign.write_mcap(tmp_path / "a.mcap", "/emg", [(2**64 - 2, message)])
    )


@pytest.mark.parametrize("where", [0.3, 0.6, 0.9])
@pytest.mark.parametrize("ending", [".mcap.zstd", ".mcap.lz4"])
def test_a_packed_file_that_is_cut_short(ending: str, where: float, tmp_path: Path) -> None:
    data = foreign.write_mcap(tmp_path / "a.mcap", "/emg", rows()).read_bytes()
    packed = zstandard.compress(data) if ending.endswith("zstd") else lz4.frame.compress(data)
    file = tmp_path / f"b{ending}"
    file.write_bytes(packed[: int(where * len(packed))])
    line = refusal(file)
    assert "cannot be unpacked" in line or "limb recover" in line


@BOTH
def test_every_cut_and_many_flips_end_in_one_line(plugin: StoragePlugin, tmp_path: Path) -> None:
    path = foreign.write(tmp_path / "a", "/emg", rows(40), plugin=plugin)
    file = path / f"a.{SUFFIX[plugin]}"
    data = file.read_bytes()
    rng = np.random.default_rng(8)
    damaged = [data[:end] for end in np.linspace(0, len(data) - 1, 40, dtype=int)]
    for _ in range(200):
        flipped = np.frombuffer(data, dtype=np.uint8).copy()
        at = rng.integers(len(flipped), size=4)
        flipped[at] = rng.integers(256, size=4)
        damaged.append(flipped.tobytes())
    told = 0
    for one in damaged:
        file.write_bytes(one)
        try:
            with BagReader(path) as bag:
                for topic in bag.topics:
                    bag.table(topic)
        except UserError as error:
            told += 1
            assert "\n" not in str(error)
    assert told > 40


def test_what_unpacks_to_far_more_than_it_takes_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(files, "_MOST_UNPACKED", 2**20)
    zeros = zstandard.compress(bytes(2**24))
    (tmp_path / "a.mcap.zstd").write_bytes(zeros)
    assert "takes more than 1048576 bytes unpacked" in refusal(tmp_path / "a.mcap.zstd")
    message = make_message("limb_msgs/msg/MuscleActivation", 0, name=["a"], activation=np.zeros(2**18))
    chunk = foreign.write_mcap(tmp_path / "b.mcap", "/emg", [(0, message)], CompressionType.ZSTD)
    assert "a chunk takes 20" in refusal(chunk)
    lz4_chunk = foreign.write_mcap(tmp_path / "c.mcap", "/emg", [(0, message)], CompressionType.LZ4)
    assert "a chunk takes 20" in refusal(lz4_chunk)
    one = foreign.write(tmp_path / "d", "/emg", [(0, message)], plugin=SQLITE, compression=CompressionMode.MESSAGE)
    assert "a chunk takes 20" in refusal(one)
    message = make_message("limb_msgs/msg/MuscleActivation", 0, name=["a"], activation=np.zeros(2**16))
    many = foreign.write_mcap(tmp_path / "e.mcap", "/emg", [(k, message) for k in range(9)], CompressionType.ZSTD)
    assert "topic /emg takes more than 1048576 bytes unpacked" in refusal(many)


def test_a_bag_of_ros_1_and_other_forms_of_messages(tmp_path: Path) -> None:
    from mcap.writer import Writer

    (tmp_path / "old.bag").write_bytes(b"#ROSBAG V2.0\n" + b"\0" * 100)
    assert "is a bag of ROS 1; `rosbags-convert --src " in refusal(tmp_path / "old.bag")
    with (tmp_path / "a.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="ros2")
        schema = writer.register_schema("Sample", "jsonschema", b"{}")
        writer.add_message(writer.register_channel("/emg", "json", schema), 5, b"{}", 5)
        writer.finish()
    assert "messages are defined in the unknown form 'jsonschema'; ros2msg, ros2idl or omgidl is" in refusal(
        tmp_path / "a.mcap"
    )


def test_messages_of_the_other_byte_order(tmp_path: Path) -> None:
    from rosbags.rosbag2 import Writer

    store = limb_typestore()
    with Writer(tmp_path / "a", version=9) as writer:
        connection = writer.add_connection("/emg", "limb_msgs/msg/MuscleActivation", typestore=store)
        for time, message in rows():
            data = store.serialize_cdr(message, message.__msgtype__, little_endian=False)
            writer.write(connection, time, data)
    check(tmp_path / "a")
    with BagReader(tmp_path / "a") as bag:
        assert bag.kinds("emg") == {
            "header.stamp": "time",
            "header.frame_id": "string",
            "run": "string",
            "tick": "uint64",
            "last_tick": "int64",
            "name": "string[]",
            "activation": "float64[]",
        }
        _, (block,) = bag.blocks("emg", ["header.stamp", "name", "activation", "last_tick"])
    assert block.numbers["header.stamp"].tolist() == [k * PERIOD for k in range(COUNT)]
    assert block.texts == {"name": ("a", "b")}
    np.testing.assert_array_equal(block.numbers["activation"], np.random.default_rng(3).normal(size=(COUNT, 2)))
