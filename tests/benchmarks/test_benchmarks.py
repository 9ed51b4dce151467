"""The benchmarks run; what they measure is no test."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

RUN = Path(__file__).parent / "run.py"


def benchmark(tmp_path: Path, *arguments: str) -> tuple[str, list[dict[str, Any]]]:
    """Table and rows of a quick run."""
    file = tmp_path / "rows.json"
    command = [sys.executable, str(RUN), "--quick", "--rounds", "1", "--json", str(file), *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout, json.loads(file.read_text())["rows"]


def test_solvers_and_samples(tmp_path: Path) -> None:
    table, rows = benchmark(tmp_path, "--only", "joint", "--only", "ensemble")
    engines = {row["engine"]: row for row in rows if row["work"] == "joint"}
    assert set(engines) == {
        "limb_nodes",
        "limb_nodes, default",
        "scipy LSODA, Python",
        "sundae CVODE, compiled",
        "MuJoCo Euler 1 ms",
    }
    for name, row in engines.items():
        assert name in table
        # A peer that is not installed is named, with the reason.
        assert row["missing"] or (row["wall"] > 0.0 and row["error"] < 0.1)
    assert engines["limb_nodes"]["error"] <= 1e-6
    assert any(row["work"] == "20 samples" and row["engine"].startswith("limb_nodes") for row in rows)


def test_the_graph_and_the_bare_ring(tmp_path: Path) -> None:
    pytest.importorskip("rclpy")
    _, rows = benchmark(tmp_path, "--only", "graph")
    assert [row["work"] for row in rows].count("graph, one process") == 3
    assert all(row["speed"] > 0.0 for row in rows)


def test_reading_a_long_file(tmp_path: Path) -> None:
    _, rows = benchmark(tmp_path, "--only", "reading")
    [row] = rows
    assert row["work"] == "text file"
    assert row["speed"] > 0.0


def test_an_unknown_name_is_refused(tmp_path: Path) -> None:
    done = subprocess.run([sys.executable, str(RUN), "--only", "nothing"], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "ensemble" in done.stderr
