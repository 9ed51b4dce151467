"""`limb recover`: what is left of a bag that was not closed can be read again."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from rosbags.interfaces import Connection

from limb_nodes.bags.read import BagReader
from limb_nodes.bags.types import limb_typestore, make_message
from limb_nodes.bags.write import BagWriter, open_writer
from limb_nodes.cli import main
from limb_nodes.foundation.topics import TOPIC_TYPES


@pytest.fixture
def whole(tmp_path: Path) -> Path:
    with BagWriter(tmp_path / "whole", {"seed": 1}, compressed=False) as bag:
        for k in range(500):
            message = make_message(TOPIC_TYPES["activation"], k, tick=k, name=["a"], activation=[0.5])
            bag.write("activation", k * 1_000_000, message)
    return tmp_path / "whole"


def test_a_bag_cut_short_becomes_readable(whole: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cut = tmp_path / "cut"
    cut.mkdir()
    # Without the last bytes of the end, whatever messages the writer put into which chunk.
    (cut / "cut.mcap").write_bytes((whole / "whole.mcap").read_bytes()[:-20])
    out = tmp_path / "out"
    assert main(["plot", str(cut), "-o", str(tmp_path / "a.png")]) == 2
    assert f"limb recover {cut}" in capsys.readouterr().err
    assert main(["recover", str(cut), "-o", str(out)]) == 0
    with BagReader(out) as bag:
        table = bag.table("activation")
    np.testing.assert_array_equal(table["tick"], np.arange(500))
    lines = capsys.readouterr().out.splitlines()
    # The last record lacks its end.
    size = (cut / "cut.mcap").stat().st_size - 17
    assert lines == [
        "/activation  500 messages",
        "/run_info    1 message",
        f"note: cut.mcap: 17 bytes cannot be read, {size} to {size + 16}",
        "note: cut.mcap: was not closed; what came after its end was never on the disk",
        "note: there is no metadata.yaml; it is made anew",
        f"bag {out}, up to 0.499 s",
    ]


def test_a_whole_bag_is_copied(whole: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["recover", str(whole), "-o", str(tmp_path / "out")]) == 0
    assert "/activation  500 messages\n" in capsys.readouterr().out
    with BagReader(tmp_path / "out") as bag:
        assert bag.count("activation") == 500


def test_mistakes_are_one_line(whole: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, empty = tmp_path / "out", tmp_path / "empty"
    empty.mkdir()
    for arguments, line in (
        ([str(tmp_path / "no"), "-o", str(out)], f"{tmp_path / 'no'}: no such bag"),
        ([str(empty), "-o", str(out)], f"{empty}: holds no file of messages, .mcap or .db3; one is needed"),
        ([str(whole), "-o", str(empty)], f"{empty}: exists already; the name of a new folder is needed"),
    ):
        assert main(["recover", *arguments]) == 2
        assert capsys.readouterr().err == f"limb: error: {line}\n"
    assert not out.exists()


def test_what_is_lost_is_said_in_ticks_seconds_and_topics(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bag = open_writer(tmp_path / "run", compressed=True)
    info, *topics = (
        bag.add_connection(f"/{topic}", TOPIC_TYPES[topic], typestore=limb_typestore())
        for topic in ("run_info", "activation", "joint_states")
    )

    def put(connection: Connection, stamp: int, **fields: object) -> None:
        message = make_message(connection.msgtype, **fields)
        bag.write_all([(connection, stamp, bytes(limb_typestore().serialize_cdr(message, connection.msgtype)))])

    put(info, 0, data="period_ns: 1000000\n")
    for tick in range(400):
        for topic in topics:
            put(topic, tick * 1_000_000, name=[f"noise{tick * tick}"])
        if tick % 100 == 99:
            bag.flush()
    bag.close()
    file = tmp_path / "run" / "run.mcap"
    data = file.read_bytes()
    third = [at for at in range(len(data)) if data.startswith(b"\x28\xb5\x2f\xfd", at)][2]
    file.write_bytes(data[: third + 50] + bytes(10) + data[third + 60 :])
    out = tmp_path / "out"
    assert main(["recover", str(tmp_path / "run"), "-o", str(out)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[:3] == [
        "/activation    300 messages  100 lost: 0.2 s to 0.299 s",
        "/joint_states  300 messages  100 lost: 0.2 s to 0.299 s",
        "/run_info      1 message",
    ]
    assert lines[3].startswith("note: run.mcap: ")
    assert lines[4:] == [
        "lost on one topic or more: 100 ticks, 0.1 s, 0.2 s to 0.299 s",
        f"bag {out}, up to 0.399 s",
    ]
