"""What can be read of a damaged database, or of one whose recorder was killed, becomes a whole bag."""

from __future__ import annotations

import sqlite3
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from limb_nodes.bags.read import BagReader
from limb_nodes.bags.recover import recover
from limb_nodes.errors import UserError
from tests.bags import foreign
from tests.bags.foreign import SQLITE

COUNT, PERIOD, PAGE = 400, 1_000_000, 4096
TYPE = "limb_msgs/msg/MuscleActivation"
# A recorder that is killed in the middle of a transaction, in the journal's mode that is given.
RECORDER = """
import os, sqlite3, sys
base = sqlite3.connect(sys.argv[1], isolation_level=None)
base.execute(f"PRAGMA journal_mode = {sys.argv[2]}")
base.execute("PRAGMA cache_size = 5")
rows = base.execute("SELECT topic_id, timestamp, data FROM messages").fetchall()
base.execute("DELETE FROM messages")
base.execute("BEGIN")
for number, row in enumerate(rows):
    base.execute("INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)", row)
    if number in (150, 300):
        base.execute("COMMIT")
        base.execute("BEGIN")
os.kill(os.getpid(), 9)
"""


def rows(width: int = 20) -> list[foreign.Row]:
    from limb_nodes.bags.types import make_message

    noise = np.random.default_rng(3).normal(size=(COUNT, width))
    return [(k * PERIOD, make_message(TYPE, k * PERIOD, tick=k, activation=row)) for k, row in enumerate(noise)]


def whole(path: Path, width: int = 20) -> tuple[Path, bytearray]:
    """A bag and the bytes of its database."""
    folder = foreign.write(path, "/emg", rows(width), plugin=SQLITE)
    return folder, bytearray((folder / f"{path.name}.db3").read_bytes())


def table(path: Path) -> dict[str, np.ndarray]:
    """The messages of a recovered bag, which are as they were written."""
    with BagReader(path) as bag:
        assert bag.topics == {"/emg": TYPE}
        found = bag.table("emg")
    order = np.argsort(found["tick"])
    width = found["activation"].shape[1]
    noise = np.random.default_rng(3).normal(size=(COUNT, width))
    np.testing.assert_array_equal(found["activation"][order], noise[found["tick"][order]])
    np.testing.assert_array_equal(found["stamp"], found["tick"] * PERIOD)
    return found


@pytest.mark.parametrize("width", [20, 1500], ids=["in a page", "on pages of their own"])
def test_a_page_costs_the_messages_on_it(width: int, tmp_path: Path) -> None:
    folder, data = whole(tmp_path / "a", width)
    page = len(data) // 2 // PAGE * PAGE
    data[page : page + PAGE] = bytes(PAGE)
    (folder / "a.db3").write_bytes(data)
    result = recover(folder, tmp_path / "out")
    found = table(tmp_path / "out")
    lost = COUNT - len(found["tick"])
    assert 0 < lost < 40
    assert sum(count for *_, count in result.lost["/emg"]) == lost == result.expected["/emg"] - result.counts["/emg"]


@pytest.mark.parametrize("size", [0.3, 0.6, 0.9])
def test_a_file_that_is_cut(size: float, tmp_path: Path) -> None:
    folder, data = whole(tmp_path / "a")
    (folder / "a.db3").write_bytes(data[: int(size * len(data))])
    with pytest.raises(UserError, match=r"limb recover|no bag that can be read"), BagReader(folder) as bag:
        bag.table("emg")
    recover(folder, tmp_path / "out")
    assert len(table(tmp_path / "out")["tick"]) > (size - 0.2) * COUNT


@pytest.mark.parametrize("head", ["magic", "size of a page", "page"])
def test_a_lost_head(head: str, tmp_path: Path) -> None:
    folder, data = whole(tmp_path / "a")
    start, end = {"magic": (0, 16), "size of a page": (16, 18), "page": (0, PAGE)}[head]
    data[start:end] = b"\xff" * (end - start)
    (folder / "a.db3").write_bytes(data)
    recover(folder, tmp_path / "out")
    assert len(table(tmp_path / "out")["tick"]) == COUNT


def test_lost_topics_and_definitions_are_those_of_the_metadata_and_of_this_installation(tmp_path: Path) -> None:
    folder, _ = whole(tmp_path / "a")
    with sqlite3.connect(folder / "a.db3") as base:
        base.execute("PRAGMA secure_delete = ON")
        base.execute("DELETE FROM topics")
        base.execute("DELETE FROM message_definitions")
    base.close()
    recover(folder, tmp_path / "out")
    assert len(table(tmp_path / "out")["tick"]) == COUNT


@pytest.mark.parametrize("mode", ["WAL", "DELETE"])
def test_a_killed_recorder(mode: str, tmp_path: Path) -> None:
    folder, _ = whole(tmp_path / "a")
    (folder / "metadata.yaml").unlink()
    file = folder / "a.db3"
    subprocess.run([sys.executable, "-c", RECORDER, str(file), mode], check=False)
    assert [one.name for one in folder.iterdir() if one != file and one.stat().st_size and "shm" not in one.name]
    before = {one: one.read_bytes() for one in folder.iterdir()}
    result = recover(folder, tmp_path / "out")
    assert before == {one: one.read_bytes() for one in folder.iterdir()}
    # All that was committed, and more that had left the recorder.
    found = table(tmp_path / "out")
    assert set(range(301)) <= set(found["tick"].tolist())
    assert any("was not closed" in note for note in result.notes)


def test_a_split_bag_with_a_lost_and_a_damaged_file(tmp_path: Path) -> None:
    folder = foreign.write_split(tmp_path / "a", "/emg", rows(), 4, SQLITE)
    (folder / "a_1.db3").unlink()
    data = bytearray((folder / "a_2.db3").read_bytes())
    data[:200] = bytes(200)
    (folder / "a_2.db3").write_bytes(data)
    result = recover(folder, tmp_path / "out")
    found = table(tmp_path / "out")["tick"].tolist()
    assert {*range(100), *range(200, 400)} == set(found)
    assert any("a_1.db3: is missing" in note for note in result.notes)
    assert result.lost == {"/emg": [(100 * PERIOD, 199 * PERIOD, 100)]}
