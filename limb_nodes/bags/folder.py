"""Names of bags, and the folder of one that is to be made: what commands check first, without loading a library."""

from __future__ import annotations

import re
from itertools import count
from pathlib import Path, PurePath

from limb_nodes.errors import UserError

SUFFIXES = (".mcap", ".db3", ".bag")
"""How the names of files of messages end; the last is ROS 1's."""

PACKED = (".zstd", ".zst", ".lz4")
"""What compression adds to them."""


def is_bag_file(path: PurePath) -> bool:
    """Whether a file's name says that it is a bag's file of messages, compressed or not."""
    suffixes = [suffix.lower() for suffix in path.suffixes]
    if suffixes and suffixes[-1] in PACKED:
        suffixes.pop()
    return bool(suffixes) and suffixes[-1] in SUFFIXES


def next_free(path: Path) -> Path:
    """The name of a folder for what follows what is in another one: NAME_reset1, NAME_reset2 and so on."""
    name = re.sub("_reset[0-9]+$", "", path.name)
    return next(free for number in count(1) if not (free := path.with_name(f"{name}_reset{number}")).exists())


def refuse_existing(path: Path) -> None:
    """Raise UserError if a folder that is to be made is there already, or would be within a file."""
    if path.exists() or path.is_symlink():
        raise UserError(f"{path}: exists already; the name of a new folder is needed")
    above = next(parent for parent in path.absolute().parents if parent.exists())
    if not above.is_dir():
        raise UserError(f"{path}: cannot be made, for {above} is no folder; another name is needed")
