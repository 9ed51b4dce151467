"""The text of the user's modules from which a limb's laws came, kept with a run so that it can run again."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType

from limb_nodes.model.limb import Limb
from limb_nodes.model.user_code import module_files, same_file, user_folders


def user_sources(limb: Limb) -> dict[str, str]:
    """Texts of the user's modules from which laws of the limb came, by file name.

    The names are relative to a folder (``my_law.py``, ``my_lab/hill.py``): written there, beside the
    limb's file, they make the limb load again. Modules of theirs that they import are among them.
    """
    folders = user_folders(limb.file)
    sources: dict[str, str] = {}
    waiting = [
        chosen.module
        for muscle in limb.muscles
        for laws in (muscle.laws, *(unit.laws for unit in muscle.units))
        for chosen in laws.values()
        if chosen.module
    ]
    done: set[str] = set()
    while waiting:
        name = waiting.pop()
        if name in done or name not in sys.modules:
            continue
        done.add(name)
        module = sys.modules[name]
        file = getattr(module, "__file__", None)
        if file is None:
            continue
        path = Path(file).resolve()
        depth = name.count(".") + (path.name == "__init__.py")
        root = path.parents[depth]
        sources[path.relative_to(root).as_posix()] = path.read_text(encoding="utf-8")
        waiting += [name.rpartition(".")[0]] if "." in name else []
        for value in vars(module).values():
            other = value.__name__ if isinstance(value, ModuleType) else getattr(value, "__module__", None)
            if isinstance(other, str) and is_users(other, name, root, folders):
                waiting.append(other)
    return dict(sorted(sources.items()))


def is_users(other: str, name: str, root: Path, folders: Sequence[Path]) -> bool:
    """Whether a module that the module `name` under `root` uses is to be kept with it."""
    if other.partition(".")[0] == name.partition(".")[0]:
        return True
    return root in folders and any(
        path.is_file() and same_file(sys.modules[other], path)
        for path in module_files(root, other)
        if other in sys.modules
    )
