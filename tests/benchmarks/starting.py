"""Whole processes of `limb simulate`: cold, warm, and with one law exchanged."""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from ruamel.yaml import YAML

import limb_nodes
from limb_nodes.model.shipped import shipped
from tests.benchmarks.solving import PRODUCT
from tests.benchmarks.table import Bar, Row
from tests.benchmarks.timing import Spent, median, timed_process

LIMIT = {"cold": 15.0, "warm": 1.5, "a law exchanged, first": None, "a law exchanged, second": 2.0}


def start(rounds: int, duration: float) -> Iterator[Row]:
    """Start-up of the reference joint."""
    found: dict[str, list[Spent]] = {name: [] for name in LIMIT}
    with tempfile.TemporaryDirectory() as folder:
        given = shipped("reference_joint.yaml")
        other = exchanged(given, Path(folder) / "other.yaml")
        for number in range(max(1, rounds // 4)):
            caches = Path(folder) / f"cache{number}"
            environment = {
                **os.environ,
                "LIMB_CACHE_DIR": str(caches / "limb"),
                "NUMBA_CACHE_DIR": str(caches / "numba"),
                "PYTHONPATH": str(Path(limb_nodes.__file__).parents[1]),
            }

            def run(limb: Path, environment: dict[str, str] = environment) -> Spent:
                activation = str(shipped("activation_sine_cosine.yaml"))
                command = [sys.executable, "-m", "limb_nodes.cli", "simulate", str(limb), "--activation", activation]
                return timed_process([*command, "--duration", str(duration)], environment)

            found["cold"].append(run(given))
            found["warm"] += [run(given) for _ in range(2)]
            found["a law exchanged, first"].append(run(other))
            found["a law exchanged, second"] += [run(other) for _ in range(2)]
    for name, spent in found.items():
        middle, limit = median(spent), LIMIT[name]
        bars = () if limit is None else (Bar(f"{name}, s", middle.wall, limit, at_least=False),)
        note = f"limb simulate, {duration:g} s of movement, {len(spent)} processes"
        yield Row(
            f"start, {name}", PRODUCT, None, middle.wall, middle.cpu, 1.0 / middle.wall, "runs", note=note, bars=bars
        )


def exchanged(limb: Path, file: Path) -> Path:
    """A limb's file with Hill's sarcomeres instead of its own."""
    yaml = YAML(typ="safe", pure=True)
    content = yaml.load(limb.read_text(encoding="utf-8"))
    for name, kind in content["sarcomeres"].items():
        lengths = {key: kind[key] for key in ("myosin_length", "actin_length")}
        content["sarcomeres"][name] = {"law": "hill", **lengths}
    with file.open("w", encoding="utf-8") as stream:
        yaml.dump(content, stream)
    return file
