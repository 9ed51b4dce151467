"""`limb plot`: files, options and lines of errors."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from limb_nodes.bags.types import make_message
from limb_nodes.bags.write import BagWriter
from limb_nodes.cli import main
from limb_nodes.foundation.topics import TOPIC_TYPES


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("bags") / "bag"
    with BagWriter(path, {}) as writer:
        for k in range(11):
            stamp = k * 100_000_000
            message = make_message(TOPIC_TYPES["activation"], stamp, tick=k, name=["a", "b"], activation=[0.1 * k, 0.5])
            writer.write("activation", stamp, message)
    return path


@pytest.mark.parametrize(("suffix", "magic"), [(".png", b"\x89PNG"), (".pdf", b"%PDF"), (".svg", b"<?xml")])
def test_pictures_of_three_kinds(
    bag: Path, tmp_path: Path, suffix: str, magic: bytes, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / f"picture{suffix}"
    assert main(["plot", str(bag), "-o", str(out), "--dpi", "50"]) == 0
    assert out.read_bytes().startswith(magic)
    assert capsys.readouterr().out == f"picture  {out} (0 to 1 s)\n"
    assert list(tmp_path.iterdir()) == [out]
    before = out.read_bytes()
    assert main(["plot", str(bag), "-o", str(out), "--dpi", "50", "--force"]) == 0
    assert out.read_bytes() == before, "the same bag, the same picture"


@pytest.mark.parametrize(
    ("options", "line"),
    [
        (["-o", "{tmp}/a.jpg"], "--out is {tmp}/a.jpg; a name that ends in .png or .pdf or .svg is needed"),
        (["-o", "{tmp}/no/a.png"], "--out is {tmp}/no/a.png; a folder that exists is needed, unlike {tmp}/no"),
        (["-o", "{tmp}/a.png", "--dpi", "0"], "--dpi is 0; a number >= 10 and <= 1200 is needed"),
        (["-o", "{tmp}/a.png", "--dpi", "nan"], "--dpi is nan; a number >= 10 and <= 1200 is needed"),
        (["-o", "{tmp}/a.png", "--from", "2"], "--from is 2; a number < 1 in s is needed, the end of {bag}"),
        (["-o", "{tmp}/a.png", "--reference", "{tmp}/x"], "{tmp}/x: no such bag"),
        (["-o", "{tmp}/a.png", "--namespace", "x"], "{bag}: --namespace is x; one of / is needed"),
    ],
)
def test_mistakes_are_one_line(
    bag: Path, tmp_path: Path, options: list[str], line: str, capsys: pytest.CaptureFixture[str]
) -> None:
    names = {"tmp": tmp_path, "bag": bag}
    assert main(["plot", str(bag), *[option.format(**names) for option in options]]) == 2
    assert capsys.readouterr().err == f"limb: error: {line.format(**names)}\n"
    assert list(tmp_path.iterdir()) == []


def test_bags_that_are_not_there(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = str(tmp_path / "a.png")
    assert main(["plot", str(tmp_path / "x"), "-o", out]) == 2
    assert capsys.readouterr().err == f"limb: error: {tmp_path / 'x'}: no such bag\n"
    (tmp_path / "open").mkdir()
    (tmp_path / "open" / "open.mcap").write_bytes(b"")
    assert main(["plot", str(tmp_path / "open"), "-o", out]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert f"`limb recover {tmp_path / 'open'}`" in error


def test_a_picture_is_overwritten_by_force_only(bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "a.png"
    out.write_bytes(b"mine")
    assert main(["plot", str(bag), "-o", str(out)]) == 2
    assert capsys.readouterr().err.startswith(f"limb: error: --out is {out}, which exists already; ")
    assert out.read_bytes() == b"mine"
    assert main(["plot", str(bag), "-o", str(out), "--force"]) == 0
    assert out.read_bytes() != b"mine"
    folder = tmp_path / "b.png"
    folder.mkdir()
    assert main(["plot", str(bag), "-o", str(folder), "--force"]) == 2


def test_help_needs_no_matplotlib() -> None:
    script = (
        "import sys; from limb_nodes.cli import parser; parser(['plot', 'recover']); "
        "sys.exit('matplotlib' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", script], check=False).returncode == 0
