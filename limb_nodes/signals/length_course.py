"""A muscle-tendon length over time, read from a text table."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from limb_nodes.errors import UserError
from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.signals.table import TIME_UNITS, read_table

LENGTH_UNITS = {"": 1.0, "m": 1.0, "mm": 1e-3}


def read_length_course(path: str | Path) -> tuple[FloatArray, FloatArray]:
    """Times (s) from 0 on and lengths (m) of a tab- or comma-separated file.

    Its columns are named `time [s]` and `length [m]` (or `[mm]`); others are passed over.
    Raises UserError that names file, line, column and value.
    """
    table = read_table(path)
    column = table.time_column()
    if column is None:
        raise UserError(f"{path}: no column 'time' (s); there are {', '.join(table.names)}")
    named = [i for i, name in enumerate(table.names) if name.lower() == "length"]
    if not named:
        raise UserError(f"{path}: no column 'length' (m or mm); there are {', '.join(table.names)}")
    unit = table.units[named[0]]
    if unit not in LENGTH_UNITS:
        raise UserError(f"{path}, column length: its unit is {unit}; m or mm is needed")
    time = table.values[:, column] * TIME_UNITS[table.units[column]]
    length = table.values[:, named[0]] * LENGTH_UNITS[unit]
    if len(time) < 2:
        raise UserError(f"{path}: holds {len(time)} rows; at least 2 are needed")
    later = np.concatenate([np.isfinite(time[:1]), np.diff(time) > 0.0])
    for good, what, allowed in (
        (later, "time", "a time later than the one before"),
        (length > 0.0, "length", "a number > 0"),
    ):
        if not good.all():
            row = int(good.argmin())
            value = table.values[row, column if what == "time" else named[0]]
            shown = "no value" if np.isnan(value) else f"{value:g}"
            raise UserError(f"{path}, line {table.lines[row]}, {what}: {shown}; {allowed} is needed")
    return time - time[0], length
