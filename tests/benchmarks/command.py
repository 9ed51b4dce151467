"""The command line of the benchmarks."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path

from tests.benchmarks import ensembles, graph, reading, solving, starting
from tests.benchmarks.table import Row, as_json, as_table

Part = Callable[[int, float], Iterator[Row]]
PARTS: dict[str, Part] = {
    "joint": solving.joint,
    "tendon": solving.tendon,
    "arm": solving.arm,
    "chains": solving.chains,
    "units": solving.many_units,
    "ensemble": ensembles.ensemble,
    "graph": graph.graph,
    "start": starting.start,
    "reading": reading.reading,
}
ROUNDS, QUICK_ROUNDS = 11, 2
DURATION, QUICK_DURATION = 10.0, 0.5
QUICK_SAMPLES = 20


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(prog="tests/benchmarks/run.py", description="Measure limb_nodes beside its peers.")
    parser.add_argument("--only", action="append", choices=PARTS, metavar="NAME", help=f"one of {', '.join(PARTS)}")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the rows to a file")
    parser.add_argument("--rounds", type=int, default=None, metavar="N", help=f"alternations (default {ROUNDS})")
    parser.add_argument("--quick", action="store_true", help="see that all runs; the figures mean nothing")
    given = parser.parse_args(arguments)
    rounds = given.rounds or (QUICK_ROUNDS if given.quick else ROUNDS)
    duration = QUICK_DURATION if given.quick else DURATION
    parts = dict(PARTS)
    if given.quick:
        parts["ensemble"] = partial(ensembles.ensemble, count=QUICK_SAMPLES)
    rows: list[Row] = []
    for name in given.only or parts:
        print(f"{name} ...", file=sys.stderr, flush=True)
        rows += parts[name](rounds, duration)
    print(as_table(rows))
    load = ", ".join(f"{value:.1f}" for value in os.getloadavg())
    print(f"\n{rounds} rounds, {len(os.sched_getaffinity(0))} cores, load {load}")
    if given.json:
        as_json(rows, given.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
