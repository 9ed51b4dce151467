"""What a muscle showed on the bench: as a summary, and as a CSV file."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.foundation.text_table import aligned
from limb_nodes.solve.bench import BenchRecord

# Unit of every output in the CSV file.
MUSCLE_UNITS = {
    "activation": "1",
    "muscle_tendon_length": "m",
    "muscle_tendon_velocity": "m/s",
    "muscle_length": "m",
    "muscle_velocity": "m/s",
    "tendon_length": "m",
    "tendon_velocity": "m/s",
    "aponeurosis_length": "m",
    "aponeurosis_velocity": "m/s",
    "pennation_angle": "rad",
    "fibre_length": "m",
    "fibre_velocity": "m/s",
    "total_fibre_force": "N",
    "muscle_force": "N",
}
UNIT_UNITS = {
    "stimulation_frequency": "Hz",
    "force_frequency_factor": "1",
    "force_length_factor": "1",
    "passive_force": "N",
    "fibre_force": "N",
    "fibre_length_norm": "1",
    "sarcomere_length": "m",
    "sarcomere_velocity": "m/s",
    "sarcomere_force": "N",
}


@dataclass(frozen=True)
class Row:
    """One quantity over a run: first, lowest, highest and last value in `unit`."""

    name: str
    unit: str
    first: float
    lowest: float
    highest: float
    last: float


def summary_rows(record: BenchRecord) -> list[Row]:
    """The quantities that a person wants to see first; lengths in mm, angles in degrees."""
    rows: list[Row] = []

    def add(name: str, unit: str, values: FloatArray, scale: float = 1.0) -> None:
        rows.append(Row(name, unit, **extent(values * scale)))

    muscle = record.muscle
    add("excitation", "1", record.excitation)
    if not np.array_equal(muscle["activation"], record.excitation):
        add("activation", "1", muscle["activation"])
    add("force", "N", record.force)
    add("muscle-tendon length", "mm", record.muscle_tendon_length, 1e3)
    add("fibre length", "mm", record.fibre_length, 1e3)
    add("fibre velocity", "mm/s", muscle["fibre_velocity"], 1e3)
    if muscle["tendon_length"].any():
        add("tendon length", "mm", record.tendon_length, 1e3)
    if record.pennation_angle.any():
        add("aponeurosis length", "mm", muscle["aponeurosis_length"], 1e3)
        add("pennation", "deg", record.pennation_angle, math.degrees(1.0))
    for index, unit in enumerate(record.unit_names):
        add(f"frequency of {unit}", "Hz", record.frequency[:, index])
    return rows


def extent(values: FloatArray) -> dict[str, float]:
    """First, lowest, highest and last of some values."""
    ends = {"first": values[0], "lowest": values.min(), "highest": values.max(), "last": values[-1]}
    return {name: float(value) for name, value in ends.items()}


def summary_text(record: BenchRecord) -> str:
    """The summary for the terminal."""
    rows = [("", "unit", "first", "lowest", "highest", "last")]
    for row in summary_rows(record):
        first, lowest, highest, last = (f"{value:.5g}" for value in (row.first, row.lowest, row.highest, row.last))
        rows.append((row.name, row.unit, first, lowest, highest, last))
    peak = int(record.force.argmax())
    end = f"highest force {record.force[peak]:.5g} N at {record.time[peak]:.4g} s; work {record.work:.5g} J"
    left = [f"range: {length} {told}" for length, told in record.ranges.told().items()]
    return "\n".join([*aligned(rows, "lrrrrr"), end, *left])


def summary_data(record: BenchRecord) -> dict[str, Any]:
    """The summary as plain data in SI units: lowest, highest, first and last of every output."""
    return {
        "duration": float(record.time[-1] - record.time[0]),
        "work": record.work,
        "out_of_range": record.ranges.told(),
        "highest_force_at": float(record.time[int(record.force.argmax())]),
        "excitation": extent(record.excitation),
        "muscle": {name: extent(record.muscle[name]) for name in MUSCLE_UNITS},
        "units": {
            unit: {name: extent(record.unit[name][:, index]) for name in UNIT_UNITS}
            for index, unit in enumerate(record.unit_names)
        },
        "states": {name: extent(record.internal[:, index]) for index, name in enumerate(record.state_names)},
    }


def write_csv(record: BenchRecord, path: Path) -> None:
    """Write every output at every time; a column's name carries its unit, and its motor unit before a dot."""
    columns = {"time [s]": record.time, "excitation [1]": record.excitation}
    columns |= {f"{name} [{unit}]": record.muscle[name] for name, unit in MUSCLE_UNITS.items()}
    for index, owner in enumerate(record.unit_names):
        columns |= {f"{owner}.{name} [{unit}]": record.unit[name][:, index] for name, unit in UNIT_UNITS.items()}
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        shown: Callable[[float], str] = "{:.12g}".format
        for values in zip(*columns.values(), strict=True):
            writer.writerow([shown(value) for value in values])
