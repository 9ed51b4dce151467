"""`limb rerun`: run again what a bag holds, from the bag alone."""

from __future__ import annotations

import argparse
import shlex
import sys
import tempfile
from pathlib import Path
from types import ModuleType
from typing import Any

from limb_nodes.commands import run as run_command
from limb_nodes.commands import simulate
from limb_nodes.errors import UserError


def add_parser(subparsers: Any) -> None:
    """Declare the command."""
    parser = subparsers.add_parser(
        "rerun",
        help="run again what a bag holds",
        description="Run the limb, the activations and the settings that a bag of `limb run` or `limb simulate` holds.",
    )
    parser.add_argument("bag", metavar="BAG", help="a bag of a run")
    parser.add_argument("--out", required=True, metavar="DIR", help="folder of the new bag, which must not exist")
    parser.add_argument("--processes", action="store_true", help="each node in a process of its own")


def run(args: argparse.Namespace) -> int:
    """Unpack limb and laws, then call the command that made the bag."""
    from limb_nodes.bags.read import BagReader

    with BagReader(args.bag) as bag:
        info = bag.run_info()
    missing = [key for key in ("limb", "rate", "parameters") if key not in info]
    if missing:
        raise UserError(
            f"{args.bag}: {', '.join(missing)} is missing in run_info; a bag of limb run or limb simulate is needed"
        )
    with tempfile.TemporaryDirectory(prefix="limb_rerun_") as folder:
        limb = unpack(Path(folder), info)
        shared = [str(limb), "--activation", str(Path(args.bag).resolve()), "--rate", repr(float(info["rate"]))]
        given = [*shared, "--out", args.out]
        settings = info["parameters"]
        if "simulate" in settings:
            given += ["--tolerance", repr(float(settings["simulate"]["tolerance"]))]
            return call(simulate, ["simulate", *given])
        stack = settings.get("muscle_stack", {})
        given += ["--state-every", str(stack.get("state_every", 1))]
        if not stack.get("publish_muscle_state", True):
            given.append("--no-states")
        if args.processes:
            given.append("--processes")
        print(f"again      {info.get('command') or shlex.join(['limb', *sys.argv[1:]])}")
        return call(run_command, ["run", *given])


def call(command: ModuleType, given: list[str]) -> int:
    """Run another command with arguments as a person would give them."""
    parser = argparse.ArgumentParser()
    command.add_parser(parser.add_subparsers())
    return int(command.run(parser.parse_args(given)))


def unpack(folder: Path, info: dict[str, Any]) -> Path:
    """Write limb and laws of a bag into a folder; the limb's file."""
    for name, text in (info.get("laws") or {}).items():
        path = (folder / name).resolve()
        if not path.is_relative_to(folder.resolve()):
            raise UserError(f"run_info: the law file is {name}; a path within the folder of the limb is needed")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    limb = folder / Path(info.get("limb_file") or "limb.yaml").name
    limb.write_text(info["limb"], encoding="utf-8")
    return limb
