"""The limbs and activations that come with the package."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from limb_nodes.errors import UserError


def params_folder() -> Path:
    """The folder of the shipped YAML files: of the checkout or prefix this package runs from, or of one in use.

    Raises UserError if none of them has it.
    """
    here = Path(__file__).resolve()
    # A package in a prefix lies some levels below it, in lib/python3.x/site-packages.
    prefixes = [*here.parents[3:], Path(sys.prefix)]
    prefixes += [Path(prefix) for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if prefix]
    for folder in (here.parents[2] / "params", *(prefix / "share" / "limb_nodes" / "params" for prefix in prefixes)):
        if (folder / "reference_joint.yaml").is_file():
            return folder
    raise UserError("share/limb_nodes/params is not installed; install the project with pip or colcon")


def shipped(name: str, folder: Path | None = None) -> Path:
    """A shipped YAML file, such as ``reference_joint.yaml``, or that of another folder. Raises UserError."""
    path = (folder or params_folder()) / name
    if not path.is_file():
        raise UserError(f"{path}: no such file")
    return path
