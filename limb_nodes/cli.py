"""The `limb` command: one subcommand per file in `limb_nodes.commands`."""

from __future__ import annotations

import argparse
import importlib
import os
import pkgutil
import re
import sys
from collections.abc import Sequence

from limb_nodes import __version__, commands
from limb_nodes.edge import guarded
from limb_nodes.errors import MOST, FieldError, UserError, clean, shortened, shown

# How argparse begins to list what it does not know.
UNKNOWN = "unrecognized arguments: "

# How far ROS nodes find each other; unless a person says so, those of this command stay on their own machine.
RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"


class Parser(argparse.ArgumentParser):
    """A parser whose errors are one line."""

    def error(self, message: str) -> None:  # type: ignore[override]
        """Raise UserError."""
        if message.startswith(UNKNOWN):
            message = shown(message, len(UNKNOWN) + MOST)
        raise UserError(f"{message} (see {self.prog} --help)")


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
    if not os.environ.get(RANGE):
        os.environ[RANGE] = "LOCALHOST"

    def work() -> int:
        parsed = parser(names).parse_args(given)
        options.update(parsed.options)
        module = importlib.import_module(f"limb_nodes.commands.{parsed.command}")
        return int(module.run(parsed))

    def line(error: UserError) -> str:
        text = error.raw(options.get(error.field, "") if isinstance(error, FieldError) else "")
        parts = {part for argument in given for part in (argument, *re.split("[=,]", argument)) if len(part) > MOST}
        for part in sorted(parts, key=len, reverse=True):
            text = text.replace(part, shortened(part))
        return clean(text)

    return guarded(work, line)


if __name__ == "__main__":
    sys.exit(main())
