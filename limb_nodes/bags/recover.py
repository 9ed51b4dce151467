"""Make a whole bag of a damaged one: every message that can be read, with its index, and what was lost."""

from __future__ import annotations

import itertools
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from pathlib import Path, PurePath
from typing import Any

from rosbags.interfaces import Connection
from rosbags.rosbag2.metadata import parse_qos
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from limb_nodes.bags.files import files_there, is_database, metadata_of, plain_name, unpacked
from limb_nodes.bags.folder import refuse_existing
from limb_nodes.bags.gaps import Stamps
from limb_nodes.bags.salvage import Damage, Judge, Message, Origin
from limb_nodes.bags.salvage_mcap import McapSalvage
from limb_nodes.bags.salvage_sqlite import SqliteSalvage
from limb_nodes.bags.storage import Storage
from limb_nodes.bags.types import RUN_INFO, RUN_INFO_BYTES, limb_typestore
from limb_nodes.bags.unclosed import parts_of
from limb_nodes.bags.write import open_writer
from limb_nodes.errors import RunError, UserError
from limb_nodes.foundation.yaml_text import parse_yaml

_NO_HASH = "RIHS01_" + "0" * 64
_IDL = "=" * 80 + "\nIDL: "


@dataclass
class Recovered:
    """What `recover` could still read.

    Attributes:
        path: the new bag.
        counts: topic -> messages.
        end_ns: time of the last message, ns.
        truncated: whether something is damaged, missing, or was not closed.
        left_out: topics whose messages are not defined in a form of ROS 2, or whose definition is lost.
        expected: topic -> messages, as the bag's metadata.yaml counts them; empty if it does not.
        lost: topic -> where messages are missing between those of even stamps: first and last stamp, ns, how many.
        period_ns: of a tick, as the bag's run_info tells; 0 if it does not.
        notes: what else a person should know, one sentence each.
    """

    path: Path
    counts: dict[str, int] = field(default_factory=dict)
    end_ns: int = 0
    truncated: bool = False
    left_out: set[str] = field(default_factory=set)
    expected: dict[str, int] = field(default_factory=dict)
    lost: dict[str, list[tuple[int, int, int]]] = field(default_factory=dict)
    period_ns: int = 0
    notes: tuple[str, ...] = ()


def recover(bag_dir: str | Path, out_dir: str | Path) -> Recovered:
    """Copy every message that can still be read into a new bag, whole and with its index.

    Args:
        bag_dir: the damaged bag, or a file of it; it is left as it is.
        out_dir: the folder to make.

    Raises:
        UserError: `bag_dir` has no file of messages or nothing readable in it, `out_dir` exists or can't be made;
            nothing has been written then.
        RunError: the new bag cannot be written.
    """
    source, path = Path(bag_dir), Path(out_dir)
    if not source.exists():
        raise UserError(f"{source}: no such bag")
    # What a second recorder wrote that went on for a killed one belongs to the bag.
    parts = [file for part in parts_of(source) for file in files_there(part)]
    files = files_there(source) + parts
    if not files:
        raise UserError(f"{source}: holds no file of messages, .mcap or .db3; one is needed")
    refuse_existing(path)
    about = _About(source)
    copy = _Copy(Recovered(path, expected=about.counts), Judge(about.types))
    try:
        with ExitStack() as stack:
            for file in files:
                copy.take(file, stack, repeats=file in parts)
        if copy.writer is None:
            raise UserError(f"{source}: holds no whole message; at least one is needed")
        copy.writer.close()
    except OSError as error:
        raise RunError(f"{path}: cannot be written: {error}; what is there is not whole") from None
    missing = [name for name in about.files if name not in {plain_name(file).name for file in files}]
    return copy.finished(about.span, about.notes + [f"{name}: is missing; its messages are lost" for name in missing])


class _About:
    """What the metadata.yaml of a bag says, if it can be read.

    counts, types: of topics. span: first and last time, ns. files: names of those of messages, unpacked.
    notes: what a person should know of it.
    """

    def __init__(self, source: Path) -> None:
        self.counts: dict[str, int] = {}
        self.types: dict[str, str] = {}
        self.span: tuple[int, int] | None = None
        self.files: list[str] = []
        self.notes: list[str] = []
        if not source.is_dir():
            return
        file = source / "metadata.yaml"
        if not file.exists():
            self.notes = ["there is no metadata.yaml; it is made anew"]
            return
        try:
            content = metadata_of(file)
            for entry in content["topics_with_message_count"]:
                topic, count = entry["topic_metadata"], entry["message_count"]
                if isinstance(topic["name"], str) and isinstance(topic["type"], str) and isinstance(count, int):
                    self.counts[topic["name"]], self.types[topic["name"]] = count, topic["type"]
            start, duration = content["starting_time"]["nanoseconds_since_epoch"], content["duration"]["nanoseconds"]
            self.span = int(start), int(start) + int(duration)
            self.files = [plain_name(Path(PurePath(name).name)).name for name in content["relative_file_paths"]]
        except (UserError, ValueError, KeyError, TypeError, OverflowError):
            self.notes = ["metadata.yaml is damaged; it is made anew"]


class _Copy:
    """The new bag while it is written."""

    def __init__(self, recovered: Recovered, judge: Judge) -> None:
        self.writer: Storage | None = None
        self._recovered, self._judge = recovered, judge
        self._connections: dict[Origin, Connection | None] = {}
        self._stamps: dict[str, Stamps] = {}
        self._notes: list[str] = []
        self._damaged = self._described = False

    def take(self, file: Path, stack: ExitStack, *, repeats: bool = False) -> None:
        """Copy the messages of one file; repeats: but for those at times at which a topic has one already."""
        before = {topic: stamps.last for topic, stamps in self._stamps.items()} if repeats else {}
        damage = Damage()
        plain, whole = unpacked(file, stack)
        if not whole:
            self._notes.append(f"{file.name}: is packed and damaged; what stood behind the damage is lost")
        salvage = SqliteSalvage if is_database(plain) else McapSalvage
        found = salvage(plain, self._judge, damage).messages()
        new = (one for one in found if one.stamp > before.get(one.origin.topic, -1))
        batch = filter(None, map(self._prepared, new))
        first = next(batch, None)
        if first is not None:
            assert self.writer is not None
            self.writer.write_all(itertools.chain([first], batch))
        self._damaged |= not whole or damage.harmful
        self._recovered.truncated |= not whole or damage.harmful or damage.unfinished
        self._notes += [f"{file.name}: {said}" for said in damage.said()]

    def finished(self, span: tuple[int, int] | None, notes: list[str]) -> Recovered:
        """What has been recovered, and what not. span: first and last time (ns) of the whole bag, if they are known."""
        result = self._recovered
        short = {topic: count - result.counts.get(topic, 0) for topic, count in result.expected.items()}
        result.truncated |= bool(notes) or any(count > 0 for count in short.values())
        # Without damage stamps that are not even are as they were recorded.
        for topic, stamps in self._stamps.items() if result.truncated else ():
            if short.get(topic) == 0:
                continue
            ticks = result.period_ns and stamps.step and stamps.step % result.period_ns == 0
            gaps = stamps.gaps(0, result.end_ns) if ticks else stamps.gaps()
            if span is not None:
                # What is missing at both ends is known by its number alone.
                all_gaps = stamps.gaps(*span)
                gaps = all_gaps if sum(count for *_, count in all_gaps) == short.get(topic) else gaps
            if gaps:
                result.lost[topic] = gaps
        own = any(origin.msgtype.startswith("limb_msgs/") for origin in self._connections)
        if result.truncated and own and not self._described:
            notes = [*notes, "run_info is lost, if there was one: the bag cannot be run again, nor its limb be drawn"]
        result.notes = (*self._notes, *notes)
        return result

    def _prepared(self, message: Message) -> tuple[Connection, int, bytes] | None:
        """What the writer takes; None if the message is left out."""
        origin, stamp, data = message
        if origin not in self._connections:
            self._connections[origin] = self._connect(origin)
        connection = self._connections[origin]
        if connection is None:
            return None
        recovered, topic = self._recovered, connection.topic
        recovered.counts[topic] = recovered.counts.get(topic, 0) + 1
        recovered.end_ns = max(recovered.end_ns, stamp)
        if topic in self._stamps:
            self._stamps[topic].add(stamp)
        else:
            self._stamps[topic] = Stamps(stamp)
        if not self._described and topic.rpartition("/")[2] == RUN_INFO:
            self._describe(data, connection.msgtype)
        return connection, stamp, data

    def _describe(self, data: bytes, msgtype: str) -> None:
        """Take the period of a tick from run_info."""
        with suppress(Exception):  # whatever its text may be
            message: Any = limb_typestore().deserialize_cdr(data, msgtype)
            info = parse_yaml(message.data, "", RUN_INFO_BYTES)
            self._described = isinstance(info, dict)
            if isinstance(info["period_ns"], int):
                self._recovered.period_ns = max(0, info["period_ns"])

    def _connect(self, origin: Origin) -> Connection | None:
        """The connection of the new bag for a topic, None if its type is not known."""
        defined = _definition(origin)
        if defined is None:
            self._recovered.left_out.add(origin.topic)
            return None
        if self.writer is None:
            self.writer = open_writer(self._recovered.path, compressed=True)
        for connection in self.writer.connections:
            if (connection.topic, connection.msgtype) == (origin.topic, origin.msgtype):
                return connection
        qos: Any = ()
        with suppress(Exception):  # whatever its text may be
            qos = parse_qos(origin.qos)  # type: ignore[arg-type]
        text, digest = defined
        return self.writer.add_connection(
            origin.topic, origin.msgtype, msgdef=text, rihs01=digest, offered_qos_profiles=qos
        )


def _definition(origin: Origin) -> tuple[str, str] | None:
    """The definition of a topic's type and the hash by which ROS 2 tells its versions apart; None if it is not known.

    The hash is zero if the definition is not in .msg syntax.
    """
    if origin.serialization != "cdr":
        return None
    if origin.encoding in ("ros2idl", "omgidl"):
        text = origin.definition
        return (text if text.startswith(_IDL) else f"{_IDL}{origin.msgtype}\n{text}"), _NO_HASH
    if origin.encoding == "ros2msg":
        with suppress(Exception):  # the library has no one class for what a definition can be
            store = get_typestore(Stores.EMPTY)
            store.register(get_types_from_msg(origin.definition, origin.msgtype))
            return origin.definition, store.hash_rihs01(origin.msgtype)
    known = limb_typestore()
    if origin.msgtype not in known.fielddefs:
        return None
    return known.generate_msgdef(origin.msgtype, ros_version=2)[0], known.hash_rihs01(origin.msgtype)
