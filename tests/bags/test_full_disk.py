"""A disk that is full while a bag is written or closed: one line says how to get what is there, and it is there."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from limb_nodes.bags.read import BagReader
from limb_nodes.bags.recover import recover

# A limit on the size of files stands for a disk that is full: no right is needed to set it.
LIMITED = """
import resource, sys
import numpy as np
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]), resource.RLIM_INFINITY))
from limb_nodes.bags.types import make_message
from limb_nodes.bags.write import BagWriter
from limb_nodes.errors import UserError
from limb_nodes.foundation.topics import TOPIC_TYPES

noise = np.random.default_rng(1).normal(size=(20_000, 20))

def write(bag, count):
    for k in range(count):
        bag.write("activation", k, make_message(TOPIC_TYPES["activation"], k, tick=k, activation=noise[k]))

def told(action):
    try:
        action()
    except UserError as error:
        print(error.status, error, "(of %s)" % type(error.__context__).__name__)
    else:
        print("nothing")

def whole(count, error=None):
    with BagWriter(sys.argv[1], {"seed": 1}, flush_period=1000.0) as bag:
        write(bag, count)
        if error:
            raise error
"""
# The few fill no chunk, so that they are written when the bag is closed.
MANY, FEW = 20_000, 3_000


def ends(path: Path, action: str, limit: int = 500_000) -> list[str]:
    """What a process prints that may write so many bytes."""
    command = [sys.executable, "-c", LIMITED + action, str(path), str(limit)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stderr == ""
    return done.stdout.splitlines()


def line(path: Path) -> str:
    return (
        f"1 {path}: cannot be written: [Errno 27] File too large; "
        f"`limb recover {path}` makes a readable bag of what is there"
    )


def test_it_is_told_once_whether_writing_or_closing(tmp_path: Path) -> None:
    for name, count in (("writing", MANY), ("closing", FEW)):
        (said,) = ends(tmp_path / name, f"told(lambda: whole({count}))")
        assert said == f"{line(tmp_path / name)} (of NoneType)"


def test_who_was_told_when_writing_is_not_told_again(tmp_path: Path) -> None:
    action = f'bag = BagWriter(sys.argv[1], "")\ntold(lambda: write(bag, {MANY}))\ntold(bag.close)\ntold(bag.close)'
    assert [said[:2] for said in ends(tmp_path / "run", action)] == ["1 ", "no", "no"]


def test_neither_of_two_errors_hides_the_other(tmp_path: Path) -> None:
    (said,) = ends(tmp_path / "run", f'told(lambda: whole({FEW}, UserError("the first")))')
    assert said.startswith("1 the first; ")
    assert "cannot be written" in said


def test_what_is_there_can_be_recovered(tmp_path: Path) -> None:
    ends(tmp_path / "run", f"told(lambda: whole({MANY}))", 2_000_000)
    result = recover(tmp_path / "run", tmp_path / "out")
    with BagReader(tmp_path / "out") as bag:
        table = bag.table("activation")
    np.testing.assert_array_equal(table["tick"], np.arange(len(table["tick"])))
    # The chunk of a MB that was whole.
    assert result.counts["/activation"] > 4_000


@pytest.mark.parametrize("limit", [200_000, 20_000])
def test_simulate_says_it_in_one_line(limit: int, tmp_path: Path) -> None:
    arguments = ["simulate", "params/reference_joint.yaml", "--activation", "flexor=0.9,extensor=0", "--duration", "20"]
    action = f"from limb_nodes.cli import main\nsys.exit(main({[*arguments, '--out', str(tmp_path / 'run')]!r}))"
    command = [sys.executable, "-c", LIMITED + action, str(tmp_path / "run"), str(limit)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr == f"limb: error: {line(tmp_path / 'run')[2:]}\n"
    recover(tmp_path / "run", tmp_path / "out")
