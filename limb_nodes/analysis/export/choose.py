"""Which topics of a bag make a table."""

from __future__ import annotations

from limb_nodes.analysis.export.quantities import QUANTITIES, UNASKED, base, in_order
from limb_nodes.bags.read import BagReader
from limb_nodes.bags.types import absolute
from limb_nodes.errors import FieldError, UserError


def chosen_topics(reader: BagReader, names: tuple[str, ...], namespace: str) -> tuple[list[str], list[str]]:
    """The absolute names of the topics, in the order of their columns, and a sentence for each thing left out.

    names: those that are wanted; none for those of a limb but `UNASKED`. namespace: of the limb, if there are several.

    Raises UserError if the bag does not have what is wanted, FieldError `topics` or `namespace` if it is an option's.
    """
    there = [topic for topic, kind in reader.topics.items() if kind in QUANTITIES and reader.has(topic)]
    if not there:
        raise UserError(
            f"{reader.path}: no message of activations, movements or states, which make a table; the bag has "
            f"{', '.join(reader.topics) or 'no topic'}"
        )
    prefix = None
    if namespace or not names:
        prefix = _prefix(reader, there, namespace)
    if names:
        return in_order([_asked(reader, there, prefix, name) for name in dict.fromkeys(names)]), []
    inside = [topic for topic in there if topic.rpartition("/")[0] == prefix]
    left_out = [topic for topic in inside if base(topic) in UNASKED] if len(inside) > 1 else []
    # The movement pattern holds what the joint states hold.
    twice = [f"{prefix}/joint_states"] if f"{prefix}/movement_pattern" in inside else []
    notes = [f"left out unless they are asked for: {', '.join(left_out)}"] if left_out else []
    return in_order([topic for topic in inside if topic not in (*left_out, *twice)]), notes


def _prefix(reader: BagReader, topics: list[str], namespace: str) -> str:
    """The namespace of the topics, as `/left`, or empty."""
    prefixes = {topic.rpartition("/")[0] for topic in topics}
    listed = ", ".join(sorted(prefix.strip("/") or "/" for prefix in prefixes))
    if namespace:
        asked = f"/{namespace.strip('/')}".rstrip("/")
        if asked not in prefixes:
            raise FieldError("namespace", f"is {namespace}; one of {listed} is needed", str(reader.path))
        return asked
    if len(prefixes) > 1:
        raise FieldError("namespace", f"is missing; one of {listed} is needed", str(reader.path))
    return prefixes.pop()


def _asked(reader: BagReader, topics: list[str], prefix: str | None, name: str) -> str:
    """The topic that a name means: the absolute name, the name within the namespace, or the end of one topic's name."""
    within = absolute(name) if prefix is None or name.startswith("/") else f"{prefix}/{name}"
    if within in topics:
        return within
    matches = [topic for topic in topics if topic.endswith(f"/{name}")] if prefix is None else []
    if len(matches) == 1:
        return matches[0]
    if within in reader.topics:
        holds = f", which holds {reader.topics[within]}" if reader.has(within) else ", which has no message"
    else:
        holds = ", which is there twice" if matches else ""
    raise FieldError(
        "topics", f"names {name}{holds}; one of {', '.join(matches or topics)} is needed", str(reader.path)
    )
