"""Code that others have planted where Python, numba or this program may look for it."""

from __future__ import annotations

import os
import pickle
import random
import shutil
import tempfile
from collections.abc import Callable, Iterator
from functools import partial
from itertools import product
from pathlib import Path

from tests.faults.ground import PARAMS, Attempt, Ground, caches, done, tried
from tests.faults.trial import Trial

KIND = "code planted in folders and caches"
SIMULATE = ("simulate", "../there/bare.yaml", "--activation", "none=0", "--duration", "0.05")
# A namespace that no other run of this machine has.
RUN = ("run", *SIMULATE[1:], "--out", "out", "--namespace", f"planted_{os.getpid()}")
COMMANDS = {
    "simulate": SIMULATE,
    "run": RUN,
    "run --processes": (*RUN, "--processes"),
    "curves": ("curves", str(PARAMS / "reference_joint.yaml"), "-o", "out.png"),
}
# Modules that these commands, their nodes and what they use import.
MODULES = ("statistics", "rclpy", "numpy", "limb_nodes", "limb_msgs", "uuid", "numba", "matplotlib", "sitecustomize")
NOBODY = 65534


def look_here(module: str, command: str, ground: Ground) -> bool:
    """A module lies in the working folder: the command does its work without it."""
    ground.plant(f"here/{module}.py")
    return done(*ground.limb(*COMMANDS[command]))


class Evil:
    """What leaves a mark when it is unpickled."""

    def __init__(self, mark: Path) -> None:
        self.mark = mark

    def __reduce__(self) -> tuple[Callable[..., int], tuple[str, int]]:
        return os.open, (str(self.mark), os.O_CREAT)


def spoil(folder: Path, ground: Ground) -> None:
    """Put code into every program and into every index of numba in a folder."""
    for path in folder.rglob("*"):
        if path.suffix == ".py":
            path.write_text(f"{ground.evil}\n{path.read_text()}")
        elif path.suffix == ".nbi":
            path.write_bytes(pickle.dumps(Evil(ground.mark)))


def warm() -> Path:
    """The caches of all trials, filled."""
    if not list((caches() / "LIMB_CACHE_DIR").rglob("*.nbi")):
        for name in ("LIMB_CACHE_DIR", "NUMBA_CACHE_DIR"):
            (caches() / name).mkdir(mode=0o700, exist_ok=True)
        with tempfile.TemporaryDirectory() as folder:
            assert done(*Ground(Path(folder).resolve()).limb(*SIMULATE))
    return caches()


# What is wrong with a folder.
FAULTS: dict[str, Callable[[Path], None]] = {
    "others may write": lambda folder: folder.chmod(0o707),
    "a group may write": lambda folder: folder.chmod(0o770),
    "others may write, but not delete": lambda folder: folder.chmod(0o1777),
    "its folder is open": lambda folder: folder.parent.chmod(0o777),
    "it is a link": lambda folder: folder.symlink_to(folder.rename(folder.with_name("elsewhere"))),
}
if os.geteuid() == 0:
    FAULTS |= {
        "another's": lambda folder: os.chown(folder, NOBODY, NOBODY),
        "its folder is another's": lambda folder: os.chown(folder.parent, NOBODY, NOBODY),
    }
# Which folder holds the programs, which the pickles of numba.
PLACES = {
    "LIMB_CACHE_DIR": "LIMB_CACHE_DIR",
    "NUMBA_CACHE_DIR": "NUMBA_CACHE_DIR",
    "XDG_CACHE_HOME": "LIMB_CACHE_DIR",
    "HOME": "LIMB_CACHE_DIR",
}


def spoiled(place: str, ground: Ground) -> Path:
    """A folder of caches in which there is code of others, and the variable that leads there."""
    folder = ground.folder / "planted" / {"XDG_CACHE_HOME": "limb_nodes", "HOME": ".cache/limb_nodes"}.get(place, "own")
    source = warm() / ("NUMBA_CACHE_DIR" if place == "NUMBA_CACHE_DIR" else "LIMB_CACHE_DIR")
    folder.parent.mkdir(parents=True, mode=0o700)
    shutil.copytree(source, folder)
    folder.chmod(0o700)
    spoil(folder, ground)
    if place in ("HOME", "XDG_CACHE_HOME"):
        del ground.environment["LIMB_CACHE_DIR"]
    ground.environment[place] = str(folder if place.endswith("_DIR") else ground.folder / "planted")
    return folder


def use_cache(place: str, fault: str, ground: Ground) -> bool:
    """A folder of caches is not private: the command does its work without it."""
    FAULTS[fault](spoiled(place, ground))
    return done(*ground.limb(*SIMULATE))


def use_public(home: str, ground: Ground) -> bool:
    """There is no folder for the user's caches, but one of a known name in the temporary folder."""
    ground.environment["HOME"] = home
    del ground.environment["LIMB_CACHE_DIR"]
    for user in (os.getuid(), os.geteuid()):
        for name in (f"limb_nodes-{user}", f"limb_nodes_{user}", "limb_nodes", "limb_cache"):
            shutil.copytree(warm() / "LIMB_CACHE_DIR", ground.folder / "tmp" / name, dirs_exist_ok=True)
    (ground.folder / "tmp").chmod(0o1777)
    spoil(ground.folder / "tmp", ground)
    return done(*ground.limb(*SIMULATE)) and not list((ground.folder / "tmp").glob("limb_cache_*"))


def set_numba(setting: str, ground: Ground) -> bool:
    """A file of settings of numba lies in the working folder."""
    shutil.copytree(warm() / "NUMBA_CACHE_DIR", ground.folder / "here" / "cache")
    spoil(ground.folder / "here" / "cache", ground)
    del ground.environment["NUMBA_CACHE_DIR"]
    ground.plant("here/evil.py")
    ground.plant("here/.numba_config.yaml", text=setting)
    return done(*ground.limb(*SIMULATE))


SETTINGS = (
    "cache_dir: cache",
    "cache_locator_classes: evil.Evil",
    "[1, 2]",
    "{",
    "disable_jit: 1\ncache_dir: cache",
)


def set_matplotlib(ground: Ground) -> bool:
    """A file of settings of matplotlib lies in the working folder."""
    ground.environment.pop("MPLBACKEND", None)
    ground.plant("here/evil.py")
    ground.plant("here/matplotlibrc", text="backend: module://evil\n")
    return done(*ground.limb(*COMMANDS["curves"]))


def attempts() -> Iterator[tuple[str, Attempt]]:
    """All of them."""
    for module, command in product(MODULES, COMMANDS):
        yield f"limb {command} beside {module}.py", partial(look_here, module, command)
    for place, fault in product(PLACES, FAULTS):
        yield f"{place}: {fault}", partial(use_cache, place, fault)
    for home in ("/proc/none", "/dev/null", "", ".", "/nowhere" * 40):
        yield f"HOME={home[:20]}", partial(use_public, home)
    for setting in SETTINGS:
        yield f".numba_config.yaml: {setting}", partial(set_numba, setting)
    yield "matplotlibrc", set_matplotlib


COUNT = len(list(attempts()))


def trials(count: int, seed: int) -> Iterator[Trial]:
    """Some or all of them, in an order by the seed."""
    every = list(attempts())
    random.Random(seed).shuffle(every)
    return tried(every[:count])
