"""Where compiled code is kept between processes: in folders that nobody else can write to.

Numba unpickles what lies there, so that whoever can write there can run code.
"""

from __future__ import annotations

import atexit
import logging
import os
import shutil
import sys
import tempfile
import warnings
from contextlib import suppress
from pathlib import Path
from typing import Any, cast

from limb_nodes.errors import UserError
from limb_nodes.foundation.private import private_folder, user_folder

FOLDER, NUMBA_FOLDER = "LIMB_CACHE_DIR", "NUMBA_CACHE_DIR"


def cache_folder() -> Path:
    """Where compiled programs are kept: LIMB_CACHE_DIR, or the user's cache folder, or one for this process alone.

    Raises UserError if none of them is private.
    """
    given = os.environ.get(FOLDER)
    wanted = Path(given).absolute() if given else user_folder("XDG_CACHE_HOME", ".cache")
    return private_folder(wanted) or fresh_folder(wanted)


def fresh_folder(wanted: Path) -> Path:
    """A private folder for this process and its children in place of another, removed at the end. Raises UserError."""
    folder = None
    with suppress(OSError):
        folder = private_folder(Path(tempfile.mkdtemp(prefix="limb_cache_")))
    if folder is None:
        raise UserError(f"{wanted}: others may write there; {FOLDER} is to name a folder that is yours alone")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    os.environ[FOLDER] = str(folder)
    logging.getLogger(__name__).warning(
        "%s: others may write there, or you may not; limbs are compiled anew, unless %s names a folder that is yours "
        "alone", wanted, FOLDER,
    )  # fmt: skip
    return folder


def guard_numba() -> None:
    """Import numba so that what it unpickles lies in private folders.

    It keeps it in the folder NUMBA_CACHE_DIR, in that of the module, or in one for all programs of the user; and it
    takes settings, this folder among them, from a file in the working folder, which is not read here.
    """
    begun = "numba" in sys.modules
    given = sys.modules["numba"].config.CACHE_DIR if begun else os.environ.get(NUMBA_FOLDER)
    if private_folder(Path(given).absolute() if given else Path(__file__).parent / "__pycache__") is None:
        given = str(cache_folder() / "numba")
        if begun:
            sys.modules["numba"].config.CACHE_DIR = given
        else:
            os.environ[NUMBA_FOLDER] = given
    if not begun:
        import_without_settings()


def import_without_settings() -> None:
    """Import numba, which passes over the file of settings where there is no reader of YAML."""
    yaml = sys.modules.get("yaml")
    sys.modules["yaml"] = cast(Any, None)
    warnings.filterwarnings("ignore", message="A Numba config file is found")
    try:
        from numba.core import config
    finally:
        del sys.modules["yaml"]
        if yaml is not None:
            sys.modules["yaml"] = yaml
    # Asked for again at every compilation.
    config._config_fname = ""
