"""The message types that bags hold, for use without ROS."""

from __future__ import annotations

import functools
import os
import sys
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.interfaces import MessageDefinition, MessageDefinitionFormat, Nodetype
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from limb_nodes.errors import UserError

STORE = getattr(Stores, "ROS2_KILTED", Stores.LATEST)
RUN_INFO = "run_info"
"""The topic on which a bag holds what is needed to run it again, as a std_msgs/String in YAML."""
RUN_INFO_BYTES = 2**22
"""It holds a limb's file and the files of its laws."""


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
    store = get_typestore(STORE)
    for path in sorted(message_folder().glob("*.msg")):
        store.register(get_types_from_msg(path.read_text(encoding="utf-8"), f"limb_msgs/msg/{path.stem}"))
    return store


def typestore_of(msgtype: str, definition: MessageDefinition) -> Typestore:
    """The types to decode messages of a bag with: those that are installed, unless the bag defines them otherwise.

    Args:
        msgtype: the messages' type.
        definition: what the bag says of it.

    Raises:
        ValueError: the type is in neither, or the definition can't be read.
    """
    store = limb_typestore()
    if definition.format == MessageDefinitionFormat.NONE:
        if msgtype not in store.fielddefs:
            raise ValueError("it is not installed, and the bag does not define it; `ros2 bag convert` to MCAP does")
        return store
    try:
        types = _defined(msgtype, definition)
        if all(store.fielddefs.get(name) == fields for name, fields in types.items()):
            return store
        own = get_typestore(STORE)
        for name in types:
            own.fielddefs.pop(name, None)
            own.types.pop(name, None)
        own.register(types)
        own.get_msgdef(msgtype)
    except Exception as error:  # the library has no one class for what a definition can be
        raise ValueError(f"its definition in the bag cannot be read, {' '.join(str(error).split())[:200]}") from None
    return own


@functools.lru_cache(maxsize=256)
def _defined(msgtype: str, definition: MessageDefinition) -> dict[str, Any]:
    """Every type of a definition, by name, as rosbags describes it."""
    if definition.format == MessageDefinitionFormat.MSG:
        return dict(get_types_from_msg(definition.data, msgtype))
    # Each type of a bundle stands below a line of =, and one that names it.
    text = "\n".join(line for line in definition.data.splitlines() if not line.startswith(("====", "IDL: ")))
    return dict(get_types_from_idl(text))


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
