"""The Python files from which a limb's own laws come: found and read without running them, then imported as read."""

from __future__ import annotations

import ast
import hashlib
import importlib
import importlib.util
import linecache
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from importlib.abc import InspectLoader, MetaPathFinder
from importlib.machinery import ModuleSpec
from io import StringIO
from pathlib import Path
from types import ModuleType
from typing import Any

from limb_nodes.errors import UserError
from limb_nodes.levels import CONTRACTS

# Names that no module of the user's has, whether they are in memory or not.
NOT_THEIRS = sys.stdlib_module_names | {__name__.partition(".")[0], "numba", "numpy", "scipy"}
# A limb's laws are a few short files.
LARGEST, MOST = 2**20, 1000


@dataclass(frozen=True)
class UserModule:
    """A module of the user's.

    path: its file, or the folder of a package that has none. text: what was read there. inside: where the modules of
    a package lie; () for a plain module. installed: whether it lies neither beside the limb's file nor in the working
    folder.
    """

    name: str
    path: Path
    text: str
    inside: tuple[Path, ...] = ()
    installed: bool = False

    @property
    def is_file(self) -> bool:
        """Whether there is a text to run."""
        return self.path.suffix == ".py"

    @property
    def program(self) -> str:
        """The text without the mark that some editors put in front."""
        return self.text.removeprefix("\ufeff")

    @property
    def sha256(self) -> str:
        """The hash of the file, as `sha256sum` prints it."""
        return hashlib.sha256(self.text.encode()).hexdigest()

    @property
    def relative(self) -> str:
        """The file below the folder that its name starts from, as in ``my_lab/hill.py``."""
        return "/".join(self.path.parts[-(self.name.count(".") + 1 + (self.path.stem == "__init__")) :])


@dataclass(frozen=True)
class UserCode:
    """All modules that a limb's own laws bring, by name: what consent is given to, and what is then imported.

    Plain data, which can travel to another process.
    """

    modules: Mapping[str, UserModule] = field(default_factory=dict)

    @property
    def files(self) -> list[UserModule]:
        """The modules that are files, by name."""
        return [module for _, module in sorted(self.modules.items()) if module.is_file]

    @property
    def sources(self) -> dict[str, str]:
        """Their texts by file: written to a folder, beside the limb's file, they make the limb load again."""
        return dict(sorted((module.relative, module.text) for module in self.files))

    @cached_property
    def sha256(self) -> str:
        """One hash of all names and texts, wherever the files lie."""
        lines = [f"{module.sha256}  {module.name}\n" for module in self.files]
        return hashlib.sha256("".join(lines).encode()).hexdigest()

    def load(self, name: str) -> ModuleType:
        """Import a module, whose code runs. Raises ImportError, or what its code raises.

        One that is in memory for another reason, such as that the user's program has imported it, is taken as it is.
        """
        if name in self.modules:
            with importable(self.modules):
                return importlib.import_module(name)
        if name in sys.modules and name not in _loaded:
            return sys.modules[name]
        raise ModuleNotFoundError(f"No module named {name!r}")


NO_CODE = UserCode()


def user_code(content: Any, file: str) -> UserCode:
    """The code that the content of a limb's file names, with all that it imports from the same places; none is run.

    A module lies beside the limb's file, in the working folder, or is installed. Of an installed one, those of its
    own package are followed. Raises UserError if there is too much to read.
    """
    folders = [Path(file).resolve().parent, Path.cwd()]
    modules: dict[str, UserModule] = {}
    waiting = [(name, True) for name in named_modules(content)]
    while waiting:
        name, by_limb = waiting.pop()
        for module in chain_of(name, folders, modules, by_limb):
            if len(modules) == MOST:
                raise UserError(f"{file}: its laws bring more than {MOST} modules; fewer are needed")
            modules[module.name] = module
            waiting += [(other, False) for other in imported(module) if within(other, module)]
    return UserCode(modules)


def named_modules(content: Any) -> list[str]:
    """Modules that a limb's content names as those of laws."""
    found: dict[str, None] = {}
    waiting, seen = [content], set()
    while waiting:
        value = waiting.pop()
        if id(value) in seen:
            continue
        seen.add(id(value))
        if isinstance(value, Mapping):
            for key, item in value.items():
                if isinstance(item, str) and ":" in item and (key == "law" or key in CONTRACTS):
                    found[module_of(item)] = None
                elif isinstance(item, Mapping | list):
                    waiting.append(item)
        elif isinstance(value, list):
            waiting += [item for item in value if isinstance(item, Mapping | list)]
    return list(found)


def module_of(law: str) -> str:
    """The module in the import path of a law."""
    return law.partition(":")[0].removesuffix(".py")


def within(name: str, module: UserModule) -> bool:
    """Whether an import is followed: of an installed module only those of its package."""
    return not module.installed or name.partition(".")[0] == module.name.partition(".")[0]


def chain_of(
    name: str, folders: Sequence[Path], known: Mapping[str, UserModule], by_limb: bool
) -> Iterator[UserModule]:
    """The modules that importing a name imports and that are not known yet, packages first, as far as they are there.

    by_limb: whether the limb's file names it; then it may be an installed one.
    """
    parts = name.split(".")
    module: UserModule | None = None
    for count in range(1, len(parts) + 1):
        name = ".".join(parts[:count])
        before, module = module, known.get(name)
        if module is not None:
            continue
        if before is not None:
            module = in_folders(name, before.inside, before.installed)
        elif name not in NOT_THEIRS:
            module = in_folders(name, folders)
            # A folder without __init__.py counts if nothing else has the name.
            if module is None or not module.is_file:
                elsewhere = installed(name)
                module = (elsewhere if by_limb else None) if elsewhere else module
        if module is None or is_taken(module):
            return
        yield module


def in_folders(name: str, folders: Sequence[Path], installed: bool = False) -> UserModule | None:
    """The module of a name in the first of some folders that has it."""
    last = name.rpartition(".")[2]
    if not last.isidentifier():
        return None
    for base in (folder / last for folder in folders):
        for path, inside in ((base / "__init__.py", (base,)), (base.with_name(f"{last}.py"), ())):
            if path.is_file():
                return UserModule(name, path, text_of(path), inside, installed)
        if base.is_dir():
            return UserModule(name, base, "", (base,), installed)
    return None


def installed(name: str) -> UserModule | None:
    """The installed module of a name without dots, if it is Python with a file."""
    try:
        spec = importlib.util.find_spec(name)
    except (ImportError, ValueError):
        return None
    if spec is None or spec.origin is None or not spec.origin.endswith(".py"):
        return None
    inside = tuple(Path(place) for place in spec.submodule_search_locations or ())
    return UserModule(name, Path(spec.origin), text_of(Path(spec.origin)), inside, installed=True)


def text_of(path: Path) -> str:
    """What is in a file. Raises UserError if it cannot be a law's."""
    try:
        with path.open("rb") as file:
            data = file.read(LARGEST + 1)
        if len(data) > LARGEST:
            raise UserError(f"{path}: has more than {LARGEST} bytes; a shorter file of laws is needed")
        return data.decode("utf-8")
    except (OSError, UnicodeDecodeError) as problem:
        raise UserError(f"{path}: cannot be read: {problem}") from None


def imported(module: UserModule) -> Iterator[str]:
    """Names that a module may import, without running it; none if it is not Python."""
    try:
        tree = ast.parse(module.program)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return
    package = module.name.split(".") if module.inside else module.name.split(".")[:-1]
    for item in ast.walk(tree):
        if isinstance(item, ast.Import):
            yield from (alias.name for alias in item.names)
        elif isinstance(item, ast.ImportFrom):
            start = package[: len(package) - item.level + 1] if item.level else []
            name = ".".join([*start, *filter(None, [item.module])])
            yield from (f"{name}.{alias.name}" for alias in item.names if name)


def is_taken(module: UserModule) -> bool:
    """Whether a name is in use for a module that came neither from here nor from the same file."""
    known = sys.modules.get(module.name)
    file = getattr(known, "__file__", None)
    same = file is not None and Path(file).resolve() == module.path.resolve()
    return known is not None and module.name not in _loaded and not same


# Modules that were imported from beside a limb's file or from the working folder.
_loaded: dict[str, UserModule] = {}


@contextmanager
def importable(modules: Mapping[str, UserModule]) -> Iterator[None]:
    """Let the texts of modules be imported.

    Another limb may have brought modules of the same names, and the user may have edited them: then all are imported
    again.
    """
    own = {name: module for name, module in modules.items() if not module.installed}
    if any(_loaded.get(name, module) != module for name, module in own.items()):
        for name in _loaded:
            sys.modules.pop(name, None)
        _loaded.clear()
    before = set(sys.modules)
    finder = Finder(modules)
    sys.meta_path.insert(0, finder)
    try:
        yield
    finally:
        sys.meta_path.remove(finder)
        _loaded.update({name: module for name, module in own.items() if name in sys.modules and name not in before})


class Finder(MetaPathFinder):
    """Finds modules among texts that have been read."""

    def __init__(self, modules: Mapping[str, UserModule]) -> None:
        self.modules = modules

    def find_spec(self, name: str, path: object = None, target: object = None) -> ModuleSpec | None:
        """What makes a module of its text."""
        module = self.modules.get(name)
        if module is None:
            return None
        spec = ModuleSpec(name, Loader(module.program), origin=str(module.path), is_package=bool(module.inside))
        spec.has_location = module.is_file
        if module.inside and module.installed:
            # What else an installed package has is found where it lies.
            spec.submodule_search_locations = [str(folder) for folder in module.inside]
        return spec


class Loader(InspectLoader):
    """Runs a text that has been read; neither its file nor bytecode on the disk counts."""

    def __init__(self, text: str) -> None:
        self.text = text

    def get_source(self, fullname: str) -> str:
        """The text."""
        return self.text

    def exec_module(self, module: ModuleType) -> None:
        """Run it."""
        file = getattr(module, "__file__", None) or module.__name__
        lines = StringIO(self.text, newline=None).readlines()
        # Laws are compiled from their source, which is this one; without a time it is not read again.
        linecache.cache[file] = (len(self.text), None, lines, file)
        exec(compile(self.text, file, "exec", dont_inherit=True), module.__dict__)
