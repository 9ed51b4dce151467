"""The files that other programs read: OpenSim's storage (.sto, .mot), CSV and Parquet. Each is whole, or not there.

OpenSim's storage is text: a name, lines `key=value`, `endheader`, a line of names and rows of numbers between tabs
(https://opensimconfluence.atlassian.net/wiki/spaces/OpenSim/pages/53089996). The header here is that of version 1,
which every OpenSim reads. Its Storage separates names at blanks as well, and stops at a value that is not finite.
"""

from __future__ import annotations

import csv
import importlib.util
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TextIO

import numpy as np

from limb_nodes.analysis.export.table import BagTable
from limb_nodes.errors import UserError
from limb_nodes.foundation.arrays import FloatArray

TIME = "time"
ENDINGS = (".sto", ".mot", ".csv", ".parquet")


def write_storage(table: BagTable, path: Path, *, name: str, in_degrees: bool) -> None:
    """Write OpenSim's storage.

    name: of the table. in_degrees: what the header says of the table's angles.

    Raises UserError if the bag is damaged, or if a value is not finite, which OpenSim does not read.
    """
    names = [_label(column.name) for column in table.columns]
    for index, label in enumerate(names):
        if label in names[:index]:
            raise UserError(f"{path}: two columns are named {label} without blanks; a .csv is needed for such names")
    header = (
        _label(name),
        "version=1",
        f"nRows={table.rows}",
        f"nColumns={len(names) + 1}",
        f"inDegrees={'yes' if in_degrees else 'no'}",
        "",
        f"Units are S.I. units (second, meters, Newtons, ...), angles in {'degrees' if in_degrees else 'radians'}.",
        "",
        "endheader",
        "\t".join([TIME, *names]),
    )
    with _replacing(path) as new, new.open("w", encoding="utf-8", newline="\n") as file:
        file.write("\n".join(header) + "\n")
        for times, values in table.pieces():
            if not np.isfinite(values).all():
                row, column = np.argwhere(~np.isfinite(values))[0]
                raise UserError(
                    f"{path}: {names[column]} is {values[row, column]:g} at {times[row]:g} s; "
                    f"a finite number is needed in a {path.suffix}"
                )
            _write_rows(file, times, values, "\t")


def write_csv(table: BagTable, path: Path) -> None:
    """Write comma-separated text in UTF-8, the units behind the names. Raises UserError if the bag is damaged."""
    with _replacing(path) as new, new.open("w", encoding="utf-8", newline="") as file:
        titles = [column.titled() for column in table.columns]
        csv.writer(file, lineterminator="\n").writerow([f"{TIME} [s]", *titles])
        for times, values in table.pieces():
            _write_rows(file, times, values, ",")


def write_parquet(table: BagTable, path: Path) -> None:
    """Write Parquet, the units behind the names. Raises UserError if the bag is damaged; needs `require_parquet`."""
    import pyarrow
    from pyarrow import parquet

    titles = [f"{TIME} [s]", *(column.titled() for column in table.columns)]
    schema = pyarrow.schema([(title, pyarrow.float64()) for title in titles])
    with _replacing(path) as new, parquet.ParquetWriter(new, schema) as file:
        for times, values in table.pieces():
            arrays = [pyarrow.array(column) for column in (times, *values.T)]
            file.write_table(pyarrow.Table.from_arrays(arrays, schema=schema))


def require_parquet(path: Path) -> None:
    """Raise UserError if a Parquet file cannot be written here."""
    if importlib.util.find_spec("pyarrow") is None:
        raise UserError(f"{path}: pyarrow is not installed; `pip install pyarrow` is needed for a .parquet")


def _label(name: str) -> str:
    """A name without blanks."""
    return "_".join(name.split())


def _write_rows(file: TextIO, times: FloatArray, values: FloatArray, delimiter: str) -> None:
    """Write rows with as many digits as give the same numbers again."""
    rows = np.column_stack([times, values]).tolist()
    file.writelines(delimiter.join(map(repr, row)) + "\n" for row in rows)


@contextmanager
def _replacing(path: Path) -> Iterator[Path]:
    """The path of a new file, which takes the place of the other one when all has been written."""
    part = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")
    try:
        yield part
        os.replace(part, path)
    except OSError as problem:
        raise UserError(f"{path}: cannot be written: {problem.strerror or problem}") from None
    finally:
        part.unlink(missing_ok=True)
