"""Writes docs/reference/dependencies.md: what the program needs, in which versions, under which licence, and what for.

python -m docs.dependencies      write the page from pyproject.toml and from what is installed
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterable, Iterator
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

import tomllib
from packaging.requirements import Requirement

from docs.generate import table

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "reference" / "dependencies.md"
PURPOSES = {
    "charset-normalizer": "encodings of text files",
    "distributed": "ensembles on several machines",
    "ezc3d": "C3D files",
    "lz4": "bags that are compressed with it",
    "matplotlib": "pictures",
    "mcap": "writes MCAP files",
    "numba": "compiles the equations",
    "numpy": "arrays",
    "pandas": "reads columns of text files",
    "pyarrow": "Parquet files",
    "ros-diagnostic-msgs": "messages of `/diagnostics`",
    "ros-geometry-msgs": "messages of `external_load`",
    "ros-rclpy": "the nodes",
    "ros-rosgraph-msgs": "messages of `/clock`",
    "ros-sensor-msgs": "messages of `joint_states`",
    "ros-std-msgs": "messages of identity and progress",
    "ros-std-srvs": "the service `reset`",
    "ros-visualization-msgs": "messages of `muscle_markers`",
    "rosbags": "reads bags of any kind",
    "ruamel.yaml": "limbs and waveforms",
    "scipy": "filters, roots",
    "tqdm": "shows progress",
    "zstandard": "compresses bags",
}


def requirements() -> list[tuple[Requirement, str]]:
    """What is required to run, and of which extra: "" for always, or "Jazzy"."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    settings = project["tool"]["scikit-build"]["metadata"]["dependencies"]
    found = [(Requirement(text), "") for text in settings["common"]]
    found += [(Requirement(text), "Jazzy") for text in settings["distributions"]["jazzy"]["run"]]
    extras = project["project"]["optional-dependencies"]
    found += [(Requirement(text), name) for name in ("c3d", "dask", "parquet") for text in extras[name]]
    return found


def licence(name: str) -> str:
    """The licence that a package declares; "not declared" if it does not."""
    about = distribution(name).metadata
    classified = [
        text.rpartition(" :: ")[2] for text in about.get_all("Classifier") or [] if text.startswith("License")
    ]
    text = about.get("License", "")
    short = text if text and "\n" not in text and len(text) < 40 else ""
    return about.get("License-Expression", "") or short or ", ".join(classified) or "not declared"


def rows() -> Iterator[tuple[str, str, str, str]]:
    """A row for each direct requirement: name, versions, what for, licence."""
    for requirement, extra in requirements():
        versions = ", ".join(sorted(map(str, requirement.specifier), reverse=True))
        name = requirement.name + (f" (extra `{extra}`)" if extra not in ("", "Jazzy") else "")
        yield name, versions, PURPOSES[requirement.name], licence(requirement.name)


def behind(names: Iterable[str]) -> set[str]:
    """The packages that these require in turn, as installed."""
    found: set[str] = set()
    waiting = list(names)
    while waiting:
        try:
            required = distribution(waiting.pop()).requires or []
        except PackageNotFoundError:
            continue
        for requirement in map(Requirement, required):
            name = re.sub(r"[-_.]+", "-", requirement.name).lower()
            if name not in found and (requirement.marker is None or requirement.marker.evaluate({"extra": "fastrtps"})):
                found.add(name)
                waiting.append(name)
    return found


def indirect() -> Iterator[tuple[str, str]]:
    """A row for each licence of the packages behind those, but for packages of ROS 2: licence, packages."""
    direct = {re.sub(r"[-_.]+", "-", requirement.name) for requirement, _ in requirements()}
    by_licence: dict[str, list[str]] = {}
    for name in sorted(behind(direct) - direct):
        if name.startswith("ros-"):
            continue
        try:
            by_licence.setdefault(licence(name), []).append(name)
        except PackageNotFoundError:
            continue
    yield from ((key, ", ".join(names)) for key, names in sorted(by_licence.items()))


def page() -> str:
    """The page."""
    return f"""# Dependencies

What `pip install .` installs, and what the extras add. Written by `python -m docs.dependencies`; the licences are those
that the packages declare. `python -m tests.dependencies` installs the lowest and the highest versions and tests both.

{table(("package", "versions", "what for", "licence"), rows())}

The packages of ROS 2 are those of Jazzy, all of one release, with those that they require in turn; for Kilted see
`pyproject.toml`. The wheels of most of them declare no licence; in their sources it is Apache-2.0, or BSD-3-Clause for
some. Nor does the wheel of ezc3d; in its sources it is MIT.

What the others require in turn, on Linux with CPython 3.11:

{table(("licence", "packages"), indirect())}

To build: scikit-build-core, CMake, ninja, empy and catkin_pkg, and packages of ROS 2. They are not needed to run.

## What is never done with data

Nothing from a file or from the network is unpickled: the program uses no `pickle`, `marshal`, `shelve` or `joblib`, and
`numpy.load` runs with `allow_pickle=False`. numba keeps what it has compiled in files that it unpickles; they lie in
[private folders](../how-to/what-is-safe-to-open.md). YAML is read without tags that make objects.
"""


def main() -> int:
    """Write the page."""
    PAGE.write_text(page(), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
