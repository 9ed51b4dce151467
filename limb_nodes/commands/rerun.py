"""`limb rerun`: run again what a bag holds, from the bag alone."""

from __future__ import annotations

import argparse
import shlex
import sys
import tempfile
from pathlib import Path
from types import ModuleType
from typing import Any

from limb_nodes.commands import add_allow_laws, simulate
from limb_nodes.commands import run as run_command
from limb_nodes.errors import UserError
from limb_nodes.foundation.parameter import Parameter
from limb_nodes.foundation.section import Section, describe
from limb_nodes.foundation.yaml_text import read_yaml
from limb_nodes.model.consent import require_consent
from limb_nodes.model.user_code import UserCode, user_code

RATE = Parameter("rate", "Hz", "samples per second", above=0.0)
TOLERANCE = Parameter("tolerance", "1", "relative error per step", above=0.0)
STATE_EVERY = Parameter("state_every", "1", "ticks", 1.0, minimum=1, integer=True)


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
    add_allow_laws(parser)


def run(args: argparse.Namespace) -> int:
    """Unpack limb and laws, then call the command that made the bag."""
    info = run_info(args.bag)
    told = Section(args.bag, "", info)
    rate = told.number(RATE)
    settings = told.section("parameters")
    with tempfile.TemporaryDirectory(prefix="limb_rerun_") as place:
        folder = Path(place).resolve()
        limb = unpack(folder, info, args.bag)
        require_consent(code_of(limb), args.bag, args.allow_laws, folder)
        given = [str(limb), "--activation", str(Path(args.bag).resolve()), "--rate", repr(rate), "--out", args.out]
        if args.allow_laws:
            given.append("--allow-laws")
        if settings.has("simulate"):
            tolerance = settings.section("simulate").number(TOLERANCE)
            return call(simulate, ["simulate", *given, "--tolerance", repr(tolerance)])
        stack = settings.section("muscle_stack") if settings.has("muscle_stack") else Section(args.bag, "", {})
        given += ["--state-every", str(round(stack.number(STATE_EVERY) or 1))]
        if stack.take("publish_muscle_state") is False:
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


def run_info(path: str) -> dict[str, Any]:
    """What a bag says of its run. Raises UserError if it does not say enough to run again."""
    from limb_nodes.bags.read import BagReader

    with BagReader(path) as bag:
        info = bag.run_info()
    missing = [key for key in ("limb", "rate", "parameters") if key not in info]
    if missing:
        raise UserError(
            f"{path}: {', '.join(missing)} is missing in run_info; a bag of limb run or limb simulate is needed"
        )
    return info


def code_of(limb: Path) -> UserCode:
    """The code that a limb's file names; none is run."""
    return user_code(read_yaml(limb)[0], str(limb))


def unpack(folder: Path, info: dict[str, Any], bag: str) -> Path:
    """Write limb and laws of a bag into a folder; the limb's file. Raises UserError."""
    laws = info.get("laws") or {}
    limb = Path(str(info.get("limb_file") or "")).name
    limb = "limb.yaml" if limb in ("", "..") else limb
    if not isinstance(laws, dict):
        raise UserError(f"{bag}: laws is {describe(laws)}; a mapping of files to texts is needed")
    for name, text in {**laws, limb: info["limb"]}.items():
        try:
            path = (folder / str(name)).resolve()
            inside = path.is_relative_to(folder.resolve()) and isinstance(text, str)
            if inside:
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text(text, encoding="utf-8")
        except (OSError, ValueError):
            inside = False
        if not inside:
            raise UserError(
                f"{bag}: {describe(name)} is to be written; texts of files within the folder of the limb are needed"
            )
    return folder / limb
