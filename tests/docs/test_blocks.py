"""Every block of code in README and docs runs as it stands there, page by page, each page in a folder of its own.

- ```console: the lines behind `$ ` and `> ` run in one shell; the others are what it prints, in this
  order, numbers aside.
- ```python, ```yaml and ```diff that name a file (a first line `# FILE`, or `+++ FILE`) make this file. Other Python
  runs, and a block of ```text behind it is what it prints. Other YAML must be YAML.
- ```bash is for what a test cannot do (installing, ros2, colcon); of the README, what follows the installation runs.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest
from ruamel.yaml import YAML

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
NAMED = re.compile(r"# (\S+\.\w+)\n")
NUMBER = re.compile(r"[-+]?\d+(\.\d+)?(e[-+]?\d+)?")
LONGEST = 900.0


@dataclass(frozen=True)
class Block:
    """A block of code: its language, its text, the line where it starts."""

    language: str
    text: str
    line: int


def blocks(page: Path) -> list[Block]:
    """The blocks of a page, in order."""
    text = page.read_text(encoding="utf-8")
    return [Block(found[1], found[2], text.count("\n", 0, found.start()) + 1) for found in FENCE.finditer(text)]


def runnable(page: Path) -> bool:
    """Whether a page has something that runs or makes a file."""
    return page.name == "README.md" or any(block.language in ("console", "python", "diff") for block in blocks(page))


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """A folder like a fresh checkout: the files that the pages use."""
    shutil.copytree(ROOT / "params", tmp_path / "params")
    return tmp_path


@pytest.mark.parametrize("page", [page for page in PAGES if runnable(page)], ids=lambda page: page.stem)
def test_the_blocks_run(page: Path, place: Path) -> None:
    previous = ""
    for block in blocks(page):
        where = f"{page.relative_to(ROOT)}, line {block.line}"
        if block.language == "console":
            commands, shown = transcript(block.text)
            printed = shell(commands, place, where)
            check_shown(shown, printed, where)
        elif block.language == "bash" and page.name == "README.md":
            printed = shell(without_installation(block.text), place, where)
        elif block.language == "diff":
            printed = ""
            change(block.text, place, where)
        elif block.language == "yaml":
            printed = ""
            YAML(typ="safe", pure=True).load(block.text)
            if found := NAMED.match(block.text):
                (place / found[1]).write_text(block.text, encoding="utf-8")
        elif block.language == "python":
            printed = ""
            if found := NAMED.match(block.text):
                (place / found[1]).write_text(block.text, encoding="utf-8")
            else:
                printed = run([sys.executable, "-c", block.text], place, where)
        elif block.language == "text" and previous:
            check_shown(block.text.splitlines(), previous, where)
            printed = ""
        else:
            printed = ""
        previous = printed if block.language == "python" else ""


def transcript(text: str) -> tuple[str, list[str]]:
    """The commands of a console block as one script, and the lines that it shows as printed."""
    commands, shown = [], []
    for line in text.splitlines():
        if line.startswith(("$ ", "> ")):
            commands.append(line[2:])
        elif line.strip() and line.strip() != "...":
            shown.append(line)
    return "\n".join(commands), shown


def without_installation(text: str) -> str:
    """What a block does behind making and filling the environment, but for running the tests."""
    parts = [part.strip() for part in re.sub(r"\\\n", " ", text).replace("\n", " && ").split("&&")]
    kept = [part for part in parts if part and not re.search(r"-m venv|pip install|pytest", part)]
    return " && ".join(part.replace(".venv/bin/", "") for part in kept)


def shell(script: str, place: Path, where: str) -> str:
    """Run a script; what it prints."""
    return run(["bash", "-e", "-o", "pipefail", "-c", script], place, where)


def run(command: list[str], place: Path, where: str) -> str:
    """Run a program in a folder with the checkout's `limb`; what it prints. Fails the test where it fails."""
    folder = place / ".bin"
    folder.mkdir(exist_ok=True)
    for name, words in (("python", ""), ("limb", " -m limb_nodes.cli")):
        (folder / name).write_text(f'#!/bin/sh\nexec "{sys.executable}"{words} "$@"\n')
        (folder / name).chmod(0o755)
    environment = {
        **os.environ,
        "PATH": f"{folder}{os.pathsep}{os.environ['PATH']}",
        "PYTHONPATH": str(ROOT),
        "ROS_LOG_DIR": str(place / ".ros"),
        "MPLBACKEND": "Agg",
        "XDG_STATE_HOME": str(place / ".state"),
    }
    # A session of its own, so that what a block leaves running in the background ends with it.
    with subprocess.Popen(
        command, cwd=place, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        start_new_session=True,
    ) as process:  # fmt: skip
        try:
            printed, _ = process.communicate(timeout=LONGEST)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, 9)
            printed, _ = process.communicate()
            pytest.fail(f"{where}: still running after {LONGEST:g} s; printed\n{printed}")
    assert process.returncode == 0, f"{where}: status {process.returncode}; printed\n{printed}"
    return printed


def check_shown(shown: list[str], printed: str, where: str) -> None:
    """Compare what a page shows with what was printed: each line, in order, numbers aside."""
    lines = iter([plain(line) for line in printed.splitlines()])
    for line in shown:
        assert any(plain(line) == found for found in lines), f"{where}: does not print\n{line}\nbut\n{printed}"


def plain(line: str) -> str:
    """A line without its numbers and runs of blanks."""
    return " ".join(NUMBER.sub("#", line).split())


def change(text: str, place: Path, where: str) -> None:
    """Apply a change to a file that is shown as a diff."""
    lines = text.splitlines()
    (source,) = (line[4:] for line in lines if line.startswith("--- "))
    (target,) = (line[4:] for line in lines if line.startswith("+++ "))
    hunk = [line for line in lines if not line.startswith(("--- ", "+++ ", "@@"))]
    before = "\n".join(line[1:] for line in hunk if not line.startswith("+")) + "\n"
    after = "\n".join(line[1:] for line in hunk if not line.startswith("-")) + "\n"
    content = (place / source).read_text(encoding="utf-8")
    assert content.count(before) == 1, f"{where}: {source} has these lines {content.count(before)} times:\n{before}"
    (place / target).write_text(content.replace(before, after), encoding="utf-8")


def test_the_law_of_the_how_to_is_as_short_as_it_says() -> None:
    page = ROOT / "docs/how-to/exchange-a-law.md"
    laws = [block for block in blocks(page) if block.language == "python" and NAMED.match(block.text)]
    assert len(laws) == 2
    for law in laws:
        assert len([line for line in law.text.splitlines()[1:] if line.strip()]) < 10
    diff = [block for block in blocks(page) if block.language == "diff"][-1]
    assert len(re.findall(r"^\+(?!\+\+)", diff.text, re.MULTILINE)) == 2


def test_every_block_says_its_language() -> None:
    unnamed = [
        f"{page.relative_to(ROOT)}, line {block.line}" for page in PAGES for block in blocks(page) if not block.language
    ]
    assert not unnamed
