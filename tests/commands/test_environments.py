"""Hostile environments: a few of the trials of `python -m tests.faults environments`."""

from __future__ import annotations

import signal

import pytest

from tests.faults.environments import ended, in_place, with_name

PLACES = (
    ("HOME=/dev/null", "simulate"),
    ("LIMB_CACHE_DIR=/proc/absent", "simulate"),
    ("neither home nor logs", "muscle_stack"),
    ("the locale C", "export"),
    ("without docstrings", "emg"),
    ("a working folder that is gone", "structure"),
    ("ulimit -f 8", "emg"),
)
NAMES = (
    (b"loop", ("structure", "@")),
    (b"a\xff", ("simulate", "bare.yaml", "--activation", "x=0", "--duration", "0.1", "--out", "@")),
    (b"x" * 300, ("emg", "emg.csv", "--out", "@")),
    (b"/dev/zero", ("structure", "@")),
)


@pytest.mark.parametrize(("place", "command"), PLACES)
def test_an_environment(place: str, command: str) -> None:
    trial = in_place(place, command)
    assert trial.good, trial.what


@pytest.mark.parametrize(("name", "command"), NAMES)
def test_a_name(name: bytes, command: tuple[str, ...]) -> None:
    trial = with_name(name, command)
    assert trial.good, trial.what


def test_a_terminal_that_is_closed() -> None:
    trial = ended(signal.SIGHUP, "run", 0.5)
    assert trial.good, trial.what
