"""Limb files that something has happened to: each is refused in one line, or is a limb that can be built and solved."""

from __future__ import annotations

import json
import math
import os
import random
import select
import subprocess
import sys
import time
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from tests.faults.trial import Trial

KIND = "mutated limb files"
COUNT = 10_000
PARAMS = Path(__file__).resolve().parents[2] / "params"
# The small ones more often, for they take less time.
LIMBS = ["reference_joint"] * 4 + ["reference_joint_tendon"] * 4 + ["seated_knee", "arm", "pennate_leg"]
LONGEST = 5.0  # s of processor time for one file
SILENCE = 100.0  # s of any time
MEMORY = 2**20  # kB that all files together may take
SAMPLES, RATE = 6, 1000.0

VALUES: tuple[Any, ...] = (
    0, -0.0, -1, 1, 2, 1e-300, 1e300, 5e-324, 1.7e308, -1e9, 1e9, 10**400, -(10**399), math.nan, math.inf, -math.inf,
    None, True, "", " ", "x", "1", "1e-30", "nan", "linear", "none", "rigid", [], {}, [1.0], [0, 0], [1e308, 1e308],
    [[]], {"law": "linear"}, {"law": "none"}, {"a": 1}, "x" * 300, "a b " * 60, "\x1b[31m", "\u202e", "\ud800",
    "os:system",
    "../..", "name.py:law", "\x00", 0.1, 1e-9, 1e-6, 100.0, 2**63, -(2**63), [None], ["x"], {"": ""}, 1e-30, 3.5,
)  # fmt: skip
WORDS = (
    "{", "}", "[", "]", ":", "- ", "&a ", "*a", "<<: *a", "!!int ", "!!binary ", "|", ">", "%", "@", "`", "\t", "#",
    "'", '"',
    "---\n", "...\n", "? ", "\x00", "\x07", "\u2028", "\ufeff", "é", "\U0001f9b5", "\\x1b", "[" * 60, "- " * 60,
    "1" * 500,
    "a: &b [*b]\n", "0x", "1_000", ".inf", ".nan", "~", "2001-01-01", "1:30", "%YAML 1.1\n---\n", "name: again\n",
)  # fmt: skip


def places(content: Any, place: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """All places within plain data."""
    pairs = content.items() if isinstance(content, dict) else enumerate(content) if isinstance(content, list) else ()
    for key, value in pairs:
        yield (*place, key)
        yield from places(value, (*place, key))


def at(content: Any, place: tuple[Any, ...]) -> Any:
    """What is at a place."""
    for step in place:
        content = content[step]
    return content


def change_value(content: Any, chance: random.Random) -> None:
    """Put something else for a value."""
    *inner, last = chance.choice(list(places(content)))
    at(content, tuple(inner))[last] = chance.choice(VALUES)


def scale_number(content: Any, chance: random.Random) -> None:
    """Multiply a number by a power of ten."""
    numbers = [place for place in places(content) if isinstance(at(content, place), float | int)]
    *inner, last = chance.choice(numbers)
    holder = at(content, tuple(inner))
    holder[last] = holder[last] * chance.choice((1, 1, 1, -1)) * 10.0 ** chance.uniform(-30, 30)


def nudge_number(content: Any, chance: random.Random) -> None:
    """Multiply a number by something near 1."""
    numbers = [place for place in places(content) if isinstance(at(content, place), float | int)]
    *inner, last = chance.choice(numbers)
    holder = at(content, tuple(inner))
    holder[last] = holder[last] * chance.uniform(0.3, 3.0)


def remove(content: Any, chance: random.Random) -> None:
    """Leave a key or an entry out."""
    *inner, last = chance.choice(list(places(content)))
    del at(content, tuple(inner))[last]


def move(content: Any, chance: random.Random) -> None:
    """Put what is at one place to another."""
    every = list(places(content))
    *inner, last = chance.choice(every)
    at(content, tuple(inner))[last] = json.loads(json.dumps(at(content, chance.choice(every))))


def rename(content: Any, chance: random.Random) -> None:
    """Give a key another name."""
    keys = [place for place in places(content) if isinstance(place[-1], str)]
    *inner, last = chance.choice(keys)
    holder = at(content, tuple(inner))
    holder[chance.choice((last.upper(), "x" * 300, "\x1b[31m", "a b " * 60, "law", "name", ""))] = holder.pop(last)


def repeat(content: Any, chance: random.Random) -> None:
    """Let a list have an entry twice."""
    lists = [place for place in places(content) if isinstance(at(content, place), list) and at(content, place)]
    entries = at(content, chance.choice(lists))
    entries.append(json.loads(json.dumps(chance.choice(entries))))


CHANGES: tuple[Callable[[Any, random.Random], None], ...] = (
    change_value, change_value, scale_number, scale_number, scale_number, nudge_number, remove, move, rename, repeat,
)  # fmt: skip


def torn(text: str, chance: random.Random) -> bytes:
    """A text changed as text: its lines, its signs, its encoding."""
    lines = text.splitlines(keepends=True)
    one, other = (chance.randrange(len(lines)) for _ in range(2))
    way = chance.randrange(9)
    if way == 0:
        del lines[one]
    elif way == 1:
        lines.insert(other, lines[one])
    elif way == 2:
        lines[one] = chance.choice(("  ", "    ", " ")) + lines[one]
    elif way == 3:
        lines[one] = lines[one].lstrip(" ")
    elif way == 4:
        lines = lines[:one]
    elif way in (5, 6):
        cut = chance.randrange(len(lines[one]))
        lines[one] = lines[one][:cut] + chance.choice(WORDS) + lines[one][cut:]
    raw = "".join(lines).encode("utf-8", "surrogatepass")
    if way == 7:
        raw = "".join(lines).encode(chance.choice(("utf-16", "utf-32", "utf-8-sig", "cp037")))
    elif way == 8:
        spoilt = bytearray(raw)
        for _ in range(chance.choice((1, 10))):
            spoilt[chance.randrange(len(spoilt))] = chance.randrange(256)
        raw = bytes(spoilt)
    return raw


def mutant(base: str, chance: random.Random) -> bytes:
    """The file of a limb, mutated."""
    from limb_nodes.foundation.yaml_text import parse_yaml, yaml_text

    text = (PARAMS / f"{base}.yaml").read_text(encoding="utf-8")
    if chance.random() < 0.3:
        return torn(text, chance)
    content = parse_yaml(text, base)
    for _ in range(chance.choice((1, 1, 1, 2, 3))):
        chance.choice(CHANGES)(content, chance)
    return yaml_text(content).encode("utf-8", "surrogatepass")


def work(seed: int, first: int, count: int, folder: Path) -> None:
    """Try mutants; a line of JSON before and after each."""
    import numpy as np

    from limb_nodes.errors import UserError
    from limb_nodes.model import load_limb
    from limb_nodes.model.layout import build_layout
    from limb_nodes.solve.generate import program
    from limb_nodes.solve.whole import WholeModel

    models = {}
    for base in dict.fromkeys(LIMBS):
        model = WholeModel(load_limb(PARAMS / f"{base}.yaml"))
        for method in "explicit", "implicit":  # both are compiled before the first trial
            model.simulate(np.full((SAMPLES, model.layout.muscles), 0.5), RATE, method=method)
        models[program(model.layout, "", "")] = model
    file = folder / "limb.yaml"
    for number in range(first, first + count):
        chance = random.Random(f"{seed} {number}")
        file.write_bytes(mutant(chance.choice(LIMBS), chance))
        print(json.dumps({"number": number}), flush=True)
        wrong = ""
        try:
            layout = build_layout(load_limb(file))
            model = models.get(program(layout, "", ""))
            if model is not None:
                movement = model.sibling(layout).simulate(np.full((SAMPLES, layout.muscles), 0.5), RATE)
                if not (np.isfinite(movement.angle).all() and np.isfinite(movement.acceleration).all()):
                    wrong = "changed"
        except UserError as error:
            if not str(error).isprintable() or not str(error).startswith(str(file)) or len(str(error)) > 1300:
                wrong = f"traceback: not one line that names the file: {error!r}"
        except Exception:
            wrong = "traceback: " + " | ".join(traceback.format_exc().splitlines()[-3:])
        print(json.dumps({"wrong": wrong}), flush=True)


def trials(count: int, seed: int) -> Iterator[Trial]:
    """Try so many mutants in a process that is watched from outside."""
    done = 0
    while done < count:
        for trial in _watched(seed, done, count - done):
            done += 1
            yield trial


def _watched(seed: int, first: int, count: int) -> Iterator[Trial]:
    """The trials of one process, up to the first at which it is ended."""
    command = [sys.executable, "-m", __name__, str(seed), str(first), str(count)]
    child = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    assert child.stdout is not None
    number, used = first, math.inf
    waiting, buffer = time.monotonic(), b""
    try:
        while True:
            if select.select([child.stdout], [], [], 0.2)[0]:
                if not (block := os.read(child.stdout.fileno(), 2**16)):
                    break
                *lines, buffer = (buffer + block).split(b"\n")
                for line in map(json.loads, lines):
                    if "number" in line:
                        number, used, waiting = line["number"], _processor_time(child.pid), time.monotonic()
                    else:
                        wrong, used = line["wrong"], math.inf
                        yield Trial(
                            f"{KIND} {seed} {number}: {wrong}",
                            changed=wrong.startswith("changed"),
                            traceback=wrong.startswith("traceback") or _memory(child.pid) > 2 * MEMORY,
                        )
            elif _processor_time(child.pid) - used > LONGEST or (
                used < math.inf and time.monotonic() - waiting > SILENCE
            ):
                yield Trial(f"{KIND} {seed} {number}", hung=True)
                return
        if used < math.inf:
            yield Trial(f"{KIND} {seed} {number}: ended with status {child.wait()}", traceback=True)
        elif child.wait() and number == first:
            raise RuntimeError(f"{' '.join(command)} ended with status {child.returncode}")
    finally:
        child.kill()
        child.wait()


def _processor_time(process: int) -> float:
    fields = Path(f"/proc/{process}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _memory(process: int) -> int:
    """The most memory that a process has taken so far (kB)."""
    for line in Path(f"/proc/{process}/status").read_text(encoding="utf-8").splitlines():
        if line.startswith("VmHWM"):
            return int(line.split()[1])
    return 0


if __name__ == "__main__":
    import tempfile

    with tempfile.TemporaryDirectory() as name:
        work(*map(int, sys.argv[1:4]), Path(name))
