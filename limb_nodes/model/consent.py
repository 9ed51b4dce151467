"""Consent to running the code that a limb names: given for one time, or to files that are trusted from then on.

Trust is in what the files hold, as Neovim and direnv have it: a changed file has to be trusted anew, a copy has not.
"""

from __future__ import annotations

import os
import stat
from pathlib import Path

from limb_nodes.errors import FieldError, UserError
from limb_nodes.foundation.private import is_own, private_folder, user_folder
from limb_nodes.model.user_code import UserCode

# Files that a message names.
SHOWN = 3


def require_consent(code: UserCode, source: str, allowed: bool, folder: Path | None = None) -> None:
    """Raise FieldError unless the code may run.

    source: the file that names the code. allowed: whether it may run this time, trusted or not. folder: what the
    files' names are shown from.
    """
    if code.files and not allowed and not is_trusted(code):
        paths = [module.path for module in code.files]
        if folder is not None:
            paths = [path.relative_to(folder) if path.is_relative_to(folder) else path for path in paths]
        files = [f"{path} (sha256 {module.sha256})" for path, module in zip(paths, code.files, strict=True)]
        more = f" and {len(files) - SHOWN} more" if len(files) > SHOWN else ""
        raise FieldError(
            "allow_laws",
            f"is not given, and laws are to run the code of {', '.join(files[:SHOWN])}{more}; once you have read it, "
            f"this or `limb trust {source}` is needed",
            source,
        )


def trust_file() -> Path:
    """Where hashes of trusted code are kept. Raises UserError if others may write there."""
    wanted = user_folder("XDG_STATE_HOME", ".local/state")
    folder = private_folder(wanted)
    if folder is None:
        raise UserError(f"{wanted}: is not yours alone; a folder where only you may write is needed (XDG_STATE_HOME)")
    return folder / "trusted_laws"


def is_trusted(code: UserCode) -> bool:
    """Whether the user has trusted these very files."""
    try:
        descriptor = os.open(trust_file(), os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
    except (OSError, UserError):
        return False
    with open(descriptor, encoding="utf-8", errors="replace") as file:
        status = os.fstat(descriptor)
        return is_own(status) and stat.S_ISREG(status.st_mode) and any(line[:64] == code.sha256 for line in file)


def trust(code: UserCode, source: str) -> None:
    """Trust these files from now on. source: what named them, for who reads the file. Raises UserError."""
    path = trust_file()
    try:
        descriptor = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK, 0o600)
        with open(descriptor, "w", encoding="utf-8") as file:
            file.write(f"{code.sha256}  {source!a}\n")
    except OSError as problem:
        raise UserError(f"{path}: cannot be written: {problem.strerror}") from None
    if not is_trusted(code):
        raise UserError(f"{path}: is not yours alone; a file that only you may write is needed")
