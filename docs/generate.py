"""Writes the tables of docs/reference from the code: commands, keys, laws, topics and parameters.

    python -m docs.generate          write them
    python -m docs.generate --check  exit status 1 if they differ from the code

In a page, what stands between `<!-- NAME -->` and `<!-- end -->` is a table of this program; the
rest is written by hand.
"""

from __future__ import annotations

import argparse
import math
import os
import pkgutil
import re
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

from limb_nodes import cli, commands
from limb_nodes.levels import CONTRACTS, REGISTRY, Law, Parameter, motor_unit, sarcomere
from limb_nodes.levels.equation import Equation, State
from limb_nodes.model import load
from limb_nodes.model.report_laws import is_of_report
from limb_nodes.model.spanning import READERS
from limb_nodes.signals.waveform import WAVES

DOCS = Path(__file__).resolve().parent
PAGES = ("commands", "yaml", "laws", "topics", "parameters")
CLIPPED = " Clipped to [0, 1] unless `clip: false`."
BLOCK = re.compile(r"<!-- (?!end)(\S+) -->\n.*?<!-- end -->", re.DOTALL)


def main() -> int:
    """Write or check the pages."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="write nothing; status 1 if a page differs")
    args = parser.parse_args()
    different = []
    for name in PAGES:
        path = DOCS / "reference" / f"{name}.md"
        text = path.read_text(encoding="utf-8")
        new = filled(text)
        if new != text:
            different.append(path.name)
            if not args.check:
                path.write_text(new, encoding="utf-8")
    print(", ".join(different) if different else "all as in the code")
    return 1 if different and args.check else 0


def filled(page: str) -> str:
    """A page with new tables."""

    def fill(block: re.Match[str]) -> str:
        return f"<!-- {block[1]} -->\n\n{all_tables()[block[1]].strip()}\n\n<!-- end -->"

    return BLOCK.sub(fill, page)


@cache
def all_tables() -> dict[str, str]:
    """Every table by name."""
    return {"commands": command_sections(), **key_tables(), "laws": law_sections(), **node_tables()}


# Commands


def command_sections() -> str:
    """One section for each subcommand."""
    names = sorted(module.name for module in pkgutil.iter_modules(commands.__path__))
    top = cli.parser(names)
    (subparsers,) = (action for action in top._actions if isinstance(action, argparse._SubParsersAction))
    return "\n\n".join(command_section(subparsers.choices[name]) for name in names)


def command_section(parser: argparse.ArgumentParser) -> str:
    """A subcommand: its usage, what it does, its arguments."""
    actions = [a for a in parser._actions if not isinstance(a, argparse._HelpAction)]
    required = [a for a in actions if a.required]
    usage = " ".join(
        [parser.prog, *(invocation(a) for a in required), *(["[options]"] if len(required) < len(actions) else [])]
    )
    rows = [(f"`{spelling(a)}`", (a.help or "") % {"default": a.default, **vars(a)}) for a in actions]
    return (
        f"## {parser.prog}\n\n{parser.description}\n\n```text\n{usage}\n```\n\n{table(('argument', 'meaning'), rows)}"
    )


def invocation(action: argparse.Action) -> str:
    """An argument as it is typed."""
    value = value_of(action)
    return " ".join(part for part in (action.option_strings[-1] if action.option_strings else "", value) if part)


def spelling(action: argparse.Action) -> str:
    """An argument with all its names."""
    return " ".join(part for part in (", ".join(action.option_strings), value_of(action)) if part)


def value_of(action: argparse.Action) -> str:
    """What stands for an argument's value."""
    if action.nargs == 0:
        return ""
    if isinstance(action.metavar, tuple):
        return " ".join(action.metavar)
    name = action.metavar or (("{" + ",".join(map(str, action.choices)) + "}") if action.choices else "")
    return name or action.dest.upper()


# Keys of a limb's file


def key_tables() -> dict[str, str]:
    """The tables of the keys that are numbers."""
    return {
        "limb-keys": parameter_table((load.BASE_ANGLE, load.TIP_TORQUE), source=False),
        "segment-keys": parameter_table(load.SEGMENT_PARAMETERS, source=False),
        "muscle-keys": parameter_table((load.ACTIVATION_THRESHOLD, load.DELAY), source=False),
        "unit-keys": parameter_table((load.COUNT, load.ORDER, *motor_unit.PARAMETERS), source=False),
        "processes": process_table(),
        "waves": "\n\n".join(
            f"**`{name}`**: {first_line(wave.sample)}{CLIPPED if wave.clips else ''}\n\n"
            + parameter_table(wave.keys, source=False)
            for name, wave in WAVES.items()
        ),
    }


def process_table() -> str:
    """The processes, where each is chosen and what may be chosen."""
    rows = []
    for contract in CONTRACTS.values():
        place = contract.section.replace("_", " ")
        laws = ", ".join(f"[`{name}`](laws.md#{anchor(contract.process, name)})" for name in REGISTRY[contract.process])
        if contract.process == "path":
            laws += ", " + ", ".join(f"[`{name}`](#paths-over-several-joints)" for name in READERS)
        absent = "none" if contract.owner == "joint" else f"`{contract.absent or contract.default}`"
        rows.append((f"`{contract.process}`", place, contract.meaning, laws, absent))
    return table(("key", "of a", "gives", "laws", "without the key"), rows)


def anchor(process: str, law: str) -> str:
    """The place of a law on its page."""
    return f"{process}-{law}"


def law_sections() -> str:
    """One section for each process: its contract and its laws."""
    sections = []
    for contract in CONTRACTS.values():
        laws = REGISTRY[contract.process]
        owed = ", ".join(f"`{name}`" for name in contract.defines)
        given = ", ".join(f"`{name}`" for name in contract.given)
        kept = f"\n\nKept by every law: {'; '.join(contract.properties)}." if contract.properties else ""
        shared = ""
        if contract.process == "sarcomere":
            shared = "\n\nEvery sarcomere has these parameters, whatever its law:\n\n" + parameter_table(
                sarcomere.PARAMETERS
            )
        head = f"## {contract.process}\n\n{contract.meaning[0].upper()}{contract.meaning[1:]}."
        sections.append(f"{head} Given: {given}. Owed: {owed}.{kept}{shared}")
        sections += [law_section(name, law) for name, law in laws.items()]
    return "\n\n".join(sections)


def law_section(name: str, law: Law) -> str:
    """A law: its equations, states and parameters."""
    alike: dict[str, list[Equation]] = {}
    for item in law.equations:
        alike.setdefault(item.number, []).append(item)
    rows = [
        (
            number,
            first_to_last([item.defines for item in items]),
            first_line(items[0].function),
            ", ".join(f"`{use}`" for use in items[0].uses) or "-",
        )
        for number, items in alike.items()
    ]
    parts = [
        f"### {law.process}: {name}",
        f"Source: {law.source or '-'}." + ("" if is_of_report(law) else " Not the report's."),
        table(("equation", "defines", "meaning", "uses"), rows),
    ]
    if law.states:
        begins: dict[tuple[str, str, str], list[State]] = {}
        for state in law.states:
            begins.setdefault((state.unit, state.initial, state.number), []).append(state)
        rows = [
            (
                first_to_last([state.name for state in states]),
                unit,
                first_to_last([state.rate for state in states]),
                f"`{initial}`",
                number,
            )
            for (unit, initial, number), states in begins.items()
        ]
        parts += ["States:", table(("state", "unit", "rate", "starts at", "equation"), rows)]
    if law.parameters:
        parts += ["Parameters:", parameter_table(law.parameters)]
    return "\n\n".join(parts)


def first_to_last(names: list[str]) -> str:
    """The first and the last of names that mean the same, and how many there are."""
    return f"`{names[0]}`" if len(names) == 1 else f"`{names[0]}` to `{names[-1]}` ({len(names)})"


def parameter_table(parameters: Iterable[Parameter], source: bool = True) -> str:
    """Parameters with unit, range, default and source."""
    rows = []
    for parameter in parameters:
        row = [f"`{parameter.name}`", parameter.unit, parameter.meaning, allowed(parameter), default(parameter)]
        rows.append((*row, parameter.source) if source else row)
    return table(("key", "unit", "meaning", "allowed", "default", *(["source"] if source else [])), rows)


def allowed(parameter: Parameter) -> str:
    """The allowed values, without the unit."""
    text = parameter.allowed().removesuffix(f" in {parameter.unit}")
    return text.removeprefix("a number").strip() or "any"


def default(parameter: Parameter) -> str:
    """The default value in words."""
    if parameter.default is None:
        return "**required**"
    if isinstance(parameter.default, str):
        return f"that of `{parameter.default}`"
    if parameter is load.ORDER:
        return parameter.source
    known = {math.pi / 2: "pi/2", -math.pi / 2: "-pi/2"}
    return known.get(parameter.default, f"{parameter.default:g}")


# Nodes


def node_tables() -> dict[str, str]:
    """Topics with their quality of service, services and parameters, as the nodes declare them."""
    with started_nodes() as nodes:
        for node in nodes:
            node.serve()
        parameters = "\n\n".join(node_section(node) for node in nodes)
        return {"topics": topic_table(nodes), "services": service_table(nodes), "node-parameters": parameters}


@contextmanager
def started_nodes() -> Iterator[list[Any]]:
    """A node of each kind, alone, that remembers as `declared` which parameters it declared with which default."""
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF")
    with tempfile.TemporaryDirectory() as folder:
        os.environ.setdefault("ROS_LOG_DIR", folder)
        import rclpy
        from rclpy.context import Context
        from rclpy.parameter import Parameter as RosParameter
        from rclpy.signals import SignalHandlerOptions

        from limb_nodes.nodes.base import LimbNode
        from limb_nodes.nodes.session import CLASSES

        declare = LimbNode._declare

        def remembering(self: Any, name: str, value: Any, *rest: Any) -> Any:
            self.declared = {**getattr(self, "declared", {}), name: value}
            return declare(self, name, value, *rest)

        given: dict[str, dict[str, Any]] = {
            "activation_input": {"mode": "realtime"},
            "limb_dynamics": {"await_recorder": True},
            "recorder": {"out": f"{folder}/bag"},
        }
        limb = str(DOCS.parent / "params" / "reference_joint.yaml")
        context = Context()
        rclpy.init(context=context, signal_handler_options=SignalHandlerOptions.NO)
        nodes: dict[str, Any] = {}
        LimbNode._declare = remembering
        try:
            for name, node_class in CLASSES.items():
                values = {"limb": limb, **given.get(name, {})}
                overrides = [RosParameter(key, value=value) for key, value in values.items()]
                nodes[name] = node_class(context=context, parameter_overrides=overrides)
            # Which a live activation_input does by itself once the limb moves.
            nodes["activation_input"].live.open()
            yield list(nodes.values())
        finally:
            LimbNode._declare = declare
            for node in nodes.values():
                node.destroy_node()
            rclpy.shutdown(context=context)


def topic_table(nodes: Sequence[Any]) -> str:
    """Topics by name: type, who publishes, who subscribes, quality of service."""
    from limb_nodes.nodes.distribution import subscriptions_of

    topics: dict[str, dict[str, Any]] = {}
    for role in ("from", "to"):
        for node in nodes:
            for end in node.publishers if role == "from" else subscriptions_of(node):
                topic = end.topic_name if end.topic_name.startswith("/diagnostics") else end.topic_name.lstrip("/")
                if topic in ("rosout", "parameter_events", "clock"):
                    continue
                # Who publishes comes first and says what is offered.
                about = {"from": [], "to": [], "type": end.msg_type, "qos": quality(end.qos_profile)}
                topics.setdefault(topic, about)[role].append(f"`{node.get_name()}`")
    rows = []
    for topic in sorted(topics, key=lambda name: name.lstrip("/")):
        entry = topics[topic]
        kind = f"{entry['type'].__module__.split('.')[0]}/{entry['type'].__name__}"
        ends = [", ".join(entry[role]) or "anyone" for role in ("from", "to")]
        rows.append((f"`{topic}`", f"`{kind}`", *ends, entry["qos"]))
    return table(("topic", "type", "from", "to", "quality of service"), rows)


def service_table(nodes: Sequence[Any]) -> str:
    """Services by name: type and who offers them; those that every node of ROS has are left out."""
    rows = []
    for node in nodes:
        for service in node.services:
            package = service.srv_type.__module__.split(".")[0]
            if package not in ("rcl_interfaces", "type_description_interfaces"):
                name = service.service_name.lstrip("/")
                rows.append((f"`{name}`", f"`{package}/{service.srv_type.__name__}`", f"`{node.get_name()}`"))
    return table(("service", "type", "of"), rows)


def quality(profile: Any) -> str:
    """A quality of service in words."""
    durability = profile.durability.name.lower().replace("_", "-")
    return f"{profile.reliability.name.lower()}, {durability}, {profile.depth}"


def node_section(node: Any) -> str:
    """The parameters of a node with what it declares about them."""
    from limb_nodes.nodes.distribution import parameter_values

    rows = []
    for name in parameter_values(node):
        if name.startswith(("qos_overrides", "start_type_description_service", "use_sim_time")):
            continue
        about = node.describe_parameter(name)
        spans = [*about.floating_point_range, *about.integer_range]
        span = f"{spans[0].from_value:g} to {spans[0].to_value:g}" if spans else ""
        kind = node.get_parameter(name).type_.name.lower().replace("double", "number").replace("string", "text")
        rows.append((f"`{name}`", kind, about.description, span or "-", declared(node, name)))
    title = next(line for line in (type(node).__doc__ or "").splitlines() if line.strip()).strip()
    return f"## {node.get_name()}\n\n{title}\n\n" + table(("parameter", "type", "meaning", "allowed", "default"), rows)


def declared(node: Any, name: str) -> str:
    """The default that a node declares for a parameter."""
    value = node.declared[name]
    if value in ("", None):
        return "empty"
    return f"`{str(value).lower() if isinstance(value, bool) else value}`"


# Text


def first_line(function: Callable[..., Any]) -> str:
    """The first line of a function's docstring."""
    return (function.__doc__ or "").strip().splitlines()[0]


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table."""
    lines = ["| " + " | ".join(str(cell).replace("|", "\\|") for cell in line) + " |" for line in (head, *rows)]
    return "\n".join([lines[0], "|" + "---|" * len(head), *lines[1:]])


if __name__ == "__main__":
    sys.exit(main())
