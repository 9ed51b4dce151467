"""Whatever goes wrong ends in one line on standard error and an exit status, in every command and node."""

from __future__ import annotations

import errno
import os
import pkgutil
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest

from limb_nodes import commands
from limb_nodes.edge import DEBUG, FAULT, guarded
from limb_nodes.errors import MOST, MOST_PATH, FieldError, RunError, UserError

ROOT = Path(__file__).resolve().parents[1]
KNEE = str(ROOT / "params" / "seated_knee.yaml")
DRIVE = str(ROOT / "params" / "activation_knee.yaml")
COMMANDS = sorted(module.name for module in pkgutil.iter_modules(commands.__path__))
LONG = "ab " * 100
HOSTILE = "\x1b[31m\u202eevil\x07\x9b2J"


def raised(error: BaseException) -> Callable[[], int]:
    """Work that fails."""

    def work() -> int:
        raise error

    return work


def run(*arguments: str, shell: str = "", **environment: str) -> subprocess.CompletedProcess[str]:
    """Run `limb` as a person does. shell: what follows in the line of the shell."""
    line = f'exec "$@" {shell}'
    return subprocess.run(
        ["sh", "-c", line, "sh", sys.executable, "-m", "limb_nodes.cli", *arguments],
        capture_output=True,
        text=True,
        cwd=ROOT,
        env={**os.environ, DEBUG: "", **environment},
        timeout=300,
    )


@pytest.mark.parametrize(
    ("error", "status", "line"),
    [
        (UserError("a.yaml: x is 1; 2 is needed"), 2, "a.yaml: x is 1; 2 is needed"),
        (RunError("the disk is full"), 1, "the disk is full"),
        (OSError(errno.ENOSPC, "No space left on device"), 1, "No space left on device"),
        (OSError(errno.ELOOP, "Too many levels", "loop"), 2, "loop: Too many levels"),
        (PermissionError(errno.EACCES, "Permission denied", b"a\xff"), 2, "a\\udcff: Permission denied"),
        (MemoryError(), 1, "MemoryError; more memory, processes or files"),
        (np.linalg.LinAlgError("Singular matrix"), FAULT, "a fault of limb: LinAlgError: Singular matrix"),
        (RuntimeError("epoll: Too many open files"), 1, "Too many open files; more memory, processes or files"),
        (RuntimeError("can't start new thread"), 1, "can't start new thread; more memory, processes or files"),
        (ImportError("x.so: failed to map segment from shared object"), 1, "more memory, processes or files"),
        (UnicodeEncodeError("utf-8", "a\udcff", 1, 2, "surrogates"), 2, "'a\\udcff' cannot be written as UTF-8"),
        (KeyError("a\nb"), FAULT, "a fault of limb: KeyError: 'a\\nb'"),
        (RuntimeError("two\nlines"), FAULT, "a fault of limb: RuntimeError: two lines"),
    ],
    ids=str,
)
def test_an_exception_is_a_line_and_a_status(
    error: BaseException, status: int, line: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv(DEBUG, raising=False)
    assert guarded(raised(error)) == status
    said = capsys.readouterr().err
    assert said.startswith("limb: error: ")
    assert line in said
    assert said.count("\n") == 1


def test_a_fault_of_the_program_names_its_place_and_can_be_traced(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(DEBUG, "1")
    assert guarded(lambda: int("x")) == FAULT
    said = capsys.readouterr().err
    assert said.startswith("Traceback")
    assert f"{DEBUG}=1 shows" in said.splitlines()[-1]
    assert "(edge.py:" in said.splitlines()[-1]


@pytest.mark.parametrize(
    ("environment", "status", "part"),
    [
        ({"NUMBA_NUM_THREADS": "0"}, 2, "limb: error: a library cannot be loaded: Number of threads"),
        ({"NUMBA_OPT": "nonsense"}, 0, "limb: warning: Environment variable 'NUMBA_OPT' is defined"),
    ],
    ids=str,
)
def test_what_the_environment_sets_for_a_library(environment: dict[str, str], status: int, part: str) -> None:
    done = run("muscle", str(ROOT / "params" / "reference_joint.yaml"), "flexor", "--duration", "0.01", **environment)
    assert done.returncode == status
    assert part in done.stderr
    assert "Traceback" not in done.stderr
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize("shell", [">/dev/full", ">&-", ">&- 2>&-", "2>/dev/full", "<&-", "<&- >&- 2>&-"])
def test_standard_streams_that_are_closed_or_full(shell: str) -> None:
    done = run("structure", KNEE, shell=shell)
    assert done.returncode == (1 if shell == ">/dev/full" else 0)
    full = "limb: error: standard output cannot be written: No space left on device\n"
    assert done.stderr == (full if shell == ">/dev/full" else "")


def test_what_is_printed_gets_into_no_file_that_is_opened_when_a_stream_is_closed(tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    arguments = "simulate", KNEE, "--activation", DRIVE, "--duration", "0.1"
    assert run(*arguments, "--out", str(bag), shell=">&- 2>&-").returncode == 0
    assert run(*arguments, "--out", str(tmp_path / "open")).returncode == 0
    assert run("export", str(bag), "-o", str(tmp_path / "bag.csv")).stderr == ""
    assert run("export", str(tmp_path / "open"), "-o", str(tmp_path / "open.csv")).stderr == ""
    assert (tmp_path / "bag.csv").read_bytes() == (tmp_path / "open.csv").read_bytes()


@pytest.mark.parametrize("encoding", ["ascii", "utf-16"])
def test_any_encoding_of_the_standard_streams(encoding: str) -> None:
    assert run("structure", KNEE, PYTHONIOENCODING=encoding, shell=">/dev/null").returncode == 0
    done = subprocess.run(
        [sys.executable, "-m", "limb_nodes.cli", "structure", b"\xff\xce\xbc.yaml"],
        capture_output=True,
        cwd=ROOT,
        env={**os.environ, DEBUG: "", "PYTHONIOENCODING": encoding},
    )
    assert done.returncode == 2
    said = done.stderr.decode(encoding.split(":")[0])
    assert said.startswith("limb: error: \\udcff")
    assert said.count("\n") == 1


@pytest.mark.parametrize("limit", ["-v 600000", "-d 100000"])
def test_too_little_memory_is_told_at_once(limit: str) -> None:
    for module in "limb_nodes.cli", "limb_nodes.nodes.muscle_stack":
        done = subprocess.run(
            ["sh", "-c", f'ulimit {limit} && exec "$@"', "sh", sys.executable, "-m", module, "verify"],
            capture_output=True,
            text=True,
            cwd=ROOT,
            timeout=300,
        )
        assert done.returncode == 2
        assert done.stderr.startswith(f"limb: error: ulimit {limit[:2]} is {limit[3:]}; unlimited, or at least")
        assert done.stderr.count("\n") == 1


NODE_REFUSALS: Mapping[str, tuple[Mapping[str, str], list[str], str]] = {
    "no file of parameters": ({}, ["--params-file", "/absent.yaml"], "/absent.yaml"),
    "no YAML": ({}, ["--params-file", str(ROOT / "README.md")], "README.md"),
    "a bad namespace": ({}, ["-r", "__ns:=/a//b"], "__ns:=/a//b"),
    "a bad name": ({}, ["-r", "__node:=a-b"], "__node:=a-b"),
    "no rule": ({}, ["-r", "x"], "-r x"),
    "no level": ({}, ["--log-level", "loud"], "loud"),
    "a word as domain": ({"ROS_DOMAIN_ID": "abc"}, [], "ROS_DOMAIN_ID is 'abc'; a whole number from 0 to 232"),
    "no such domain": ({"ROS_DOMAIN_ID": "999"}, [], "ROS_DOMAIN_ID is '999'; a whole number from 0 to 232"),
    "a limb that loops": ({}, ["-p", "limb:=/proc/self/fd/99"], "/proc/self/fd/99: no such file"),
    # Logs that cannot be kept are no reason to refuse.
    "no folder for logs": ({"ROS_LOG_DIR": "/proc/absent"}, ["-p", "limb:=''"], "the parameter limb is empty"),
    "no home": ({"ROS_LOG_DIR": "", "HOME": ""}, ["-p", "limb:=''"], "the parameter limb is empty"),
}


@pytest.mark.parametrize("case", NODE_REFUSALS)
def test_a_node_ends_in_one_line_of_its_own(case: str) -> None:
    environment, arguments, part = NODE_REFUSALS[case]
    done = subprocess.run(
        [sys.executable, "-m", "limb_nodes.nodes.muscle_stack", "--ros-args", *arguments],
        capture_output=True,
        text=True,
        cwd=ROOT,
        env={**os.environ, DEBUG: "", **environment},
        timeout=300,
    )
    lines = [line for line in done.stderr.splitlines() if line.startswith("limb: error: ")]
    assert done.returncode == 2
    assert len(lines) == 1
    assert part in lines[0]
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("text", [LONG, "x" * 300, HOSTILE, "a/" * 300], ids=["blanks", "one word", "escapes", "path"])
def test_no_command_echoes_much_of_what_it_is_given_nor_control_characters(
    command: str, text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    from limb_nodes.cli import main

    monkeypatch.chdir(tmp_path)
    for arguments in ([text], [text, "--out", text], [KNEE, "--activation", text], [f"--{text}"], [KNEE, text, text]):
        assert main([command, *arguments]) in (1, 2)
        said = capfd.readouterr().err
        assert said.count("\n") == 1
        assert said.rstrip("\n").isprintable()
        longest = MOST_PATH if "/" in text else MOST
        assert text[: longest + 1] not in said


def test_a_message_shows_the_beginning_and_the_end_of_what_is_long() -> None:
    assert str(UserError(f"{'x' * 100}END; y")) == f"{'x' * 46}...{'x' * 27}END; y"
    assert str(FieldError("out", f"is {'/a' * 200}/run; z")).endswith("/a/a/run; z")
    folders = "/".join(["/tmp", "s" * 40, "recordings", "of a day", "subject_1", "run.mcap"])
    assert str(UserError(f"{folders}: no such file")) == f"{folders}: no such file"
    assert str(UserError(f"name is '{LONG}'; z")).startswith("name is 'ab ab ab")
    assert len(str(UserError(f"name is '{LONG}'; z"))) < MOST + 20
    assert len(str(UserError(LONG * 100))) < 1300
