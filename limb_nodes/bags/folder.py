"""The folder of a bag that is to be made. Commands check it before anything else, without loading what writes bags."""

from __future__ import annotations

from pathlib import Path

from limb_nodes.errors import UserError


def refuse_existing(path: Path) -> None:
    """Raise UserError if a folder that is to be made is there already, or would be within a file."""
    if path.exists() or path.is_symlink():
        raise UserError(f"{path}: exists already; the name of a new folder is needed")
    above = next(parent for parent in path.absolute().parents if parent.exists())
    if not above.is_dir():
        raise UserError(f"{path}: cannot be made, for {above} is no folder; another name is needed")
