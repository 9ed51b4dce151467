"""`python -m tests.dependencies [lowest] [highest]`: install with the lowest and the highest versions, and test both.

Lowest are the lower bounds of pyproject.toml, highest what pip chooses within them. The packages of ROS 2 belong
together and are the newest of their release both times. Status 1 if something cannot be installed or a test fails.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

from docs.dependencies import requirements

ROOT = Path(__file__).resolve().parents[1]
ENDS = "lowest", "highest"
EXTRAS = "c3d,dask,parquet"
TOOLS = "hypothesis", "pytest", "pytest-xdist"
# What touches every dependency, in minutes.
TESTS = (
    "tests/analysis/test_plot.py",
    "tests/bags",
    "tests/commands/test_export.py",
    "tests/foundation",
    "tests/graph/test_lockstep.py",
    "tests/signals",
    "tests/solve/test_ensemble.py",
    "tests/solve/test_whole.py",
)
# What an environment of ROS or of Python would show through.
OF_OTHERS = {"AMENT_PREFIX_PATH", "LD_LIBRARY_PATH", "LIMB_ROS", "PYTHONHOME", "PYTHONPATH", "VIRTUAL_ENV"}
OF_OTHERS |= {"_ROS_WHEELS_BOOTSTRAP_COMPLETE", "CMAKE_PREFIX_PATH"}


def lowest() -> list[str]:
    """The lower bounds as constraints of pip."""
    bounds = (
        (requirement.name, spec.version)
        for requirement, extra in requirements()
        if extra != "Jazzy"
        for spec in requirement.specifier
        if spec.operator == ">="
    )
    return [f"{name}=={version}" for name, version in bounds]


def tried(end: str, folder: Path) -> bool:
    """Whether the program can be installed at one end, and its tests pass."""
    constraints, venv = folder / "constraints.txt", folder / "venv"
    constraints.write_text("\n".join(lowest() if end == "lowest" else []), encoding="utf-8")
    python = str(venv / "bin" / "python")
    environment = {key: value for key, value in os.environ.items() if key not in OF_OTHERS}
    environment |= {"MPLBACKEND": "Agg", "NUMBA_CACHE_DIR": str(folder / "numba"), "ROS_LOG_DIR": str(folder / "ros")}
    environment |= {"XDG_CACHE_HOME": str(folder / "cache"), "PYTHONPYCACHEPREFIX": str(folder / "pycache")}
    environment |= {"PIP_CACHE_DIR": os.environ.get("PIP_CACHE_DIR") or str(Path.home() / ".cache" / "pip")}
    install = [python, "-m", "pip", "install", "-q", "-c", str(constraints), f".[{EXTRAS}]", *TOOLS]
    for command in (
        [sys.executable, "-m", "venv", str(venv)],
        install,
        [python, "-m", "pip", "list", "--format=freeze"],
        [python, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-n", "auto", *TESTS],
    ):
        print(f"== {end}: {' '.join(command[1:])}", flush=True)
        if subprocess.run(command, cwd=ROOT, env=environment).returncode:
            return False
    return True


def main() -> int:
    """Try the ends that are asked for; the exit status."""
    given = sys.argv[1:] or list(ENDS)
    if unknown := [name for name in given if name not in ENDS]:
        print(f"{unknown[0]} is no end; {' or '.join(ENDS)} is needed", file=sys.stderr)
        return 2
    results = {}
    for end in given:
        with tempfile.TemporaryDirectory(prefix=f"limb_{end}_") as folder:
            results[end] = tried(end, Path(folder))
    for end, well in results.items():
        print(f"{end:8} {'passed' if well else 'FAILED'}")
    return 0 if all(results.values()) else 1


if __name__ == "__main__":
    sys.exit(main())
