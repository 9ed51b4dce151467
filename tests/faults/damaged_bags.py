"""Bags that are damaged or were made to be wrong: opened, drawn, exported and recovered."""

from __future__ import annotations

import contextlib
import io
import random
import re
import shutil
import sqlite3
import tempfile
import time
import traceback
from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from mcap.writer import CompressionType
from rosbags.rosbag2.storage_mcap import McapReader
from ruamel.yaml import YAML

from limb_nodes.analysis.plot.picture import picture
from limb_nodes.analysis.plot.series import read_series
from limb_nodes.bags.read import BagReader
from limb_nodes.bags.recover import recover
from limb_nodes.bags.types import limb_typestore, make_message
from limb_nodes.bags.write import open_writer
from limb_nodes.cli import main as limb
from limb_nodes.errors import UserError
from limb_nodes.foundation.topics import TOPIC_TYPES
from tests.bags import foreign
from tests.faults.trial import Trial

KIND = "damaged or wrong bag"
COUNT = 1000
TICKS, PERIOD = 600, 1_000_000
PAGE = 4096
NUMBERED = re.compile(r"/topic_\d+$")
# A picture takes far longer than to read what it shows.
DRAWN_EVERY = 25
Key = tuple[str, int]
Contents = dict[Key, bytes]


@dataclass
class Sample:
    """A whole bag.

    contents: its messages. places: of each, the stretches of its file without which it cannot be read. named: the
    stretches of which each tells the names of all topics. checked: whether checksums vouch for the messages.
    """

    folder: Path
    file: str
    contents: Contents = field(default_factory=dict)
    places: dict[Key, list[tuple[int, int]]] = field(default_factory=lambda: defaultdict(list))
    named: list[tuple[int, int]] = field(default_factory=list)
    checked: bool = False

    @property
    def name(self) -> str:
        """What it is called."""
        return self.folder.name


def messages() -> Iterator[tuple[str, int, Any]]:
    """What every bag holds: a run's topics with noise in them, and one with large messages."""
    noise, names = np.random.default_rng(7).normal(size=(TICKS, 12)), ["a", "b"]
    info = (
        f"limb: ''\nrate: 1000.0\nperiod_ns: {PERIOD}\nparameters: {{simulate: {{activation: x, tolerance: 1.0e-9}}}}\n"
    )
    yield "run_info", 0, make_message(TOPIC_TYPES["run_info"], data=info)
    for k, row in enumerate(noise):
        stamp = k * PERIOD
        for topic, given in (
            ("activation", {"name": names, "activation": np.abs(row[:2]) % 1.0}),
            ("joint_states", {"name": names, "position": row[2:4], "velocity": row[4:6]}),
            ("joint_torque", {"joint": names, "torque": row[6:8]}),
        ):
            tick = {} if topic == "joint_states" else {"tick": k}
            yield topic, stamp, make_message(TOPIC_TYPES[topic], stamp, **tick, **given)
        if k % 50 == 0:
            large = np.random.default_rng(k).normal(size=2000)
            yield "emg_raw", stamp, make_message(TOPIC_TYPES["emg_raw"], data=large)


def serialised() -> Iterator[tuple[str, int, bytes]]:
    """The same as bytes."""
    store = limb_typestore()
    for topic, stamp, message in messages():
        yield topic, stamp, bytes(store.serialize_cdr(message, message.__msgtype__))


def of_limb(folder: Path, *, compressed: bool) -> Sample:
    """A bag as limb writes it, in some thirty chunks."""
    bag = open_writer(folder, compressed=compressed)
    topics = {
        topic: bag.add_connection(f"/{topic}", TOPIC_TYPES[topic], typestore=limb_typestore())
        for topic in ("run_info", "activation", "joint_states", "joint_torque", "emg_raw")
    }
    bag.flush()
    for number, (topic, stamp, data) in enumerate(serialised()):
        bag.write_all([(topics[topic], stamp, data)])
        if number % 60 == 59:
            bag.flush()
    bag.close()
    return with_chunks(Sample(folder, f"{folder.name}.mcap", checked=compressed))


def of_mcap(folder: Path, compression: CompressionType) -> Sample:
    """A bag of another writer of MCAP, one topic in small chunks with checksums."""
    folder.mkdir()
    rows = [(stamp, message) for topic, stamp, message in messages() if topic == "activation"]
    foreign.write_mcap(folder / "a_0.mcap", "/activation", rows, compression)
    return with_chunks(Sample(folder, "a_0.mcap", checked=True))


def of_sqlite(folder: Path) -> Sample:
    """A bag with sqlite3 storage."""
    from rosbags.rosbag2 import StoragePlugin, Writer

    with Writer(folder, version=9, storage_plugin=StoragePlugin.SQLITE3) as bag:
        topics = {
            topic: bag.add_connection(f"/{topic}", TOPIC_TYPES[topic], typestore=limb_typestore())
            for topic in ("run_info", "activation", "joint_states", "joint_torque", "emg_raw")
        }
        for topic, stamp, data in serialised():
            bag.write(topics[topic], stamp, data)
    sample = Sample(folder, f"{folder.name}.db3")
    content = (folder / sample.file).read_bytes()
    for key, data in contents(folder).items():
        sample.contents[key] = data
        # From the end on, where the noise is, which is there once.
        for end in range(len(data), 32, -200):
            at = content.find(data[end - 32 : end])
            sample.places[key].append((at // PAGE * PAGE, (at // PAGE + 1) * PAGE))
    return sample


def contents(path: Path) -> Contents:
    """The messages of a whole bag."""
    with BagReader(path) as bag:
        return {(topic, stamp): data for topic in bag.topics for stamp, data in bag.read_raw(topic)}


def with_chunks(sample: Sample) -> Sample:
    """Note which chunk of an MCAP file each message is in."""
    reader = McapReader(sample.folder / sample.file)
    reader.open()
    sample.contents = contents(sample.folder)
    for chunk in reader.chunks:
        inside = [chunk.message_start_time <= stamp <= chunk.message_end_time for _, stamp in sample.contents]
        for key, near in zip(sample.contents, inside, strict=True):
            if near:
                sample.places[key].append((chunk.chunk_start_offset, chunk.chunk_start_offset + chunk.chunk_length))
    chunk = reader.chunks[0].chunk_start_offset
    sample.named = [
        (chunk, chunk + reader.chunks[0].chunk_length),
        (reader.data_end, (sample.folder / sample.file).stat().st_size),
    ]
    if b"/activation" in (sample.folder / sample.file).read_bytes()[:chunk]:
        sample.named.append((0, chunk))
    reader.close()
    return sample


class Mutation:
    """Damages the bytes of a file; `touched` are the stretches of the whole file that are no longer as they were."""

    def __init__(self, content: bytes, draw: random.Random) -> None:
        self.content, self.draw = bytearray(content), draw
        self.touched: list[tuple[int, int]] = []
        self.said: list[str] = []

    def somewhere(self, longest: int) -> tuple[int, int]:
        start = self.draw.randrange(len(self.content))
        return start, min(len(self.content), start + self.draw.randint(1, longest))

    def flip(self) -> None:
        for _ in range(self.draw.choice((1, 1, 3, 20))):
            at = self.draw.randrange(len(self.content))
            self.content[at] ^= 1 << self.draw.randrange(8)
            self.touched.append((at, at + 1))

    def zero(self) -> None:
        start, end = self.somewhere(20_000)
        self.content[start:end] = bytes(end - start)
        self.touched.append((start, end))

    def overwrite(self) -> None:
        start, end = self.somewhere(5_000)
        self.content[start:end] = self.draw.randbytes(end - start)
        self.touched.append((start, end))

    def head(self) -> None:
        self.content[:8] = self.draw.randbytes(8)
        self.touched.append((0, 8))

    def cut(self) -> None:
        size = self.draw.randrange(len(self.content))
        self.touched.append((size, len(self.content)))
        del self.content[size:]

    def remove(self) -> None:
        """Not of databases, whose pages have their places."""
        start, end = self.somewhere(5_000)
        del self.content[start:end]
        # What lies behind has moved: nothing else may be damaged by place.
        self.touched.append((start, end))

    def insert(self) -> None:
        start, end = self.somewhere(2_000)
        self.content[start:start] = self.draw.randbytes(end - start)
        self.touched.append((start, start + 1))


def mutate(sample: Sample, folder: Path, draw: random.Random) -> Mutation:
    """Damage a copy of a bag's file in one to three ways; those that move what lies behind come alone."""
    file = folder / sample.file
    mutation = Mutation(file.read_bytes(), draw)
    ways: list[str] = draw.choices(("flip", "zero", "overwrite", "head"), k=draw.randint(1, 3))
    if draw.random() < 0.3:
        ways.append("cut")
    elif not sample.file.endswith(".db3") and draw.random() < 0.3:
        ways = [draw.choice(("remove", "insert"))]
    for way in ways:
        getattr(mutation, way)()
    mutation.said = ways
    file.write_bytes(mutation.content)
    return mutation


WRONG: tuple[Any, ...] = (
    None,
    [],
    {},
    "",
    "x" * 5000,
    "\0\x1b[31m",
    -1,
    2**80,
    float("nan"),
    True,
    [None],
    {"a": None},
)


def wrong_tree(tree: Any, draw: random.Random) -> Any:
    """Put something else in place of a node of a tree."""
    if isinstance(tree, (dict, list)) and tree and draw.random() < 0.85:
        key = draw.choice(list(tree) if isinstance(tree, dict) else range(len(tree)))
        tree[key] = wrong_tree(tree[key], draw)
        return tree
    return draw.choice(WRONG)


def wrong_text(text: str, draw: random.Random) -> str:
    """A YAML text with a wrong node, cut, nested deeply, or no YAML."""
    way = draw.randrange(4)
    if way == 0:
        return text[: draw.randrange(len(text))]
    if way == 1:
        return draw.choice(("[" * 3000, "a: &a [*a]", "? " * 500, "\t:", "- !!python/object:os.system x", "2001-99-99"))
    tree = YAML(typ="safe", pure=True).load(text)
    for _ in range(draw.randint(1, 3)):
        tree = wrong_tree(tree, draw)
    stream = io.StringIO()
    YAML(typ="safe", pure=True).dump(tree, stream)
    return stream.getvalue()


def wrong_metadata(sample: Sample, folder: Path, draw: random.Random) -> None:
    """A metadata.yaml that says something else."""
    file = folder / "metadata.yaml"
    file.write_text(wrong_text(file.read_text(), draw)) if file.exists() else file.write_text(draw.choice(WRONG[3:6]))


def wrong_rows(sample: Sample, folder: Path, draw: random.Random) -> None:
    """A database whose rows hold something else, by sqlite3 itself."""
    base = sqlite3.connect(folder / sample.file)
    table, columns = draw.choice(
        (
            ("topics", ("name", "type", "serialization_format", "offered_qos_profiles", "type_description_hash")),
            ("message_definitions", ("topic_type", "encoding", "encoded_message_definition")),
            ("messages", ("topic_id", "timestamp", "data")),
            ("schema", ("schema_version",)),
        )
    )
    given = draw.choice((None, "", "x" * 3000, b"\0\1\2", -5, 2**62, 1.5, "[{a: 1}]", b""))
    # Columns that must not be null may hold nothing else that is wrong.
    with contextlib.suppress(sqlite3.Error):
        limit = "" if table != "messages" else f" WHERE id % {draw.randint(1, 50)} = 0"
        base.execute(f"UPDATE {table} SET {draw.choice(columns)} = ?{limit}", (given,))
    base.commit()
    base.close()


def wrong_messages(_: Sample, folder: Path, draw: random.Random) -> None:
    """A whole bag whose messages, definitions and run_info are not what they should be."""
    shutil.rmtree(folder)
    bag = open_writer(folder, compressed=draw.random() < 0.5)
    topics = {}
    for topic in ("run_info", "activation", "joint_states", "joint_torque", "emg_raw"):
        kind, text = TOPIC_TYPES[topic], None
        if draw.random() < 0.1:
            kind = draw.choice(("std_msgs/msg/String", "a", "lab_msgs/msg/None", "a/b/c/d"))
        if draw.random() < 0.1:
            text = draw.choice(("float64 x\n", "bool [", "", "string<=3[<=2] data\n", "a/msg/B b\n"))
        with contextlib.suppress(Exception):  # the library refuses some
            given = {"msgdef": text, "rihs01": "RIHS01_0"} if text is not None else {"typestore": limb_typestore()}
            topics[topic] = bag.add_connection(f"/{topic}", kind, **given)
    for topic, stamp, whole in serialised():
        if topic not in topics or stamp > 60 * PERIOD:
            continue
        data = bytearray(whole)
        if topic == "run_info" and draw.random() < 0.7:
            text = wrong_text(whole[8:-1].decode(), draw)
            data = bytearray(
                limb_typestore().serialize_cdr(make_message(TOPIC_TYPES[topic], data=text), TOPIC_TYPES[topic])
            )
        elif draw.random() < 0.05:
            way = draw.randrange(4)
            if way == 0:
                del data[draw.randrange(len(data)) :]
            elif way == 1:
                at = draw.randrange(len(data))
                data[at : at + 8] = draw.randbytes(8)
            elif way == 2:
                data += draw.randbytes(draw.randint(1, 30))
            else:
                stamp = draw.choice((0, 2**63 - 1, stamp + 10**15))
        bag.write_all([(topics[topic], stamp, bytes(data))])
    bag.close()


def used(path: Path, work: Path, *, draw_it: bool) -> Iterator[Callable[[], None]]:
    """What is done with a bag."""

    def read() -> None:
        with BagReader(path) as bag:
            bag.run_info()
            for topic in bag.topics:
                with contextlib.suppress(UserError):
                    bag.table(topic)
                with contextlib.suppress(UserError):
                    bag.blocks(topic, bag.kinds(topic))

    yield read
    yield lambda: picture(read_series(path)) if draw_it else read_series(path)
    yield lambda: exits("export", str(path), "-o", str(work / "a.csv"), "--force")
    yield lambda: exits("simulate", "params/reference_joint.yaml", "--activation", str(path))


def exits(*arguments: str) -> None:
    """A command, without what it prints."""
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        limb(list(arguments))


def trial(sample: Sample, work: Path, seed: int) -> Trial:
    """Damage a copy of a bag, use it, recover it, and compare."""
    draw = random.Random(seed)
    folder, out = work / sample.name, work / "out"
    for old in (folder, out):
        shutil.rmtree(old, ignore_errors=True)
    shutil.copytree(sample.folder, folder)
    ways: list[Callable[[Sample, Path, random.Random], Any]] = [mutate] * 5 + [wrong_metadata, wrong_messages]
    way = draw.choice([*ways, wrong_rows] if sample.file.endswith(".db3") else ways)
    mutation = way(sample, folder, draw)
    if mutation is not None and draw.random() < 0.2:
        (folder / "metadata.yaml").unlink(missing_ok=True)
    what = f"{sample.name}, seed {seed}: {', '.join(mutation.said) if mutation else way.__name__}"
    said, begun = "", time.monotonic()
    for use in used(folder, work, draw_it=seed % DRAWN_EVERY == 0):
        try:
            use()
        except UserError as error:
            said += "" if "\n" not in str(error) else f" {error!r}"
        except Exception:
            said += traceback.format_exc()
    lost, changed = 0.0, False
    try:
        recovered = recover(folder, out)
        kept = contents(out)
        if mutation is not None:
            lost, changed = compared(sample, mutation, kept, doubtful="checksum that vouched" in str(recovered.notes))
    except UserError as error:
        if mutation is not None:
            lost, changed = compared(sample, mutation, {}, doubtful=False)
        said += "" if "\n" not in str(error) else f" {error!r}"
    except Exception:
        said += traceback.format_exc()
    return Trial(what + said, lost=lost, changed=changed, traceback=bool(said), hung=time.monotonic() - begun > HUNG)


# Longer than any bag of this size may take (s), pictures aside.
HUNG = 5.0


def touches(mutation: Mutation, place: tuple[int, int]) -> bool:
    """Whether a stretch of the whole file is no longer as it was."""
    return any(place[0] < end and start < place[1] for start, end in mutation.touched)


def compared(sample: Sample, mutation: Mutation, kept: Contents, *, doubtful: bool) -> tuple[float, bool]:
    """How much (s) outside the damage is lost, and whether a value differs that should not. doubtful: is said to be."""
    # A topic whose name is lost has a number instead.
    keys = {data: key for key, data in sample.contents.items()}
    found = {keys.get(data, key) if NUMBERED.match(key[0]) else key: data for key, data in kept.items()}
    whole = {key for key in sample.contents if not any(touches(mutation, place) for place in sample.places[key])}
    if sample.named and all(touches(mutation, place) for place in sample.named):
        # No program can tell then whose messages these are.
        whole &= found.keys()
    missing = {stamp for topic, stamp in whole if (topic, stamp) not in found}
    # Where there are checksums, they vouch for what lies in the damage too.
    vouched = found if sample.checked and not doubtful else whole & found.keys()
    differs = any(sample.contents.get(key) != found[key] for key in vouched)
    return len(missing) * PERIOD * 1e-9, differs


def samples(folder: Path) -> list[Sample]:
    """Bags of every kind."""
    return [
        of_limb(folder / "limb", compressed=True),
        of_limb(folder / "plain", compressed=False),
        of_mcap(folder / "lz4", CompressionType.LZ4),
        of_mcap(folder / "checked", CompressionType.NONE),
        of_sqlite(folder / "sqlite"),
    ]


def trials(count: int, seed: int) -> Iterator[Trial]:
    """Bags of each kind in turn, each with damage of its own."""
    with tempfile.TemporaryDirectory(prefix="limb_bags_") as folder:
        every = samples(Path(folder))
        work = Path(folder) / "work"
        work.mkdir()
        for number in range(count):
            yield trial(every[number % len(every)], work, seed * 1_000_000 + number)
