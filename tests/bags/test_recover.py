"""What a killed recorder leaves can be made into a bag."""

from __future__ import annotations

import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from mcap.exceptions import McapError
from mcap.records import Message
from mcap.stream_reader import StreamReader
from mcap.writer import Writer
from rosbags.rosbag2 import Reader
from ruamel.yaml import YAML

from limb_nodes.bags.read import BagReader
from limb_nodes.bags.recover import recover
from limb_nodes.bags.types import RUN_INFO, limb_typestore, make_message
from limb_nodes.bags.write import BagWriter, open_writer
from limb_nodes.errors import UserError
from limb_nodes.foundation.topics import TOPIC_TYPES
from tests.bags import foreign

RECORD_WITHOUT_END = """
import sys
from limb_nodes.bags.types import make_message
from limb_nodes.bags.write import BagWriter
from limb_nodes.foundation.topics import TOPIC_TYPES

bag = BagWriter(sys.argv[1], {"seed": 7}, flush_period=0.05)
k = 0
while True:
    message = make_message(TOPIC_TYPES["activation"], k, tick=k, name=["a", "b"], activation=[k * 1e-6, 0.5])
    bag.write("activation", k, message)
    k += 1
    if k % 1000 == 0:
        print(k, flush=True)
"""
# The first message of each chunk of `in_chunks`, then the number of all messages.
CHUNKS = (0, 130, 390, 400, 730, 1000)


@pytest.fixture(scope="module")
def killed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, int]:
    """A bag whose recorder was killed, and the number of messages that could be read from the disk before."""
    path = tmp_path_factory.mktemp("killed") / "run"
    with subprocess.Popen(
        [sys.executable, "-c", RECORD_WITHOUT_END, str(path)], stdout=subprocess.PIPE, text=True
    ) as child:
        assert child.stdout is not None
        try:
            for line in child.stdout:
                on_disk = messages_in(path / "run.mcap")
                if on_disk > 1000:
                    return path, on_disk
                assert int(line) < 1_000_000, "nothing reaches the disk"
        finally:
            child.kill()
    pytest.fail("the recorder ended by itself")


def messages_in(file: Path) -> int:
    """How many messages there are in a file that is being written."""
    count = 0
    with file.open("rb") as stream:
        try:
            for record in StreamReader(stream).records:
                count += isinstance(record, Message)
        except McapError:  # the end of what is there
            return count
    return count


def in_chunks(path: Path) -> Path:
    """A bag of noise with a flush after each chunk, written without a thread: its bytes are the same every time."""
    store, noise = limb_typestore(), np.random.default_rng(1).normal(size=(CHUNKS[-1], 20))
    bag = open_writer(path, compressed=True)
    info, activation = (bag.add_connection(f"/{t}", TOPIC_TYPES[t], typestore=store) for t in (RUN_INFO, "activation"))
    bag.write_all([(info, 0, store.serialize_cdr(make_message(info.msgtype, data="seed: 1\n"), info.msgtype))])
    for first, end in pairwise(CHUNKS):
        messages = [make_message(activation.msgtype, k, tick=k, activation=noise[k]) for k in range(first, end)]
        bag.write_all((activation, m.tick, store.serialize_cdr(m, activation.msgtype)) for m in messages)
        bag.flush()
    bag.close()
    return path / f"{path.name}.mcap"


def test_the_reader_says_how_to_recover(killed: tuple[Path, int]) -> None:
    path, _ = killed
    for bag in (path, path / "run.mcap"):
        with pytest.raises(UserError, match=f"limb recover {bag}"):
            BagReader(bag)


def test_a_killed_recorder_leaves_all_but_the_last_moments(killed: tuple[Path, int], tmp_path: Path) -> None:
    path, on_disk = killed
    before = (path / "run.mcap").read_bytes()
    result = recover(path, tmp_path / "out")
    assert (path / "run.mcap").read_bytes() == before
    assert result.truncated
    assert sum(result.counts.values()) >= on_disk
    with BagReader(tmp_path / "out") as bag:
        assert bag.run_info() == {"seed": 7}
        table = bag.table("activation")
    np.testing.assert_array_equal(table["tick"], np.arange(result.counts["/activation"]))
    np.testing.assert_array_equal(table["activation"][:, 0], table["tick"] * 1e-6)
    assert result.end_ns == table["stamp"][-1]


def test_a_file_cut_anywhere_gives_the_messages_before_the_cut(tmp_path: Path) -> None:
    data = in_chunks(tmp_path / "whole").read_bytes()
    counts = []
    for number, size in enumerate(np.linspace(0, len(data) - 1, 60).astype(int)):
        cut = tmp_path / f"cut{number}"
        cut.mkdir()
        (cut / "cut.mcap").write_bytes(data[:size])
        try:
            result = recover(cut, tmp_path / f"out{number}")
        except UserError as error:
            assert "at least one is needed" in str(error)
            assert not counts
            continue
        assert result.truncated
        counts.append(result.counts["/activation"])
        with BagReader(result.path) as bag:
            assert bag.run_info() == {"seed": 1}
            np.testing.assert_array_equal(bag.table("activation")["tick"], np.arange(counts[-1]))
    assert counts == sorted(counts)
    # The smallest chunk may lie between two cuts.
    assert {*CHUNKS[1:]} - {390} <= {*counts} <= {*CHUNKS[1:]}


@pytest.mark.parametrize("place", [0.2, 0.3, 0.5, 0.9])
@pytest.mark.parametrize("width", [1, 3_000])
def test_damage_costs_the_chunks_in_which_it_is(place: float, width: int, tmp_path: Path) -> None:
    file = in_chunks(tmp_path / "whole")
    data = bytearray(file.read_bytes())
    at = int(place * len(data))
    data[at : at + width] = bytes(255 - byte for byte in data[at : at + width])
    file.write_bytes(data)
    result = recover(tmp_path / "whole", tmp_path / "out")
    with BagReader(tmp_path / "out") as reader:
        assert reader.run_info() == {"seed": 1}
        ticks = reader.table("activation")["tick"].tolist()
    lost = sorted(set(range(CHUNKS[-1])) - set(ticks))
    # Noise is packed evenly: the bytes tell the messages.
    damaged = [(first, end) for first, end in pairwise(CHUNKS) if lost and first <= lost[-1] and end > lost[0]]
    assert lost == list(range(damaged[0][0], damaged[-1][1]))
    assert len(damaged) <= 2
    assert result.truncated
    assert result.expected["/activation"] - result.counts["/activation"] == len(lost)
    assert result.lost == {"/activation": [(lost[0], lost[-1], len(lost))]}
    assert any("bytes cannot be read" in note for note in result.notes)
    with Reader(tmp_path / "out") as plain:
        assert plain.message_count == len(ticks) + 1
    metadata = YAML(typ="safe", pure=True).load((tmp_path / "out" / "metadata.yaml").read_text())
    assert metadata["rosbag2_bagfile_information"]["message_count"] == len(ticks) + 1


@pytest.mark.parametrize("cut", [0, 400])
def test_parts_of_recorders_that_went_on_belong_to_the_bag(cut: int, tmp_path: Path) -> None:
    source = tmp_path / "run"
    for folder, first, end in (source, 0, 200), (tmp_path / "run.part1", 150, 300), (tmp_path / "run.part2", 290, 310):
        with BagWriter(folder, {"seed": 1}) as bag:
            for tick in range(first, end):
                bag.write("activation", tick, make_message(TOPIC_TYPES["activation"], tick, tick=tick))
        file = next(folder.glob("*.mcap"))
        file.write_bytes(file.read_bytes()[: -cut or None])
        (folder / "metadata.yaml").unlink()
    (tmp_path / "run.partly").mkdir()
    result = recover(source, tmp_path / "out")
    assert result.counts == {"/run_info": 1, "/activation": 310}
    with BagReader(tmp_path / "out") as bag:
        np.testing.assert_array_equal(bag.table("activation")["tick"], np.arange(310))


def test_a_whole_bag_is_copied(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "whole", {"seed": 1}) as bag:
        bag.write("joint_states", 9, make_message(TOPIC_TYPES["joint_states"], 9, name=["knee"], position=[1.0]))
    result = recover(tmp_path / "whole", tmp_path / "out")
    assert not result.truncated
    assert result.counts == {"/run_info": 1, "/joint_states": 1}
    with BagReader(tmp_path / "whole") as whole, BagReader(tmp_path / "out") as copy:
        assert whole.topics == copy.topics
    with Reader(tmp_path / "whole") as plain, Reader(tmp_path / "out") as plain_copy:
        assert [c.ext for c in plain.connections] == [c.ext for c in plain_copy.connections]
        assert [c.digest for c in plain.connections] == [c.digest for c in plain_copy.connections]


def test_all_that_describes_the_messages_is_lost_but_one_copy(tmp_path: Path) -> None:
    """The head, the first chunk and the end of a file: what the topics are stands outside of the chunks too."""
    file = in_chunks(tmp_path / "whole")
    (tmp_path / "whole" / "metadata.yaml").unlink()
    data = bytearray(file.read_bytes())
    chunk = data.find(b"zstd") - 37
    data[:8] = bytes(8)
    data[chunk : chunk + 200] = bytes(200)
    del data[-2000:]
    file.write_bytes(data)
    result = recover(tmp_path / "whole", tmp_path / "out")
    assert result.counts["/activation"] > CHUNKS[-2]
    assert any("run_info is lost" in note for note in result.notes)
    with BagReader(tmp_path / "out") as bag:
        assert bag.topics == {"/activation": TOPIC_TYPES["activation"]}


def test_a_message_with_a_wrong_value_is_not_kept(tmp_path: Path) -> None:
    """A chunk without compression, its checksum the only thing that tells."""
    rows = [(k, make_message(TOPIC_TYPES["activation"], k, tick=k, activation=[0.5] * 20)) for k in range(300)]
    file = foreign.write_mcap(tmp_path / "a.mcap", "/activation", rows)
    data = bytearray(file.read_bytes())
    data[data.index(np.float64(0.5).tobytes() * 20) + 6] ^= 0x10
    file.write_bytes(data)
    result = recover(file, tmp_path / "out")
    assert 0 < result.counts["/activation"] < 300
    with BagReader(tmp_path / "out") as bag:
        assert (bag.table("activation")["activation"] == 0.5).all()


def test_topics_that_are_not_of_ros_2_are_left_out(tmp_path: Path) -> None:
    with (tmp_path / "a.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="")
        text = limb_typestore().generate_msgdef("std_msgs/msg/String", ros_version=2)[0].encode()
        schemas = (
            writer.register_schema("std_msgs/msg/String", "ros2msg", text),
            writer.register_schema("lab.Sample", "protobuf", b"\xff\xfe\0"),
            writer.register_schema("std_msgs/msg/Bool", "ros2msg", b"bool ["),
        )
        string = bytes(
            limb_typestore().serialize_cdr(make_message("std_msgs/msg/String", data="a"), "std_msgs/msg/String")
        )
        for topic, schema in zip(("/good", "/proto", "/broken"), schemas, strict=True):
            data = b"\0\1\0\0\1" if topic == "/broken" else string
            writer.add_message(writer.register_channel(topic, "cdr", schema), 5, data, 5)
        writer.add_message(writer.register_channel("/none", "json", 0), 5, b"{}", 5)
        writer.finish()
    result = recover(tmp_path / "a.mcap", tmp_path / "out")
    # A type whose definition is damaged is that of this installation.
    assert result.counts == {"/good": 1, "/broken": 1}
    assert result.left_out == {"/proto", "/none"}
    with BagReader(tmp_path / "out") as bag:
        assert bag.table("good")["data"].tolist() == "a"
        assert bag.table("broken")["data"].tolist() == [True]


def test_nothing_is_written_if_there_is_nothing_to_recover(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    for bag, said in ((tmp_path / "none", "no such bag"), (tmp_path / "empty", "no file of messages")):
        with pytest.raises(UserError, match=said):
            recover(bag, tmp_path / "out")
    (tmp_path / "empty" / "a.mcap").write_bytes(b"\x89MCAP0\r\n")
    with pytest.raises(UserError, match="no whole message"):
        recover(tmp_path / "empty", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_an_existing_target_is_refused(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "whole", {"seed": 1}):
        pass
    with pytest.raises(UserError, match="exists already"):
        recover(tmp_path / "whole", tmp_path)
