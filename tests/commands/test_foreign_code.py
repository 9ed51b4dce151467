"""Code that comes with files, folders and caches of others does not run; a few of the trials of `tests.faults`."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.faults import foreign_code, planted_code
from tests.faults.ground import Attempt, Ground, done, tried

ATTEMPTS: dict[str, Attempt] = dict([*foreign_code.attempts(), *planted_code.attempts()])
# One of each kind, none of which compiles a limb.
CHOSEN = (
    "limb run, the law is beside the limb",
    "limb structure, the law is in an installed package",
    "limb verify, the law is in the working folder",
    "node muscle_stack, the law is beside the limb",
    "limb plot of a bag, the law is beside the limb",
    "limb rerun of a bag, the law is beside the limb",
    "limb rerun, a law at '../evil.py'",
    "trusted, then changed: what it imports",
    "bytecode beside a trusted law",
)


@pytest.mark.parametrize("what", CHOSEN)
def test_nothing_runs(what: str) -> None:
    (trial,) = tried([(what, ATTEMPTS[what])])
    assert trial.good, trial.what


def test_what_is_trusted_runs_and_leaves_its_mark(tmp_path: Path) -> None:
    """That a mark is missing means something."""
    ground = Ground(tmp_path)
    foreign_code.name_code(ground, foreign_code.WAYS[0])
    assert done(*ground.limb(*foreign_code.TAKE_LIMB["structure"], "--allow-laws"))
    assert ground.mark.exists()


def test_caches_that_others_can_write_are_left_alone(tmp_path: Path) -> None:
    """The same spoiled folder runs its code while it is private, as a user's own does, and not when it is open."""
    private, opened = (Ground(tmp_path / name) for name in ("private", "opened"))
    planted_code.spoiled("LIMB_CACHE_DIR", private)
    private.limb(*planted_code.SIMULATE)
    assert private.mark.exists()
    planted_code.FAULTS["others may write"](planted_code.spoiled("LIMB_CACHE_DIR", opened))
    status, said = opened.limb(*planted_code.SIMULATE)
    assert done(status, said)
    assert not opened.mark.exists()
    assert said.count("\n") == 1
    assert "others may write there" in said
    # The fresh folder is gone.
    assert not list((opened.folder / "tmp").glob("limb_cache_*"))


def test_settings_of_numba_in_the_working_folder_are_not_read() -> None:
    (trial,) = tried([("settings", ATTEMPTS[".numba_config.yaml: cache_dir: cache"])])
    assert trial.good, trial.what


def test_nodes_import_nothing_from_the_working_folder() -> None:
    (trial,) = tried([("a planted rclpy", ATTEMPTS["limb run --processes beside rclpy.py"])])
    assert trial.good, trial.what
