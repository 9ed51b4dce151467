"""A long text file of EMG: how fast it is read, and in how much memory."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

import limb_nodes
from tests.benchmarks.solving import PRODUCT
from tests.benchmarks.table import Bar, Row
from tests.benchmarks.timing import Spent, median

ROWS_PER_SECOND = 1_000_000
CHANNELS = 8
LONGEST, MOST_MEMORY = 60.0, 3.0
READ = """
import resource, sys
from limb_nodes.signals.recording import read_recording
recording = read_recording(sys.argv[1])
print(len(recording.values), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


def reading(rounds: int, duration: float) -> Iterator[Row]:
    """Whole processes that read times and eight channels; 10 million rows in 10 s of `duration`."""
    rows = round(ROWS_PER_SECOND * duration)
    environment = {**os.environ, "PYTHONPATH": str(Path(limb_nodes.__file__).parents[1])}
    spent, memory = [], 0.0
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "long.csv"
        write(file, rows)
        size = file.stat().st_size
        for _ in range(max(1, rounds // 4)):
            before, begun = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
            command = [sys.executable, "-c", READ, str(file)]
            done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
            wall, after = time.perf_counter() - begun, resource.getrusage(resource.RUSAGE_CHILDREN)
            spent.append(Spent(wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime))
            read, kibibytes = map(int, done.stdout.split())
            assert read == rows
            memory = max(memory, 1024.0 * kibibytes / (8.0 * rows * (CHANNELS + 1)))
    middle = median(spent)
    bars = (
        Bar("reading, s", middle.wall, LONGEST, at_least=False),
        Bar("memory of the process over that of its numbers", memory, MOST_MEMORY, at_least=False),
    )
    note = f"{rows} rows, {CHANNELS} channels, {size / 1e6:.0f} MB, {len(spent)} processes"
    yield Row(
        "text file", PRODUCT, None, middle.wall, middle.cpu, rows / middle.wall, "rows", note=note,
        bars=bars if rows >= 10 * ROWS_PER_SECOND else (),
    )  # fmt: skip


def write(file: Path, rows: int) -> None:
    """Write times at 2000 Hz and noise of six decimals."""
    noise = [f"{value:.6f}" for value in np.random.default_rng(0).normal(size=100_003)]
    with file.open("w", encoding="utf-8") as stream:
        stream.write("time [s]," + ",".join(f"E{channel} [mV]" for channel in range(CHANNELS)) + "\n")
        for row in range(rows):
            start = CHANNELS * row % 99_991
            stream.write(f"{row / 2000:.4f},{','.join(noise[start : start + CHANNELS])}\n")
