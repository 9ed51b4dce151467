"""The page of dependencies has those of pyproject.toml, and nothing of the program unpickles."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

pytest.importorskip("tomllib", reason="Python 3.10 reads no TOML")

from docs import dependencies
from tests.dependencies import lowest

ROOT = Path(__file__).resolve().parents[2]
UNPICKLING = {"pickle", "cPickle", "_pickle", "cloudpickle", "dill", "joblib", "marshal", "shelve", "torch"}


def test_the_page_has_every_dependency_with_its_versions_purpose_and_licence() -> None:
    lines = dependencies.PAGE.read_text(encoding="utf-8").splitlines()
    cells = [line.strip("| ").split(" | ") for line in lines if line.startswith("| ")]
    listed = [row[:3] for row in cells if len(row) == 4 and row[0] != "package"]
    assert listed == [list(row[:3]) for row in dependencies.rows()], "run `python -m docs.dependencies`"
    assert all(row[3] for row in cells if len(row) == 4)


def test_each_has_a_lower_and_an_upper_bound() -> None:
    for requirement, _ in dependencies.requirements():
        operators = {spec.operator for spec in requirement.specifier}
        assert operators in ({">=", "<"}, {"~="}), requirement
    assert len(lowest()) == sum(extra != "Jazzy" for _, extra in dependencies.requirements())


def uses(text: str) -> set[str]:
    """The modules that a text imports, and the values that it gives to `allow_pickle`."""
    found = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            found |= {alias.name.partition(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found.add((node.module or "").partition(".")[0])
        elif isinstance(node, ast.Call) and ast.unparse(node.func) in ("np.load", "numpy.load"):
            found |= {f"{key.arg}={ast.unparse(key.value)}" for key in node.keywords}
    return found


def test_nothing_of_the_program_unpickles() -> None:
    for path in (ROOT / "limb_nodes").rglob("*.py"):
        found = uses(path.read_text(encoding="utf-8"))
        assert not found & UNPICKLING, path
        assert "allow_pickle=True" not in found, path


@pytest.mark.parametrize("line", ["import pickle", "from marshal import loads", "def f():\n    import joblib.x"])
def test_what_unpickles_is_found(line: str) -> None:
    assert uses(line) & UNPICKLING
