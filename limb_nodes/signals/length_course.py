"""A muscle-tendon length over time, read from a text table."""

from __future__ import annotations

from pathlib import Path

from limb_nodes.errors import UserError
from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.signals import units
from limb_nodes.signals.table import is_value, read_table
from limb_nodes.signals.text_options import TextOptions


def read_length_course(path: str | Path, text: TextOptions | None = None) -> tuple[FloatArray, FloatArray]:
    """Times (s) from 0 on and lengths (m) of a text table (`limb_nodes.signals.table`).

    Its columns are named `time [s]` and `length [m]` (or `[mm]`, `[cm]`); others are passed over. text: how the file is
    to be read.
    Raises UserError that names file, line, column and value.
    """
    table = read_table(path, text)
    time = table.needed_times()
    column = next((index for index, name in enumerate(table.names) if name.lower() == "length"), None)
    if column is None:
        raise UserError(f"{path}: no column 'length' in m or mm; there are {', '.join(table.names)}")
    unit = table.units[column]
    if unit not in units.LENGTH:
        raise UserError(f"{path}: the unit of length is {unit}; m, cm or mm is needed")
    length = table.values[:, column] * units.LENGTH[unit]
    if len(time) < 2:
        raise UserError(f"{path}: holds one row; at least 2 are needed")
    if not (length > 0.0).all():
        row = int((length > 0.0).argmin())
        raise UserError(
            f"{path}, {table.place(row)}: length {is_value(table.values[row, column])}; a number > 0 is needed"
        )
    return time - time[0], length
