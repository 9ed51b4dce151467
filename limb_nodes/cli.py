"""The `limb` command: one subcommand per file in `limb_nodes.commands`."""

from __future__ import annotations

import argparse
import importlib
import os
import pkgutil
import sys
from collections.abc import Sequence

from limb_nodes import __version__, commands
from limb_nodes.errors import FieldError, UserError


class Parser(argparse.ArgumentParser):
    """A parser whose errors are one line."""

    def error(self, message: str) -> None:  # type: ignore[override]
        """End with status 2 and one line."""
        self.exit(2, f"limb: error: {message} (see {self.prog} --help)\n")


def parser(names: Sequence[str]) -> argparse.ArgumentParser:
    """The parser with the subcommands of some modules."""
    top = Parser(prog="limb", description="A limb, from the sarcomere to the movement.")
    top.add_argument("--version", action="version", version=f"limb {__version__}")
    subparsers = top.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name in names:
        module = importlib.import_module(f"limb_nodes.commands.{name}")
        module.add_parser(subparsers)
    for subparser in subparsers.choices.values():
        # The name under which the library knows what an option gives -> the option.
        options = {action.dest: action.option_strings[-1] for action in subparser._actions if action.option_strings}
        subparser.set_defaults(options=options)
    return top


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; its exit status."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    known = sorted(module.name for module in pkgutil.iter_modules(commands.__path__))
    # A command that is named first needs no other command's modules.
    names = [given[0]] if given and given[0] in known else known
    options: dict[str, str] = {}
    try:
        parsed = parser(names).parse_args(given)
        options = parsed.options
        module = importlib.import_module(f"limb_nodes.commands.{parsed.command}")
        return int(module.run(parsed))
    except UserError as error:
        line = error.line(options.get(error.field, error.field)) if isinstance(error, FieldError) else str(error)
        print(f"limb: error: {line}", file=sys.stderr)
        return error.status
    except KeyboardInterrupt:
        print("limb: interrupted", file=sys.stderr)
        return 130
    except BrokenPipeError:
        # The reader of a pipe has gone, as in `limb ... | head`.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0


if __name__ == "__main__":
    sys.exit(main())
