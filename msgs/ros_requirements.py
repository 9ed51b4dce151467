"""What `pip install` requires of the chosen distribution of ROS 2, to build and to run. Read by pip only.

A provider of dynamic metadata (scikit-build-core) with the tables of `[tool.scikit-build.metadata.dependencies]` in
pyproject.toml: one for each distribution, and what is the same on all of them.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

VARIABLE, DEFAULT = "LIMB_ROS", "jazzy"


def chosen(settings: Mapping[str, Any]) -> Mapping[str, list[str]]:
    """The requirements `build` and `run` of the distribution that the environment names."""
    distributions = settings["distributions"]
    name = os.environ.get(VARIABLE) or DEFAULT
    if name not in distributions:
        raise SystemExit(f"{VARIABLE} is {name!r}; {' or '.join(distributions)} is needed")
    return distributions[name]


def get_requires_for_dynamic_metadata(settings: Mapping[str, Any]) -> list[str]:
    """What the build needs."""
    return chosen(settings)["build"]


def dynamic_metadata(field: str, settings: Mapping[str, Any], project: Mapping[str, Any]) -> list[str]:
    """The project's dependencies."""
    return [*chosen(settings)["run"], *settings["common"]]
