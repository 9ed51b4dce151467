"""Hostile environments: folders, locales, limits, streams, names and signals, each with several commands.

A command does what it is asked to or says in one line why not, ends soon, and shows no traceback.
"""

from __future__ import annotations

import os
import random
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path

from tests.faults.ground import BARE, PARAMS, ROOT, caches
from tests.faults.trial import Trial

KIND = "a hostile environment"
COUNT = 300
# Nothing here takes a minute on a machine that is not busy.
LONGEST = 240.0
# As many processes at a time.
TOGETHER = 2
KNEE, WAVES = PARAMS / "seated_knee.yaml", PARAMS / "activation_knee.yaml"


@dataclass(frozen=True)
class Place:
    """An environment. variables: of the environment, None for one that is not there. before: a line of the shell that
    starts the command, `{work}` being a fresh folder. streams: behind the command. also: exit statuses of others than
    the program, such as that of a signal. ros: whether only commands that use ROS meet it.
    """

    variables: Mapping[str, str | None] = field(default_factory=dict)
    before: str = ""
    streams: str = ""
    also: tuple[int, ...] = ()
    ros: bool = False


def of(**variables: str | None) -> Place:
    """An environment with some variables."""
    return Place(variables)


FOLDERS = {
    f"{name}={value}": Place({name: value})
    for name in ("HOME", "TMPDIR", "XDG_CACHE_HOME", "LIMB_CACHE_DIR", "NUMBA_CACHE_DIR", "MPLCONFIGDIR", "ROS_LOG_DIR")
    for value in ("/proc/absent", "/dev/null", "")
}
LOCALES = {
    "the locale C": of(LC_ALL="C", PYTHONUTF8="0", PYTHONCOERCECLOCALE="0"),
    "no such locale": of(LC_ALL="xx_YY.bad", LANG="xx_YY.bad"),
    **{f"streams in {name}": of(PYTHONIOENCODING=name) for name in ("ascii", "latin-1", "utf-16", "ascii:strict")},
    "no time zone": of(TZ="bad/zone"),
    "a terminal of one column": of(COLUMNS="1", TERM="dumb"),
    "columns that are none": of(COLUMNS="many", LINES="-1"),
}
LIBRARIES = {
    "without docstrings": of(PYTHONOPTIMIZE="2"),
    "warnings": of(PYTHONWARNINGS="always"),
    "development": of(PYTHONDEVMODE="1"),
    "a backend that is none": of(MPLBACKEND="nonsense"),
    "a backend without a display": of(MPLBACKEND="TkAgg", DISPLAY=None),
    "threads that are none": of(OMP_NUM_THREADS="many", OPENBLAS_NUM_THREADS="-1"),
    "threads of numba": of(NUMBA_NUM_THREADS="0"),
    "threads of numba in words": of(NUMBA_NUM_THREADS="many"),
    "an optimisation that is none": of(NUMBA_OPT="nonsense"),
}
ROS = {
    name: replace(place, ros=True)
    for name, place in {
        **{f"ROS_DOMAIN_ID={value}": of(ROS_DOMAIN_ID=value) for value in ("abc", "999", "-1", "1e1", "9" * 5000)},
        # rcl itself ends the process.
        "no such middleware": Place({"RMW_IMPLEMENTATION": "nonsense"}, also=(1, 102)),
        "no such range": of(ROS_AUTOMATIC_DISCOVERY_RANGE="NONSENSE"),
        "peers that are none": of(ROS_STATIC_PEERS=";;x y;:::"),
        "no such profiles": of(FASTRTPS_DEFAULT_PROFILES_FILE="/absent.xml"),
        "profiles that are none": of(FASTRTPS_DEFAULT_PROFILES_FILE=str(KNEE)),
        "a form of logs that is none": of(RCUTILS_CONSOLE_OUTPUT_FORMAT="{nonsense} {{", RCUTILS_COLORIZED_OUTPUT="9"),
        "a stream of logs that is none": of(RCUTILS_LOGGING_USE_STDOUT="9", RCUTILS_LOGGING_BUFFERED_STREAM="9"),
        "security without keys": of(ROS_SECURITY_ENABLE="true", ROS_SECURITY_STRATEGY="Enforce"),
        "ROS_HOME": of(ROS_HOME="/dev/null", ROS_LOG_DIR=None),
        "neither home nor logs": of(HOME=None, ROS_LOG_DIR=None),
    }.items()
}
LIMITS = {
    **{f"ulimit {limit}": Place(before=f"ulimit {limit}") for limit in ("-v 150000", "-v 600000", "-v 2000000")},
    **{f"ulimit {limit}": Place(before=f"ulimit {limit}") for limit in ("-d 50000", "-n 8", "-n 16", "-n 40", "-l 0")},
    **{f"ulimit {limit}": Place(before=f"ulimit {limit}") for limit in ("-f 0", "-f 8", "-f 64", "-c 0")},
    "ulimit -s 512": Place(before="ulimit -s 512", also=(-signal.SIGSEGV,)),
    "a second of processor time": Place(before="ulimit -t 1", also=(-signal.SIGXCPU, -signal.SIGKILL, 1, 2)),
    "a working folder that is gone": Place(before='mkdir {work}/gone; cd {work}/gone; rmdir "$PWD"'),
    "a working folder in /proc": Place(before="cd /proc"),
    "a mask that takes all": Place(before="umask 777"),
    "signals ignored": Place(before="trap '' INT TERM HUP PIPE CHLD"),
}
STREAMS = {
    f"streams {streams}": Place(streams=streams)
    for streams in (
        "<&-", ">&-", "2>&-", "<&- >&- 2>&-", ">/dev/full", "2>/dev/full", ">/dev/full 2>&1",
        "</dev/zero", "| true",
        "2>&1 >&- | true",
    )
}  # fmt: skip
PLACES = {**FOLDERS, **LOCALES, **LIBRARIES, **ROS, **LIMITS, **STREAMS}

# Names of files that are given to commands, and of what they shall write.
NAMES: tuple[bytes, ...] = (
    b"x" * 300, b"/dev/null", b"/dev/zero", b"/dev/full", b"/proc/self/mem", b"loop", b"loop/x", b"", b".", b"/",
    b"a\xff",
    b"\x1b[31mred", b"two\nlines", "\u202eabc".encode(), b"-", b"~", b"$HOME", b"dir", b"dir/" + b"y/" * 2000, b"a:b",
    b"a b",
)  # fmt: skip
WITH_NAMES: tuple[tuple[str, ...], ...] = (
    ("structure", "@"), ("simulate", "bare.yaml", "--activation", "@", "--duration", "0.1"),
    ("simulate", "bare.yaml", "--activation", "x=0", "--duration", "0.1", "--out", "@"), ("plot", "@"),
    ("recover", "@"),
    ("emg", "@", "--out", "made"), ("emg", "emg.csv", "--out", "@"), ("export", "@", "-o", "made.csv"),
    ("export", "bag", "-o", "@"), ("run", "bare.yaml", "--activation", "x=0", "--duration", "0.1", "--out", "@"),
    ("rerun", "@", "--out", "made"), ("play", "@"), ("muscle", "@", "flexor"), ("curves", "@", "-o", "made.png"),
)  # fmt: skip

SHORT = ("--activation", "x=0", "--duration", "0.2")
COMMANDS: dict[str, tuple[str, ...]] = {
    "structure": ("limb", "structure", str(KNEE)),
    "simulate": ("limb", "simulate", "bare.yaml", *SHORT, "--out", "made"),
    "plot": ("limb", "plot", "bag", "-o", "made.png"),
    "emg": ("limb", "emg", "emg.csv", "--out", "made"),
    "export": ("limb", "export", "bag", "-o", "made.csv"),
    "curves": ("limb", "curves", str(KNEE), "-o", "made.png"),
    "recover": ("limb", "recover", "cut", "-o", "made"),
    "run": ("limb", "run", "bare.yaml", *SHORT, "--out", "made"),
    "run --processes": ("limb", "run", "bare.yaml", *SHORT, "--out", "made", "--processes"),
    "muscle_stack": ("node", "muscle_stack", "--ros-args", "-p", "limb:=absent.yaml"),
    "recorder": ("node", "recorder", "--ros-args", "-p", "limb:=bare.yaml", "-p", "out:=''"),
}
WITH_ROS = ("run", "run --processes", "muscle_stack", "recorder")
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGPIPE)
LONG = ("--activation", "x=0", "--duration", "60")
ENDED: dict[str, tuple[str, ...]] = {
    "simulate": ("limb", "simulate", str(KNEE), "--activation", str(WAVES), "--duration", "60", "--out", "made"),
    "run": ("limb", "run", "bare.yaml", *LONG, "--out", "made"),
    "run --processes": ("limb", "run", "bare.yaml", *LONG, "--out", "made", "--processes"),
    "limb_dynamics": ("node", "limb_dynamics", "--ros-args", "-p", "limb:=bare.yaml"),
}


@cache
def materials() -> Path:
    """A folder with what the commands read, made once."""
    folder = Path(tempfile.mkdtemp(prefix="limb_materials_", dir=caches()))
    (folder / "bare.yaml").write_text(BARE, encoding="utf-8")
    rows = [f"{row / 1000:.3f},{row * 7919 % 13 - 6}" for row in range(2000)]
    (folder / "emg.csv").write_text("\n".join(["time (s),RF (mV)", *rows]), encoding="utf-8")
    for out in "bag", "cut":
        status, _, said = execute((*COMMANDS["simulate"][:-1], out), Place(), folder)
        assert status == 0, said
    (folder / "cut" / "metadata.yaml").unlink()
    return folder


def execute(
    command: tuple[str | bytes, ...], place: Place, folder: Path, end: tuple[signal.Signals, float] | None = None
) -> tuple[int, float, str]:
    """Run a command in a folder; its exit status, how long it took (s), and what it said on standard error.

    The status is None-like, -1000, if it did not end. end: a signal, and how long (s) after it has begun to work.
    """
    kind, *rest = command
    module = "limb_nodes.cli" if kind == "limb" else f"limb_nodes.nodes.{rest.pop(0)!s}"
    environment = {
        **{name: value for name, value in os.environ.items() if name != "LIMB_DEBUG"},
        "PYTHONPATH": str(ROOT),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "ROS_DOMAIN_ID": str(110 + os.getpid() % 100),
        "ROS_LOG_DIR": str(caches() / "log"),
        **{name: str(caches() / name) for name in ("LIMB_CACHE_DIR", "NUMBA_CACHE_DIR", "MPLCONFIGDIR")},
    }
    for name, value in place.variables.items():
        environment.pop(name, None)
        if value is not None:
            environment[name] = value
    before = place.before.format(work=folder)
    line = f'{before}\n{"exec " if "|" not in place.streams else ""}"$@" {place.streams}'
    begun = time.monotonic()
    child = subprocess.Popen(
        ["bash", "-c", line, "bash", sys.executable, "-m", module, *rest],
        cwd=folder, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
        start_new_session=True,
    )  # fmt: skip
    try:
        if end is not None:
            _await_libraries(child)
            time.sleep(end[1])
            child.send_signal(end[0])
        _, said = child.communicate(timeout=LONGEST)
        status = child.returncode
    except subprocess.TimeoutExpired:
        os.killpg(child.pid, signal.SIGKILL)
        _, said = child.communicate()
        status = -1000
    # Some of it may be in UTF-16.
    return status, time.monotonic() - begun, said.replace(b"\0", b"").decode("utf-8", "replace")


def _await_libraries(child: subprocess.Popen[bytes]) -> None:
    """Wait until the program itself runs, and no more the start of Python."""
    while child.poll() is None and "_multiarray_umath" not in Path(f"/proc/{child.pid}/maps").read_text():
        time.sleep(0.01)


def judge(what: str, status: int, seconds: float, said: str, also: tuple[int, ...], deaf: bool = False) -> Trial:
    """What became of a trial. also: statuses that it may end with besides. deaf: whether standard error was closed."""
    lines = re.findall(r"^limb: (?:error: .*|interrupted)$", said, re.MULTILINE)
    fault = "Traceback" in said or "a fault of limb" in said or "Exception ignored" in said
    wrong = status not in (0, 1, 2, *also) or (status in (1, 2) and not deaf and len(lines) != 1 and status not in also)
    told = f"{what}: status {status} after {seconds:.1f} s, {said[-600:]!r}"
    return Trial(told, said=seconds if lines else None, traceback=fault or wrong, hung=status == -1000)


def in_place(name: str, command: str) -> Trial:
    """A command in an environment."""
    place = PLACES[name]
    with tempfile.TemporaryDirectory(prefix="limb_place_", dir=caches()) as folder:
        work = _furnished(Path(folder))
        status, seconds, said = execute(COMMANDS[command], place, work)
    deaf = "2>" in place.streams or "|" in place.streams
    return judge(f"{command}, {name[:60]}", status, seconds, said, place.also, deaf)


def with_name(name: bytes, command: tuple[str, ...]) -> Trial:
    """A command with a name for one of its arguments."""
    with tempfile.TemporaryDirectory(prefix="limb_name_", dir=caches()) as folder:
        work = _furnished(Path(folder))
        (work / "loop").symlink_to("loop")
        (work / "dir").mkdir()
        given = tuple(name if argument == "@" else argument for argument in ("limb", *command))
        status, seconds, said = execute(given, Place(), work)
    trial = judge(f"limb {' '.join(command)} with {name[:40]!r}", status, seconds, said, ())
    long = [line for line in said.splitlines() if not line.isprintable() or len(line) > 1300]
    return replace(trial, traceback=trial.traceback or bool(long))


def ended(number: signal.Signals, command: str, after: float) -> Trial:
    """A command that gets a signal while it works; what it has recorded can be read or recovered."""
    with tempfile.TemporaryDirectory(prefix="limb_signal_", dir=caches()) as folder:
        work = _furnished(Path(folder))
        status, seconds, said = execute(ENDED[command], Place(), work, (number, after))
        trial = judge(f"{command}, {number.name} after {after:.2f} s", status, seconds, said, (130, -number))
        if (work / "made").exists() and not (work / "made" / "metadata.yaml").exists():
            again, _, why = execute(("limb", "recover", "made", "-o", "again"), Place(), work)
            return replace(
                trial, what=f"{trial.what}; recover: {again} {why!r}", traceback=trial.traceback or again != 0
            )
    return trial


def _furnished(folder: Path) -> Path:
    for path in materials().iterdir():
        (folder / path.name).symlink_to(path)
    return folder


def trials(count: int, seed: int) -> Iterator[Trial]:
    """Of all environments, names and signals with all commands, so many; the seed gives which."""
    chance = random.Random(seed)
    every = [
        (in_place, (name, command))
        for name, place in PLACES.items()
        for command in (WITH_ROS if place.ros else COMMANDS)
    ]
    names = [(with_name, (name, command)) for name in NAMES for command in WITH_NAMES]
    # Python passes over SIGPIPE, and a node alone goes on waiting.
    pairs = [(number, command) for number in SIGNALS for command in ENDED]
    pairs.remove((signal.SIGPIPE, "limb_dynamics"))
    signals = [(ended, (*pair, chance.uniform(0.0, 4.0))) for pair in pairs * 4]
    for group in every, names, signals:
        chance.shuffle(group)
    # Three of five are environments.
    chosen = every[: count - 2 * (count // 5)] + names[: count // 5] + signals[: count // 5]
    materials()
    with ThreadPoolExecutor(TOGETHER) as pool:
        yield from pool.map(lambda one: one[0](*one[1]), chosen)
