"""A folder for one trial with foreign code, and a `limb` that runs there as pip installs it."""

from __future__ import annotations

import atexit
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from tests.faults.trial import Trial

ROOT = Path(__file__).resolve().parents[2]
PARAMS = ROOT / "params"
LAW = '''
from limb_nodes.levels import Parameter, law

@law("force_length", Parameter("width", "1", "width of the bell", 0.8, above=0.0))
def bell(fibre_length_norm, width):
    """Force-length factor (1)."""
    return max(0.0, 1.0 - ((fibre_length_norm - 1.0) / width) ** 2)
'''
# A limb that is compiled in a few seconds.
BARE = "name: bare\nsegments: [{name: a, mass: 1, length: 1, com_distance: 0.5, inertia: 0.1}]\n"
SOURCE = "flexor=0.5,extensor=0.1"
LONGEST = 120.0


@cache
def caches() -> Path:
    """A private folder with the caches of all trials, as a user has them."""
    folder = Path(tempfile.mkdtemp(prefix="limb_faults_"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


def limb_with(law: str) -> str:
    """The text of a limb whose units have a law of the force by length."""
    text = (PARAMS / "reference_joint.yaml").read_text(encoding="utf-8")
    start, end = text.index("    force_length:"), text.index("    force_frequency:")
    return f"{text[:start]}    force_length: {{law: '{law}'}}\n{text[end:]}"


@dataclass
class Ground:
    """A folder for one trial: `here`, where `limb` starts, `there` with files and a bare limb, `home`, `tmp`, a mark.

    last: how the process that ran last ended.
    """

    folder: Path
    environment: dict[str, str] = field(default_factory=dict)
    last: str = ""

    def __post_init__(self) -> None:
        for name in ("here", "there", "home", "tmp", "bin"):
            (self.folder / name).mkdir(parents=True)
        # As pip writes it: Python does not look in the working folder then.
        (self.folder / "bin" / "limb").write_text("import sys\nfrom limb_nodes.cli import main\nsys.exit(main())\n")
        self.plant("there/bare.yaml", text=BARE)
        taken = {name: value for name, value in os.environ.items() if not name.startswith("XDG_")}
        self.environment = {
            **taken,
            "PYTHONPATH": str(ROOT),
            "HOME": str(self.folder / "home"),
            **dict.fromkeys(("TMPDIR", "ROS_LOG_DIR", "MPLCONFIGDIR"), str(self.folder / "tmp")),
            **{name: str(caches() / name) for name in ("LIMB_CACHE_DIR", "NUMBA_CACHE_DIR")},
        }

    @property
    def mark(self) -> Path:
        """Where code of others leaves its mark."""
        return self.folder / "mark"

    @property
    def evil(self) -> str:
        """Code that leaves a mark, and then is a law."""
        return f"open({str(self.mark)!r}, 'w').close()\n{LAW}"

    def plant(self, *names: str, text: str = "") -> None:
        """Write files; without a text, of code that leaves a mark."""
        for name in names:
            path = self.folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text or self.evil, encoding="utf-8")

    def run(self, *command: str) -> tuple[int, str]:
        """Run Python; its exit status and what it says on standard error."""
        ended = subprocess.run(
            [sys.executable, *command], cwd=self.folder / "here", env=self.environment, timeout=LONGEST, check=False,
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, encoding="utf-8",
        )  # fmt: skip
        self.last = f"status {ended.returncode}, {ended.stderr[-2000:]!r}"
        return ended.returncode, ended.stderr

    def limb(self, *arguments: str) -> tuple[int, str]:
        """Run `limb`, likewise."""
        return self.run(str(self.folder / "bin" / "limb"), *arguments)


def refused(status: int, said: str) -> bool:
    """Whether a process was ended by one line."""
    return status == 2 and said.startswith("limb: error: ") and said.count("\n") == 1


def done(status: int, said: str) -> bool:
    """Whether a process did what it was asked to, without a traceback."""
    return status == 0 and "Traceback" not in said


def either(status: int, said: str) -> bool:
    """Whether it did one of both."""
    return done(status, said) or refused(status, said)


# Does something in a folder; whether it went as it should.
Attempt = Callable[[Ground], bool]


def tried(attempts: Iterable[tuple[str, Attempt]]) -> Iterator[Trial]:
    """What became of attempts."""
    for what, attempt in attempts:
        with tempfile.TemporaryDirectory(prefix="limb_fault_") as folder:
            ground = Ground(Path(folder).resolve())
            begun, hung, right = time.monotonic(), False, False
            try:
                right = attempt(ground)
            except subprocess.TimeoutExpired:
                hung = True
            took = time.monotonic() - begun
            what = what if right else f"{what}: {ground.last}"
            yield Trial(what, said=took, traceback=not right, hung=hung, ran_code=ground.mark.exists())
