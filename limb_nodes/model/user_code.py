"""Importing laws from the user's own files."""

from __future__ import annotations

import importlib
import linecache
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

# Modules that came from beside a limb's file, with their text at the time.
_texts: dict[str, str] = {}


def user_folders(file: str) -> list[Path]:
    """Where a limb's own modules may be: beside its file, and in the working folder."""
    return [Path(file).resolve().parent, Path.cwd()]


def import_user_module(name: str, folders: Sequence[Path]) -> ModuleType:
    """The module of a name, from one of the folders or installed.

    Another limb may have brought a module of the same name, and the user may have edited the file
    since: the module is imported again if its file or text differs. Raises ImportError, or what the
    module's code raises.
    """
    path = next((p for folder in folders for p in module_files(folder, name) if p.is_file()), None)
    if path is None:
        return importlib.import_module(name)
    text = path.read_text(encoding="utf-8")
    known = sys.modules.get(name)
    if known is not None and not same_file(known, path) and name not in _texts:
        raise ImportError(f"the name is taken by {getattr(known, '__file__', None) or 'a built-in module'}")
    if known is not None and same_file(known, path) and _texts.get(name, text) == text:
        return known
    forget(folders)
    linecache.checkcache()
    importlib.invalidate_caches()
    with importable(folders):
        before = set(sys.modules)
        module = importlib.import_module(name)
        for new in set(sys.modules) - before:
            file = getattr(sys.modules[new], "__file__", None)
            if file and any(Path(file).is_relative_to(folder) for folder in folders):
                _texts[new] = Path(file).read_text(encoding="utf-8")
    return module


def forget(folders: Sequence[Path]) -> None:
    """Drop the user's modules whose file is elsewhere or has changed, with all that use them."""
    stale = False
    for name, text in _texts.items():
        path = next((p for folder in folders for p in module_files(folder, name) if p.is_file()), None)
        module = sys.modules.get(name)
        stale |= path is not None and (
            module is None or not same_file(module, path) or path.read_text(encoding="utf-8") != text
        )
    if stale:
        for name in _texts:
            sys.modules.pop(name, None)
        _texts.clear()


def module_files(folder: Path, name: str) -> list[Path]:
    """Files in which the module of a name can be."""
    base = folder.joinpath(*name.split("."))
    return [base.with_suffix(".py"), base / "__init__.py"]


def same_file(module: ModuleType, path: Path) -> bool:
    """Whether a module comes from a file."""
    file = getattr(module, "__file__", None)
    return file is not None and Path(file).resolve() == path.resolve()


@contextmanager
def importable(folders: Sequence[Path]) -> Iterator[None]:
    """Let modules in the folders be imported.

    Without bytecode on the disk: it counts as fresh after an edit in the same second that keeps the length.
    """
    extra = [str(folder) for folder in folders]
    sys.path[:0] = extra
    before, sys.dont_write_bytecode = sys.dont_write_bytecode, True
    try:
        yield
    finally:
        sys.dont_write_bytecode = before
        for entry in extra:
            sys.path.remove(entry)
