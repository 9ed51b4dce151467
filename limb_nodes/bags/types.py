"""The message types that bags hold, for use without ROS."""

from __future__ import annotations

import functools
import os
import sys
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from limb_nodes.errors import UserError

RUN_INFO = "run_info"
"""The topic on which a bag holds what is needed to run it again, as a std_msgs/String in YAML."""


def message_folder() -> Path:
    """The folder of the .msg files of limb_msgs: of this Python's prefix, of a ROS workspace, or of the checkout.

    Raises:
        UserError: limb_msgs is in none of them.
    """
    prefixes = [sys.prefix, *filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep))]
    folders = [Path(prefix) / "share" / "limb_msgs" / "msg" for prefix in prefixes]
    folders.append(Path(__file__).resolve().parents[2] / "msgs" / "msg")
    for folder in folders:
        if any(folder.glob("*.msg")):
            return folder
    raise UserError("limb_msgs: its message files are not installed; install the project with pip or colcon")


@functools.cache
def limb_typestore() -> Typestore:
    """The types of ROS 2 Kilted and of limb_msgs; one object for the whole process.

    Raises:
        UserError: limb_msgs is not installed.
    """
    store = get_typestore(getattr(Stores, "ROS2_KILTED", Stores.LATEST))
    for path in sorted(message_folder().glob("*.msg")):
        store.register(get_types_from_msg(path.read_text(encoding="utf-8"), f"limb_msgs/msg/{path.stem}"))
    return store


def make_message(msgtype: str, stamp_ns: int | None = None, **fields: Any) -> Any:
    """A message of a type, for `BagWriter.write`.

    Args:
        msgtype: for example `limb_msgs/msg/JointTorque`.
        stamp_ns: if the type has a header, its stamp, ns.
        fields: the fields by name; sequences of numbers may be any sequence. What is left out is zero or empty.

    Raises:
        TypeError: the type has no such field.
    """
    store = limb_typestore()
    definitions = dict(fields_of(msgtype, store))
    if unknown := set(fields) - set(definitions):
        raise TypeError(f"{msgtype} has no field {', '.join(sorted(unknown))}; it has {', '.join(definitions)}")
    if stamp_ns is not None:
        sec, nanosec = divmod(stamp_ns, 1_000_000_000)
        stamp = make_message("builtin_interfaces/msg/Time", sec=sec, nanosec=nanosec)
        fields["header"] = make_message("std_msgs/msg/Header", stamp=stamp)
    values: dict[str, Any] = {}
    for name, (node, detail) in definitions.items():
        if node in (Nodetype.ARRAY, Nodetype.SEQUENCE):
            (element_node, element), size = detail
            value = fields.get(name, () if node == Nodetype.SEQUENCE else np.zeros(size))
            if element_node == Nodetype.BASE and element[0] != "string":
                value = np.asarray(value, dtype=element[0])
            values[name] = value
        elif name in fields:
            values[name] = fields[name]
        elif node == Nodetype.NAME:
            values[name] = make_message(detail)
        else:
            values[name] = "" if detail[0] == "string" else np.zeros((), dtype=detail[0]).item()
    return store.types[msgtype](**values)


def fields_of(msgtype: str, store: Typestore) -> list[tuple[str, tuple[Nodetype, Any]]]:
    """Each field of a type: name, kind of node, and what the kind needs (rosbags' own description of it)."""
    fields: Any = store.fielddefs[msgtype][1]
    return list(fields)


def absolute(topic: str) -> str:
    """The name under which a bag holds a topic: with a slash in front."""
    return topic if topic.startswith("/") else f"/{topic}"
