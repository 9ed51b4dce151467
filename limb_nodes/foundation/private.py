"""Folders of the user's own, in which nobody else can have put or can change a file."""

from __future__ import annotations

import os
import stat
from pathlib import Path


def user_folder(variable: str, usual: str) -> Path:
    """The program's folder below the one that an XDG variable names, or below `usual` in the user's home.

    It is not absolute if the user has no home.
    """
    base = os.environ.get(variable, "")
    return Path(base if os.path.isabs(base) else Path(os.path.expanduser("~"), usual)) / "limb_nodes"


def private_folder(path: Path) -> Path | None:
    """A folder without the links on the way to it, made if it is not there; None if it is not private.

    Private: absolute, no link, the user's own, nobody else may write in it, no other user can put another in its
    place, and this process may write there.
    """
    if not path.is_absolute():
        return None
    real = Path(os.path.realpath(path.parent), path.name)
    try:
        for folder in (*reversed(real.parents), real):
            # Not by umask: where that lets a group write, the folder would be refused.
            if not folder.exists():
                folder.mkdir(mode=0o700, exist_ok=True)
        private = is_own(real.lstat()) and os.access(real, os.W_OK | os.X_OK)
        return real if private and not any(is_exposed(folder.stat()) for folder in real.parents) else None
    except OSError:
        return None


def is_own(status: os.stat_result) -> bool:
    """Whether a file or folder is the user's, no link, and nobody else may write to it."""
    return status.st_uid == os.geteuid() and not stat.S_ISLNK(status.st_mode) and not status.st_mode & 0o022


def is_exposed(status: os.stat_result) -> bool:
    """Whether another user could move away what is in a folder. The user's own group is no other: often it is alone."""
    others = status.st_mode & 0o002 or (status.st_mode & 0o020 and status.st_gid != os.getegid())
    return status.st_uid not in (0, os.geteuid()) or bool(others and not status.st_mode & stat.S_ISVTX)
