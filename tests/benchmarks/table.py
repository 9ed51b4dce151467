"""Rows of results, as a table and as JSON."""

from __future__ import annotations

import json
import math
import os
import platform
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path


@dataclass(frozen=True)
class Bar:
    """What a row is to show. value: found; limit: `at least` or at most that."""

    what: str
    value: float
    limit: float
    at_least: bool = True

    @property
    def met(self) -> bool:
        """Whether it shows it."""
        return self.value >= self.limit if self.at_least else self.value <= self.limit

    def __str__(self) -> str:
        sign = ">=" if self.at_least else "<="
        return f"{self.what} {self.value:.3g} ({sign} {self.limit:g}: {'met' if self.met else 'NOT MET'})"


@dataclass(frozen=True)
class Row:
    """One engine at one piece of work.

    error: rad, against a tight reference of the same equations, None where there is none.
    wall, cpu: median s. speed: of `unit` per second of wall time. times: wall and processor time
    over those of the product's row of the same work, round by round. missing: why nothing was measured.
    """

    work: str
    engine: str
    error: float | None = None
    wall: float = math.nan
    cpu: float = math.nan
    speed: float = math.nan
    unit: str = "s"
    times: tuple[float, float] | None = None
    note: str = ""
    missing: str = ""
    bars: tuple[Bar, ...] = field(default=())


HEAD = ("work", "engine", "error rad", "wall ms", "cpu ms", "per s", "x wall", "x cpu", "note")


def cells(row: Row) -> tuple[str, ...]:
    """The texts of a row."""
    if row.missing:
        return (row.work, row.engine, "", "", "", "", "", "", f"missing: {row.missing}")
    error = "" if row.error is None else f"{row.error:.1e}"
    times = ("", "") if row.times is None else (f"{row.times[0]:.2f}", f"{row.times[1]:.2f}")
    return (
        row.work,
        row.engine,
        error,
        f"{1e3 * row.wall:.4g}",
        f"{1e3 * row.cpu:.4g}",
        f"{row.speed:.4g} {row.unit}",
        *times,
        row.note,
    )


def as_table(rows: Sequence[Row]) -> str:
    """All rows as text, and below them what they show."""
    lines = [HEAD, *(cells(row) for row in rows)]
    widths = [max(len(line[column]) for line in lines) for column in range(len(HEAD))]
    left = {0, 1, len(HEAD) - 1}
    texts = []
    for number, line in enumerate(lines):
        if number and line[0] != lines[number - 1][0]:
            texts.append("")
        padded = [
            text.ljust(width) if column in left else text.rjust(width)
            for column, (text, width) in enumerate(zip(line, widths, strict=True))
        ]
        texts.append("  ".join(padded).rstrip())
    bars = [f"{row.work}: {bar}" for row in rows for bar in row.bars]
    return "\n".join([*texts, "", *bars]) if bars else "\n".join(texts)


def as_json(rows: Sequence[Row], file: Path) -> None:
    """Write all rows, and where they were measured."""
    machine = {"cores": len(os.sched_getaffinity(0)), "load": os.getloadavg(), "processor": processor()}
    found = [
        {**asdict(row), "bars": [{**asdict(bar), "met": bar.met, "text": str(bar)} for bar in row.bars]} for row in rows
    ]
    text = json.dumps({"machine": machine, "rows": clean(found)}, indent=1)
    file.write_text(text + "\n", encoding="utf-8")


def clean(value: object) -> object:
    """The same without numbers that JSON lacks."""
    if isinstance(value, dict):
        return {key: clean(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [clean(item) for item in value]
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    return value


def processor() -> str:
    """The name of the processor."""
    file = Path("/proc/cpuinfo")
    names = [line.partition(":")[2].strip() for line in file.read_text().splitlines() if line.startswith("model name")]
    return names[0] if names else platform.processor()
