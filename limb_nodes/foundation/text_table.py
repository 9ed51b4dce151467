"""Tables as text, for what commands print."""

from __future__ import annotations

from collections.abc import Sequence

_ALIGN = {"l": str.ljust, "r": str.rjust, "c": str.center}


def aligned(rows: Sequence[Sequence[str]], columns: str = "") -> list[str]:
    """The lines of a table, its cells two blanks apart and as wide as their column; no blanks at the end of a line.

    columns: a letter for each: l left, r right, c centred. Those without one are left.
    """
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    letters = columns.ljust(len(widths), "l")
    return [
        "  ".join(
            _ALIGN[letter](cell, width) for cell, letter, width in zip(row, letters, widths, strict=True)
        ).rstrip()
        for row in rows
    ]
