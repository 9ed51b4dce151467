"""The subcommands of `limb`, one module each, with `add_parser` and `run`, and what they share.

What is wrong with an option ends in a FieldError whose field is the option's `dest`; `limb_nodes.cli` shows the option.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from limb_nodes.analysis.style import SUFFIXES
from limb_nodes.errors import FieldError


def output_file(field: str, name: str, endings: tuple[str, ...] = SUFFIXES) -> Path:
    """The path of a file to write. Raises FieldError if its ending is another, or its folder is not there."""
    path = Path(name)
    if path.suffix.lower() not in endings:
        raise FieldError(field, f"is {name}; a name that ends in {' or '.join(endings)} is needed")
    if not path.parent.is_dir():
        raise FieldError(field, f"is {name}; a folder that exists is needed, unlike {path.parent}")
    return path


def add_limb(parser: argparse.ArgumentParser, default: str = "") -> None:
    """Add the limb that a command takes, and consent to the code that it may name; default: in words, if it has one."""
    optional: dict[str, str] = {"nargs": "?", "default": ""} if default else {}
    help_text = f"the limb (default: {default})" if default else "the limb"
    parser.add_argument("limb", metavar="LIMB.yaml", help=help_text, **optional)  # type: ignore[arg-type]
    add_allow_laws(parser)


def add_allow_laws(parser: argparse.ArgumentParser) -> None:
    """Add consent to code from a file, for commands that run laws."""
    parser.add_argument(
        "--allow-laws", action="store_true",
        help="run the code of the limb's own laws, this time, also if it is not trusted (see `limb trust`)",
    )  # fmt: skip


@contextmanager
def writing(field: str) -> Iterator[None]:
    """Turn the OSError of a file that cannot be written into a FieldError."""
    try:
        yield
    except OSError as problem:
        raise FieldError(
            field, f"is {problem.filename}, which cannot be written: {problem.strerror or problem}"
        ) from None
