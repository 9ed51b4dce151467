"""`python -m tests.faults [KIND ...]`: try faults, print a table; status 1 if one did harm."""

from __future__ import annotations

import argparse
import importlib
import pkgutil
import sys
import time
from types import ModuleType

from limb_nodes.foundation.text_table import aligned
from tests import faults
from tests.faults.trial import Trial

HEAD = (
    "kind",
    "trials",
    "lost, most s",
    "changed values",
    "time until said, most s",
    "hangs",
    "tracebacks",
    "code run",
)


def kinds() -> dict[str, ModuleType]:
    """The modules of kinds by name."""
    names = sorted(module.name for module in pkgutil.iter_modules(faults.__path__))
    modules = {name: importlib.import_module(f"{faults.__name__}.{name}") for name in names if name != "__main__"}
    return {name: module for name, module in modules.items() if hasattr(module, "KIND")}


def row(kind: str, trials: list[Trial]) -> tuple[str, ...]:
    """A row of the table."""
    said = [trial.said for trial in trials if trial.said is not None]
    return (
        kind,
        str(len(trials)),
        f"{max((trial.lost for trial in trials), default=0.0):.2f}",
        str(sum(trial.changed for trial in trials)),
        f"{max(said):.2f}" if said else "-",
        str(sum(trial.hung for trial in trials)),
        str(sum(trial.traceback for trial in trials)),
        str(sum(trial.ran_code for trial in trials)),
    )


def main() -> int:
    """Try the kinds that are asked for; the exit status."""
    found = kinds()
    parser = argparse.ArgumentParser(prog="python -m tests.faults", description=__doc__)
    parser.add_argument("kind", nargs="*", metavar="KIND", help=f"of {', '.join(found)} (default: all)")
    parser.add_argument("--trials", type=int, help="of each kind (default: as many as the full table has)")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    if unknown := set(given.kind) - set(found):
        parser.error(f"KIND is {sorted(unknown)[0]}; one of {', '.join(found)} is needed")
    rows, bad = [HEAD], []
    for name in given.kind or found:
        module, begun = found[name], time.monotonic()
        trials = list(module.trials(module.COUNT if given.trials is None else given.trials, given.seed))
        rows.append(row(module.KIND, trials))
        bad += [f"{name}: {trial}" for trial in trials if not trial.good]
        print(f"{name}: {len(trials)} trials in {time.monotonic() - begun:.0f} s", file=sys.stderr)
    print("\n".join(aligned(rows, "lrrrrrrr")))
    print("\n".join(bad[:50]))
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
