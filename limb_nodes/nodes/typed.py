"""Parameters that a person types behind a node: `-p name:=value`.

ROS lets a section of a file of parameters that names the node win over them. Given once more in such a section, behind
all files, they win.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

OPTIONS = ("-p", "--param")
# What can stand as it is behind a key of YAML.
PLAIN = re.compile(r"(?!.*(?:: | #|\n)).+")


def typed_parameters(arguments: Sequence[str]) -> dict[str, str]:
    """The parameters among the arguments of a process, as they are typed; without those for nodes that they name."""
    found = {}
    ours, before = False, ""
    for argument in arguments:
        name, given, value = argument.partition(":=")
        if argument in ("--ros-args", "--"):
            ours = argument != "--"
        elif ours and before in OPTIONS and given and ":" not in name:
            found[name] = value
        before = argument
    return found


@contextmanager
def typed_last(arguments: Sequence[str], node: str) -> Iterator[list[str]]:
    """The arguments, and once more the parameters among them in a file for a node, while ROS reads them."""
    typed = {name: value for name, value in typed_parameters(arguments).items() if PLAIN.fullmatch(value)}
    if not typed:
        yield list(arguments)
        return
    lines = [f"/**/{node}:", "  ros__parameters:", *(f"    {name}: {value}" for name, value in typed.items())]
    with tempfile.NamedTemporaryFile("w", suffix=".yaml", encoding="utf-8") as file:
        file.write("\n".join(lines) + "\n")
        file.flush()
        yield [*arguments, "--ros-args", "--params-file", file.name]
