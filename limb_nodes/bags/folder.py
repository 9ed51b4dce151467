"""The folder of a bag that is to be made. Commands check it before anything else, without loading what writes bags."""

from __future__ import annotations

from pathlib import Path

from limb_nodes.errors import UserError


def refuse_existing(path: Path) -> None:
    """Raise UserError where a folder that is to be made is there already, or would be within a file."""
    if path.exists() or path.is_symlink():
        raise UserError(f"{path}: exists already; give the name of a folder that does not")
    above = next(parent for parent in path.absolute().parents if parent.exists())
    if not above.is_dir():
        raise UserError(f"{path}: the folder for the bag can't be made: {above} is not a folder")
