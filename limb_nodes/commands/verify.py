"""`limb verify`: every case of the report's section 3.3, by the whole-model solve and by the graph of nodes."""

from __future__ import annotations

import argparse
import json
import math
import os
import shlex
import signal
import sys
import tempfile
from collections.abc import Sequence
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

from limb_nodes.commands import add_allow_laws, writing
from limb_nodes.errors import FieldError
from limb_nodes.foundation.text_table import aligned

if TYPE_CHECKING:
    from limb_nodes.analysis.trajectory import Trajectory
    from limb_nodes.analysis.verification import Case, Finding
    from limb_nodes.model.limb import Limb

WAYS = ("whole", "graph")


def add_parser(subparsers: Any) -> None:
    """Declare the command."""
    parser = subparsers.add_parser(
        "verify",
        help="check the model against the cases of the report's section 3.3",
        description="Run every case by the whole-model solve and by the graph of nodes at 1 kHz, and compare what "
        "they show with what mechanics expects. Exit status 1 if a quantity is out of its tolerance.",
    )
    way = parser.add_mutually_exclusive_group()
    way.add_argument("--whole", action="store_true", help="only the whole-model solve")
    way.add_argument("--graph", action="store_true", help="only the graph of nodes")
    parser.add_argument("--case", action="append", metavar="NAME", help="only this case, such as 3.6-range; repeatable")
    parser.add_argument("--json", action="store_true", help="print a list of findings as JSON")
    parser.add_argument("--figures", metavar="DIR", help="redraw the report's figures, one PNG per case")
    parser.add_argument(
        "--limbs", metavar="DIR", help="take reference_joint.yaml and reference_joint_tendon.yaml from here"
    )
    add_allow_laws(parser)


def run(args: argparse.Namespace) -> int:
    """Run the cases, print, draw; 1 if a quantity is not as expected."""
    from limb_nodes.analysis.verification import CASES, measure
    from limb_nodes.model.report_laws import other_laws

    cases = chosen(args.case, CASES)
    folder = Path(args.limbs) if args.limbs else None
    limbs = {case.name: case.build(folder, args.allow_laws) for case in cases}
    pictures = make_folder(args.figures) if args.figures else None
    ways = ("whole",) if args.whole else ("graph",) if args.graph else WAYS
    trajectories: dict[str, dict[str, Trajectory]] = {case.name: {} for case in cases}
    findings: list[Finding] = []
    for way in ways:
        for case in cases:
            trajectory = run_case(case, limbs[case.name], way)
            findings += measure(case, way, trajectory)
            if trajectory is not None:
                trajectories[case.name][way] = trajectory
    if pictures:
        from limb_nodes.analysis.verification_figures import draw_case

        for case in cases:
            if trajectories[case.name]:
                path = pictures / f"figure_{case.name.replace('.', '_').replace('-', '_')}.png"
                draw_case(case, limbs[case.name].muscle_names, trajectories[case.name], path)
    if args.json:
        print(json.dumps([finding.plain() for finding in findings], indent=1))
    else:
        print(table(cases, ways, findings))
        others = sorted({law for limb in limbs.values() for law in other_laws(limb)})
        print(f"laws that are not the report's: {', '.join(others) or 'none'}")
        if pictures:
            print(f"\nfigures: {pictures}")
    return 0 if all(finding.passed for finding in findings) else 1


def chosen(names: Sequence[str] | None, cases: Sequence[Case]) -> list[Case]:
    """The cases that were asked for, all by default."""
    known = [case.name for case in cases]
    for name in names or ():
        if name not in known:
            raise FieldError("case", f"is {name!r}; one of {', '.join(known)} is needed")
    return [case for case in cases if not names or case.name in names]


def make_folder(folder: str) -> Path:
    """The folder for the figures, made if need be."""
    path = Path(folder)
    with writing("figures"):
        path.mkdir(parents=True, exist_ok=True)
    return path


def run_case(case: Case, limb: Limb, way: str) -> Trajectory | None:
    """Run a case one way; None, and a line, if the equations cannot be solved."""
    from limb_nodes.analysis.verification import solve_whole
    from limb_nodes.solve.failure import SolveError

    try:
        return solve_whole(case, limb) if way == "whole" else solve_graph(case, limb)
    except SolveError as problem:
        print(f"limb: case {case.name} by {way}: {problem}", file=sys.stderr)
        return None


def solve_graph(case: Case, limb: Limb) -> Trajectory:
    """Run a case by the nodes, in one process, into a bag that lives as long as this takes."""
    from limb_nodes.analysis.trajectory import trajectory_of_bag
    from limb_nodes.analysis.verification import RATE
    from limb_nodes.foundation.topics import STATES
    from limb_nodes.nodes.session import run_in_one_process
    from limb_nodes.nodes.settings import RunSettings
    from limb_nodes.solve.failure import SolveError

    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    with tempfile.TemporaryDirectory(prefix="limb_verify_") as folder:
        file, source, bag = (Path(folder) / name for name in ("limb.yaml", "activation.csv", "bag"))
        write_limb(limb, file)
        write_activation(case, limb, source)
        settings = RunSettings(
            limb=str(file),
            source=str(source),
            rate=RATE,
            duration=case.duration,
            out=str(bag),
            # No other run, and no case before this one, is heard here.
            namespace=f"/limb_verify_{os.getpid()}_{case.name.replace('.', '_').replace('-', '_')}",
            states=STATES if case.states else (),
            command=shlex.join(["limb", *sys.argv[1:]]),
            # What may run was asked when the limb was loaded.
            allow_laws=True,
        )
        try:
            outcome = run_in_one_process(settings, lambda tick: None)
        finally:
            for number, handler in handlers.items():
                signal.signal(number, handler)
        if outcome.interrupted:
            raise KeyboardInterrupt
        if outcome.missing or outcome.ticks != round(case.duration * RATE) + 1:
            raise SolveError(f"{outcome.ticks} ticks recorded, {outcome.missing} messages missing")
        return trajectory_of_bag(bag)


def write_limb(limb: Limb, path: Path) -> None:
    """Write a limb as it is now, which its text may not say, and its own laws beside it."""
    from ruamel.yaml import YAML

    for name, text in limb.code.sources.items():
        law = path.parent / name
        law.parent.mkdir(parents=True, exist_ok=True)
        law.write_text(text, encoding="utf-8")
    with path.open("w", encoding="utf-8") as file:
        YAML(typ="safe", pure=True).dump(limb.content, file)


def write_activation(case: Case, limb: Limb, path: Path) -> None:
    """Write the very numbers that the whole-model solve is given."""
    from limb_nodes.analysis.verification import RATE

    lines = [",".join(["time", *limb.muscle_names])]
    lines += [
        ",".join(repr(float(value)) for value in (tick / RATE, *row)) for tick, row in enumerate(case.drive(limb))
    ]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def table(cases: Sequence[Case], ways: Sequence[str], findings: Sequence[Finding]) -> str:
    """Expected and measured value, tolerance and verdict of every quantity."""
    by_key = {(finding.case.name, finding.quantity.name, finding.solver): finding for finding in findings}
    rows = [("  quantity", "expected", *ways, "tolerance", "verdict")]
    for case in cases:
        for quantity in case.quantities:
            of = [by_key[case.name, quantity.name, way] for way in ways]
            failed = [finding.solver for finding in of if not finding.passed]
            verdict = f"FAILED ({', '.join(failed)})" if failed else "passed"
            numbers = [number(value) for value in (quantity.expected, *(finding.value for finding in of))]
            rows.append((f"  {quantity.name}", *numbers, f"{quantity.tolerance:.2g}", verdict))
    head, *texts = aligned(rows, "l" + "r" * (len(ways) + 2))
    lines, rest = [head], iter(texts)
    for case in cases:
        lines += [f"case {case.name}: {case.set_up}", *islice(rest, len(case.quantities))]
    bad = sum(not finding.passed for finding in findings)
    lines.append(f"{len(findings) - bad} of {len(findings)} passed" + (f", {bad} FAILED" if bad else ""))
    return "\n".join(lines)


def number(value: float) -> str:
    """A number with seven digits."""
    return f"{value:.7g}" if math.isfinite(value) else "none"
