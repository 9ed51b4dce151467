"""What a killed recorder leaves can be made into a bag."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from limb_nodes.bags.read import BagReader
from limb_nodes.bags.recover import recover
from limb_nodes.bags.types import TOPIC_TYPES, make_message
from limb_nodes.bags.write import BagWriter
from limb_nodes.errors import UserError

RECORD_WITHOUT_END = """
import sys, time
from limb_nodes.bags.types import TOPIC_TYPES, make_message
from limb_nodes.bags.write import BagWriter

bag = BagWriter(sys.argv[1], {"seed": 7}, flush_period=0.05)
start, k = time.monotonic(), 0
while True:
    message = make_message(TOPIC_TYPES["activation"], k, tick=k, name=["a", "b"], activation=[k * 1e-6, 0.5])
    bag.write("activation", k, message)
    k += 1
    if k % 1000 == 0 and time.monotonic() - start > 0.5:
        print(k, flush=True)
"""


@pytest.fixture(scope="module")
def killed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, int]:
    """A bag whose recorder was killed, and the number of messages that it had written at least half a second before."""
    path = tmp_path_factory.mktemp("killed") / "run"
    with subprocess.Popen(
        [sys.executable, "-c", RECORD_WITHOUT_END, str(path)], stdout=subprocess.PIPE, text=True
    ) as child:
        assert child.stdout is not None
        written = int(child.stdout.readline())
        for line in child.stdout:
            if int(line) > 3 * written:
                break
        child.kill()
    return path, written


def test_the_reader_says_how_to_recover(killed: tuple[Path, int]) -> None:
    path, _ = killed
    for bag in (path, path / "run.mcap"):
        with pytest.raises(UserError, match=f"limb recover {bag}"):
            BagReader(bag)


def test_a_killed_recorder_leaves_all_but_the_last_moments(killed: tuple[Path, int], tmp_path: Path) -> None:
    path, written = killed
    before = (path / "run.mcap").read_bytes()
    found = recover(path, tmp_path / "out")
    assert (path / "run.mcap").read_bytes() == before
    assert found.truncated
    assert found.counts["/activation"] >= written
    with BagReader(tmp_path / "out") as bag:
        assert bag.run_info() == {"seed": 7}
        table = bag.table("activation")
    np.testing.assert_array_equal(table["tick"], np.arange(found.counts["/activation"]))
    np.testing.assert_array_equal(table["activation"][:, 0], table["tick"] * 1e-6)
    assert found.end_ns == table["stamp"][-1]


def test_a_file_cut_anywhere_gives_the_messages_before_the_cut(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "whole", {"seed": 1}, flush_period=0.0) as bag:
        for k in range(1000):
            bag.write("activation", k, make_message(TOPIC_TYPES["activation"], k, tick=k, name=["a"], activation=[0.5]))
    data = (tmp_path / "whole" / "whole.mcap").read_bytes()
    most = -1
    for number, size in enumerate(np.linspace(0, len(data) - 1, 60).astype(int)):
        cut = tmp_path / f"cut{number}"
        cut.mkdir()
        (cut / "cut.mcap").write_bytes(data[:size])
        try:
            found = recover(cut, tmp_path / f"out{number}")
        except UserError as error:
            assert "nothing to recover" in str(error)
            assert most < 0
            continue
        assert found.truncated
        count = found.counts.get("/activation", 0)
        assert count >= most
        most = count
        with BagReader(found.path) as bag:
            assert bag.run_info() == {"seed": 1}
            if count:
                np.testing.assert_array_equal(bag.table("activation")["tick"], np.arange(count))
    assert most == 1000


def test_damage_in_the_middle_ends_the_recovery_there(tmp_path: Path) -> None:
    noise = np.random.default_rng(1).normal(size=(1000, 100))
    with BagWriter(tmp_path / "whole", {"seed": 1}, flush_period=0.0) as bag:
        for k, row in enumerate(noise):
            bag.write("activation", k, make_message(TOPIC_TYPES["activation"], k, tick=k, activation=row))
    file = tmp_path / "whole" / "whole.mcap"
    data = bytearray(file.read_bytes())
    data[len(data) // 2] ^= 0xFF
    file.write_bytes(data)
    found = recover(tmp_path / "whole", tmp_path / "out")
    assert found.truncated
    assert 0 < found.counts["/activation"] < 1000
    with BagReader(tmp_path / "out") as reader:
        assert reader.run_info() == {"seed": 1}
        np.testing.assert_array_equal(reader.table("activation")["tick"], np.arange(found.counts["/activation"]))


def test_a_whole_bag_is_copied(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "whole", {"seed": 1}) as bag:
        bag.write("joint_states", 9, make_message(TOPIC_TYPES["joint_states"], 9, name=["knee"], position=[1.0]))
    found = recover(tmp_path / "whole", tmp_path / "out")
    assert not found.truncated
    assert found.counts == {"/run_info": 1, "/joint_states": 1}
    with BagReader(tmp_path / "whole") as whole, BagReader(tmp_path / "out") as copy:
        assert whole.topics == copy.topics
        assert [c.ext for c in whole._reader.connections] == [c.ext for c in copy._reader.connections]
        assert [c.digest for c in whole._reader.connections] == [c.digest for c in copy._reader.connections]


def test_nothing_is_written_where_there_is_nothing_to_recover(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    for bag, said in ((tmp_path / "none", "no such bag"), (tmp_path / "empty", r"no \.mcap file")):
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
