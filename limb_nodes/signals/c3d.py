"""Read the analog channels of a C3D file, as motion laboratories record EMG beside their cameras."""

from __future__ import annotations

import importlib.util
import io
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np

from limb_nodes.errors import UserError
from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.signals.column import numbered
from limb_nodes.signals.units import unit_named

# A header may promise more than a cut file holds, but not so many times its size, or the least of these bytes.
_MOST_TIMES, _LEAST = 100, 2**26
_MAGIC = 0x50
# How long a file may take (s), and how much longer for each of its bytes.
_LONGEST, _PER_BYTE = 20.0, 1e-6
# The package is C++, which a damaged file can end by force: it works in a process of its own. More than 255 names go on
# in LABELS2, LABELS3 ...
_CHILD = """
import sys, ezc3d, numpy
content = ezc3d.c3d(sys.argv[1])
analog = content["parameters"]["ANALOG"]
def texts(name):
    parts = [name, *(f"{name}{number}" for number in range(2, 100))]
    return numpy.array([text for part in parts if part in analog for text in analog[part]["value"]], dtype=str)
numpy.savez(
    sys.stdout.buffer, values=content["data"]["analogs"][0].T, labels=texts("LABELS"), units=texts("UNITS"),
    rate=float(content["header"]["analogs"]["frame_rate"]),
)
"""


def read_c3d(path: str | Path) -> tuple[tuple[str, ...], tuple[str, ...], FloatArray, float, tuple[str, ...]]:
    """Names, units, values [samples, channels] in these units, rate (Hz) and notes of a file's analog channels.

    A unit is "" if the file states none; a name that several channels have is numbered.

    Raises UserError if the file cannot be read or has no analog channel, or if the package that reads it is missing.
    """
    file = Path(path)
    if not file.exists():
        raise UserError(f"{path}: no such file")
    promised = _promised(file)
    if importlib.util.find_spec("ezc3d") is None:
        raise UserError(f"{path}: is C3D; the package ezc3d is needed: pip install ezc3d")
    values, labels, unit_names, rate = _channels(file)
    count = values.shape[1]
    if not values.size or not rate > 0.0:
        raise UserError(f"{path}: has no analog channel with values and a rate; at least one is needed")
    names = [label.strip() or f"analog {index + 1}" for index, label in enumerate(_as_many(labels, count))]
    stated = [unit_named(unit) or unit.strip() for unit in _as_many(unit_names, count)]
    notes = (f"the header promises {promised} values, {len(values)} are there",) if promised > len(values) else ()
    return tuple(numbered(names)), tuple(stated), values, rate, notes


def _promised(file: Path) -> int:
    """How many analog samples the header promises; of a long recording fewer than there are.

    Raises UserError if it is no C3D file, or if its header promises far more than it can hold.
    """
    size = file.stat().st_size
    with file.open("rb") as opened:
        head = opened.read(20)
    if len(head) < 20 or head[1] != _MAGIC:
        raise UserError(f"{file}: is no C3D file; one that begins with its magic byte {_MAGIC:#x} is needed")
    _, points, analogs, first, last, *_, samples = struct.unpack("<10H", head)
    frames = max(last - first, 0) + 1
    promised = 2 * frames * (4 * points + analogs)
    if promised > max(_LEAST, _MOST_TIMES * size):
        raise UserError(f"{file}: its header promises {promised} bytes, {size} are there; a whole file is needed")
    return int(frames * samples)


def _channels(file: Path) -> tuple[FloatArray, list[str], list[str], float]:
    """Values [samples, channels], labels, units and rate (Hz) as they stand in the file."""
    try:
        child = subprocess.run(
            [sys.executable, "-I", "-c", _CHILD, str(file.resolve())],
            capture_output=True,
            timeout=_LONGEST + _PER_BYTE * file.stat().st_size,
            check=True,
        )
        with np.load(io.BytesIO(child.stdout), allow_pickle=False) as content:
            values = np.ascontiguousarray(content["values"], dtype=np.float64)
            return values, content["labels"].tolist(), content["units"].tolist(), float(content["rate"])
    except (subprocess.SubprocessError, OSError, ValueError, KeyError):
        raise UserError(f"{file}: is no C3D file that can be read; a whole one is needed") from None


def _as_many(texts: list[str], count: int) -> list[str]:
    """So many texts; those that are not there are empty."""
    return (texts + [""] * count)[:count]
