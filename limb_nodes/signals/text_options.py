"""What a person may say of a text file, so that nothing has to be concluded from it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from limb_nodes.errors import FieldError

DELIMITERS = {"comma": ",", "semicolon": ";", "tab": "\t", "blanks": " "}
_SIGNS = {**{sign: sign for sign in DELIMITERS.values()}, **DELIMITERS, r"\t": "\t", "space": " ", "": " "}
DECIMALS = (".", ",")


@dataclass(frozen=True)
class TextOptions:
    """How a text file is to be read; None, or empty, leaves a decision to the program.

    encoding: name of the encoding, such as utf-8 or cp1252.
    delimiter: between the cells of a row: `,`, `;`, a tab or a blank, which stands for any number of them; or its name.
    decimal: the decimal mark, `.` or `,`.
    header_row: the line of the columns' names, counted from 1; 0 for none, the columns are then `column 1` ...
    time: name of the column of times. no_times: times are not to be used.
    units: by column, its unit; under the name "" that of all columns which state none.
    skip: columns that are left out before their cells are read.
    wanted: columns that are needed, whatever they seem to hold.
    """

    encoding: str | None = None
    delimiter: str | None = None
    decimal: str | None = None
    header_row: int | None = None
    time: str | None = None
    no_times: bool = False
    units: Mapping[str, str] = field(default_factory=dict)
    skip: Sequence[str] = ()
    wanted: Sequence[str] = ()

    def checked(self) -> TextOptions:
        """These options. Raises FieldError if one has no meaning."""
        if self.delimiter is not None and self.delimiter not in _SIGNS:
            names = ", ".join(DELIMITERS)
            raise FieldError("delimiter", f"is {self.delimiter!r}; one of {names}, or the sign itself, is needed")
        if self.decimal is not None and self.decimal not in DECIMALS:
            raise FieldError("decimal", f"is {self.decimal!r}; . or , is needed")
        if self.header_row is not None and self.header_row < 0:
            raise FieldError("header_row", f"is {self.header_row}; a line, counted from 1, or 0 for none is needed")
        if self.encoding is not None:
            try:
                "".encode(self.encoding)
            except LookupError:
                raise FieldError(
                    "encoding", f"is {self.encoding!r}; a known one, such as utf-8 or cp1252, is needed"
                ) from None
        if self.time is not None and self.no_times:
            raise FieldError("time", f"is {self.time!r} and times are not to be used; one of both is needed")
        return self

    @property
    def sign(self) -> str | None:
        """The delimiter as it stands in the file."""
        return None if self.delimiter is None else _SIGNS[self.delimiter]
