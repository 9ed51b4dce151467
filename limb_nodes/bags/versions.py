"""Versions of what the numbers of a run depend on."""

from __future__ import annotations

import importlib.metadata
import platform

from limb_nodes import __version__

PACKAGES = ("numpy", "numba", "rosbags", "ros-rclpy", "scipy")


def versions() -> dict[str, str]:
    """Name of the package -> version, for those that are installed."""
    result = {"limb_nodes": __version__, "python": platform.python_version()}
    for package in PACKAGES:
        try:
            result[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            continue
    return result
