"""`limb recover`: what is left of a bag that was not closed can be read again."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from limb_nodes.bags.read import BagReader
from limb_nodes.bags.types import make_message
from limb_nodes.bags.write import BagWriter
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
    assert lines == [
        "/activation  500 messages",
        "/run_info    1 message",
        "the file is damaged or ends within a record; what came after that place is lost",
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
        ([str(empty), "-o", str(out)], f"{empty}: holds no .mcap file; one is needed"),
        ([str(whole), "-o", str(empty)], f"{empty}: exists already; the name of a new folder is needed"),
    ):
        assert main(["recover", *arguments]) == 2
        assert capsys.readouterr().err == f"limb: error: {line}\n"
    assert not out.exists()
