"""What the salvage of a damaged file gives, whatever its kind: messages, their topics, and what could not be read."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import NamedTuple

from rosbags.interfaces import MessageDefinition, MessageDefinitionFormat
from rosbags.typesys.store import Typestore

from limb_nodes.bags.columns import MessageLayout
from limb_nodes.bags.types import limb_typestore, typestore_of

LATEST = 2**63 - 1
"""The latest time of a message, ns."""

_FORMATS = {
    "ros2msg": MessageDefinitionFormat.MSG,
    "ros2idl": MessageDefinitionFormat.IDL,
    "omgidl": MessageDefinitionFormat.IDL,
}
# Serialised messages may end on a full word.
_PADDING = 3
# So many damaged places of a file are told.
MOST_PLACES = 5


@dataclass(frozen=True)
class Origin:
    """A topic as a file describes it.

    encoding, definition: of its type; empty if the file has none. serialization: of its messages. qos: as YAML.
    """

    topic: str
    msgtype: str
    encoding: str = ""
    definition: str = ""
    serialization: str = "cdr"
    qos: str = ""


class Message(NamedTuple):
    """A message: its topic, its time (ns) and its bytes."""

    origin: Origin
    stamp: int
    data: bytes


@dataclass
class Damage:
    """What could not be read.

    places: where a file is damaged, first and last byte. missing: messages that are not there by the numbers of rows.
    doubtful: messages that were kept although the checksum that would tell whether they are as written is lost.
    unnamed: messages whose topic is lost. broken: those that are not as their type says. unfinished: whether the
    recorder did not close the file.
    """

    places: list[tuple[int, int]] = field(default_factory=list)
    missing: int = 0
    doubtful: int = 0
    unnamed: int = 0
    broken: int = 0
    unfinished: bool = False

    @property
    def harmful(self) -> bool:
        """Whether a message may be lost."""
        return bool(self.places or self.missing or self.unnamed or self.broken)

    def said(self) -> list[str]:
        """What a person should know, in parts of a sentence."""
        said = []
        if self.places:
            shown = ", ".join(f"{first} to {last}" for first, last in self.places[:MOST_PLACES])
            more = f" and {len(self.places) - MOST_PLACES} more" if len(self.places) > MOST_PLACES else ""
            total = sum(last + 1 - first for first, last in self.places)
            said.append(f"{total} bytes cannot be read, {shown}{more}")
        if self.missing:
            said.append(f"{self.missing} messages are missing by their numbers")
        if self.broken:
            said.append(f"{self.broken} messages are not as their type says and are left out")
        if self.unnamed:
            said.append(f"{self.unnamed} messages belong to a topic whose name is lost and are left out")
        if self.doubtful:
            said.append(f"{self.doubtful} messages are kept although the checksum that vouched for them is lost")
        if self.unfinished:
            said.append("was not closed; what came after its end was never on the disk")
        return said

    def note(self, first: int, end: int) -> None:
        """Bytes from one place to before another are damaged."""
        if self.places and first <= self.places[-1][1] + 1:
            self.places[-1] = (self.places[-1][0], max(end - 1, self.places[-1][1]))
        else:
            self.places.append((first, end - 1))


class Judge:
    """Tells whether the bytes of a message are as its type says; remembers the lengths that were.

    others: types of topics by name, from the bag's metadata, for messages whose topic a file does not tell.
    """

    def __init__(self, others: Mapping[str, str]) -> None:
        self._others = others
        self._known: set[tuple[Origin, int, bytes]] = set()

    def kind(self, topic: str) -> str:
        """The type of a topic by the bag's metadata, "" if that does not tell it."""
        return self._others.get(topic, "")

    def quick(self, origin: Origin, data: bytes) -> bool:
        """`fits`, which is asked only for a length, or a form of CDR, that has not been seen yet."""
        return (origin, len(data), data[:2]) in self._known or self.fits(origin, data)

    def fits(self, origin: Origin, data: bytes) -> bool:
        """Whether the fields of a message take as many bytes as it has; of an unknown type anything fits."""
        store = _store(origin.msgtype, origin.encoding, origin.definition)
        if store is None:
            return True
        try:
            layout = MessageLayout(data, store, elements=True)
            layout.message(origin.msgtype, "")
        except Exception:  # whatever the bytes make of a layout
            return False
        if not 0 <= len(data) - layout.end <= _PADDING:
            return False
        self._known.add((origin, len(data), data[:2]))
        return True

    def guess(self, data: bytes, taken: Collection[str], number: int) -> Origin | None:
        """What a message can be of whose topic is lost, if only one thing is possible.

        A topic of the bag's metadata beside those that are taken; else a topic of that number, of a type of limb_msgs.
        """
        topics = [Origin(topic, kind) for topic, kind in self._others.items() if topic not in taken]
        kinds = [kind for kind in limb_typestore().fielddefs if kind.startswith("limb_msgs/")]
        for origins in (topics, [Origin(f"/topic_{number}", kind) for kind in kinds]):
            fitting = [one for one in origins if _store(one.msgtype, "", "") is not None and self.fits(one, data)]
            if fitting:
                return fitting[0] if len(fitting) == 1 else None
        return None


@lru_cache(maxsize=256)
def _store(msgtype: str, encoding: str, definition: str) -> Typestore | None:
    """The types to decode a topic with, or None if they are not known."""
    kind = _FORMATS.get(encoding, MessageDefinitionFormat.NONE)
    for given in (MessageDefinition(kind, definition), MessageDefinition(MessageDefinitionFormat.NONE, "")):
        try:
            return typestore_of(msgtype, given)
        except ValueError:
            continue
    return None
