"""The bag of a run as what a run goes on from."""

from __future__ import annotations

import math
import shutil
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

from limb_nodes.bags.types import RUN_INFO, limb_typestore
from limb_nodes.bags.unclosed import Stored, parts_of, stored
from limb_nodes.bags.write import BagWriter
from limb_nodes.errors import UserError
from limb_nodes.exchange.past import Past, expected_topics, past_of
from limb_nodes.foundation.topics import LATCHED_TOPICS
from limb_nodes.foundation.yaml_text import parse_yaml

DESCRIPTION = "robot_description"
# Topics that every recorder writes itself.
OWN = {RUN_INFO, DESCRIPTION}


@dataclass(frozen=True)
class RecordedRun:
    """A bag of a run, as far as it has been written. Its messages are read anew each time.

    bag: the folder. info: what it holds on `run_info`. namespace: of its topics.
    """

    bag: str
    info: dict[str, Any]
    namespace: str

    @classmethod
    def read(cls, bag: str) -> RecordedRun:
        """Raises UserError if it is no bag of a run."""
        first = next(iter(stored(bag)), None)
        if first is None or first.topic.rpartition("/")[2] != RUN_INFO:
            raise UserError(f"{bag}: does not begin with run_info; a bag of limb run is needed")
        text = limb_typestore().deserialize_cdr(first.data, first.type).data  # type: ignore[attr-defined]
        info = parse_yaml(text, f"{bag}: run_info")
        needed = {"limb": str, "period_ns": int, "parameters": dict}
        if not isinstance(info, dict) or any(not isinstance(info.get(key), kind) for key, kind in needed.items()):
            raise UserError(f"{bag}: run_info lacks {', '.join(needed)}; a bag of limb run is needed")
        return cls(bag, info, first.topic.rpartition("/")[0])

    @property
    def every(self) -> dict[str, int]:
        """Topic of the run -> every how many ticks it has a message."""
        parameters = self.info["parameters"].get("muscle_stack", {})
        return expected_topics(parameters if isinstance(parameters, dict) else {})

    def messages(self) -> Iterator[Stored]:
        """What is recorded, topics without the namespace if they are in it."""
        for message in stored(self.bag):
            yield message._replace(topic=message.topic.removeprefix(f"{self.namespace}/"))

    def past(self) -> Past:
        """What the nodes need to go on."""
        return past_of(((m.topic, m.data) for m in self.messages()), self.every, self.info["period_ns"])

    def up_to(self, tick: float) -> Iterator[Stored]:
        """What is recorded up to a tick, each tick once, but for what a recorder says itself."""
        nanoseconds, every = self.info["period_ns"], self.every | {"joint_states": 1}
        counts = dict.fromkeys(every, 0)
        for message in self.messages():
            at = message.time // nanoseconds
            if at > tick or message.topic in OWN:
                continue
            if message.topic in every:
                if at != counts[message.topic] * every[message.topic]:
                    continue
                counts[message.topic] += 1
            yield message


def copy(messages: Iterable[Stored], writer: BagWriter) -> None:
    """Write messages into another bag."""
    for message in messages:
        writer.write_raw(message.topic, message.time, message.data, message.type)


def join_parts(bag: str) -> None:
    """Make one bag of a bag and the parts of recorders that went on with it; nothing if there are none.

    They stay as they are until all of it is written.
    """
    parts = parts_of(bag)
    if not parts:
        return
    folder, run = Path(bag), RecordedRun.read(bag)
    place = folder.with_name(f".{folder.name}.whole")
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir()
    descriptions = (message for message in run.messages() if message.topic == DESCRIPTION)
    with BagWriter(place / folder.name, run.info, namespace=run.namespace, latched=LATCHED_TOPICS) as writer:
        copy(islice(descriptions, 1), writer)
        copy(run.up_to(math.inf), writer)
    for old in (folder, *parts):
        shutil.rmtree(old)
    (place / folder.name).rename(folder)
    place.rmdir()
