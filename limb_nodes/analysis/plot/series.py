"""What a picture needs of a bag, as arrays."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from limb_nodes.bags.read import BagReader
from limb_nodes.bags.types import RUN_INFO, RUN_INFO_BYTES
from limb_nodes.errors import FieldError, UserError
from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.foundation.topics import TOPIC_TYPES
from limb_nodes.foundation.yaml_text import parse_yaml
from limb_nodes.model import Limb, outline
from limb_nodes.signals.envelope_bag import ANGLE_TOPIC, ENVELOPE_TOPIC, RAW_TOPIC, read_raw

DRAWN = ("activation", ENVELOPE_TOPIC, "motor_unit_state", "muscle_state", "joint_torque", "joint_states", ANGLE_TOPIC)
MUSCLE_FIELDS = (
    "muscle_force",
    "torque",
    "muscle_tendon_length",
    "muscle_length",
    "fibre_length",
    "tendon_length",
    "pennation_angle",
)


@dataclass(frozen=True)
class Series:
    """Values over time: times [samples] in s, values [samples, names]."""

    names: tuple[str, ...]
    times: FloatArray
    values: FloatArray

    def column(self, name: str) -> FloatArray:
        """The values of one name."""
        return self.values[:, self.names.index(name)]


@dataclass(frozen=True)
class Event:
    """Something noticed in a channel: its new name, the kind of the artefact, times in s, the value in its unit."""

    name: str
    kind: str
    start: float
    end: float
    value: float


@dataclass(frozen=True)
class RawEmg:
    """The raw EMG of a bag of envelopes: the channels under their new names, each in its unit, and what was noticed."""

    series: Series
    units: tuple[str, ...]
    events: tuple[Event, ...]


@dataclass(frozen=True)
class BagSeries:
    """What a bag holds. A series is None, or missing in `muscles`, if the bag lacks its topic.

    limb: None in a bag without one, such as an envelope bag. drive: activations, or the envelopes of a bag without
    activations (`is_envelope`). owners: the muscle of each motor unit of `frequency`. muscles: by field of MuscleState.
    raw: what the envelopes were made of. remarks: what was noticed when they were made, one sentence each.
    torque_joints: the joint of each torque of `muscles`.
    angle, velocity, torque: by joint, rad, rad/s, N m. reference: recorded angles by joint, rad. start, end: s.
    source: what the bag was made of, if it holds no limb. notes: what a person should know, one sentence each.
    """

    path: Path
    limb: Limb | None
    rate: float | None
    version: str
    start: float
    end: float
    drive: Series | None = None
    is_envelope: bool = False
    raw: RawEmg | None = None
    remarks: tuple[str, ...] = ()
    frequency: Series | None = None
    owners: tuple[str, ...] = ()
    muscles: dict[str, Series] = field(default_factory=dict)
    torque_joints: tuple[str, ...] = ()
    torque: Series | None = None
    angle: Series | None = None
    velocity: Series | None = None
    reference: Series | None = None
    source: str = ""
    notes: tuple[str, ...] = ()


class _Bag:
    """A bag's topics under one namespace, between two times."""

    def __init__(self, reader: BagReader, namespace: str, start: float | None, end: float | None) -> None:
        self.reader = reader
        self.prefix = _prefix(reader, namespace)
        self.start, self.end = start, end
        self.first, self.last = np.inf, -np.inf
        self.offset = 0.0

    def has(self, topic: str) -> bool:
        return self.reader.has(f"{self.prefix}/{topic}")

    def table(self, topic: str) -> dict[str, npt.NDArray[Any]]:
        """A topic's fields, all of its time; `cut` takes what is asked for."""
        table = self.reader.table(f"{self.prefix}/{topic}")
        table["time"] = table["time"] - self.offset
        self.first = min(self.first, float(table["time"][0]))
        self.last = max(self.last, float(table["time"][-1]))
        return table

    def field(self, topic: str, table: dict[str, npt.NDArray[Any]], field: str) -> npt.NDArray[Any]:
        """The values of a field; UserError if the messages do not have it."""
        if field not in table:
            raise UserError(
                f"{self.reader.path}: topic {self.prefix}/{topic} has no field {field}; a bag of limb's is needed"
            )
        return table[field]

    def names(self, topic: str, table: dict[str, npt.NDArray[Any]], field: str = "name") -> tuple[str, ...]:
        """The names in a field."""
        return tuple(str(text) for text in self.field(topic, table, field))

    def cut(self, topic: str, table: dict[str, npt.NDArray[Any]], names: tuple[str, ...], field: str) -> Series:
        """The part of a field that is to be drawn."""
        values = self.field(topic, table, field)
        if values.shape[1:] != (len(names),):
            raise UserError(
                f"{self.reader.path}: topic {self.prefix}/{topic} has {len(names)} names and "
                f"{'x'.join(map(str, values.shape[1:])) or 'no'} values of {field}; as many of both are needed"
            )
        times = table["time"]
        # Half a nanosecond of slack, for times are whole nanoseconds as floating-point seconds.
        keep = np.ones(len(times), dtype=bool)
        if self.start is not None:
            keep &= times >= self.start - 5e-10
        if self.end is not None:
            keep &= times <= self.end + 5e-10
        return Series(names, times[keep], values[keep].astype(np.float64))

    def info(self) -> dict[str, Any]:
        """The bag's run_info, empty if there is none."""
        topic = f"{self.prefix}/{RUN_INFO}"
        if not self.reader.has(topic):
            return {}
        _, message = next(self.reader.read_topic(topic))
        try:
            info = parse_yaml(message.data, topic, RUN_INFO_BYTES)
        except (UserError, AttributeError):
            info = None
        return info if isinstance(info, dict) else {}


def read_series(
    path: str | Path,
    *,
    namespace: str = "",
    start: float | None = None,
    end: float | None = None,
    reference: str | Path | None = None,
) -> BagSeries:
    """Read what a picture of a bag shows.

    namespace: of the limb, if the bag holds several. start, end: first and last time, s; None for the bag's own.
    reference: a bag with recorded angles (`reference_angle`); None takes those of the bag itself.
    Raises UserError if there is no such bag, nothing in it that can be drawn, or nothing between start and end.
    """
    _check_times(start, end)
    with BagReader(path) as reader:
        bag = _Bag(reader, namespace, start, end)
        info = bag.info()
        limb, notes = _limb(info, str(path))
        parts = {
            **_read_drive(bag),
            **_read_units(bag),
            **_read_muscles(bag),
            **_read_joints(bag),
            **_read_raw(bag, info),
        }
        if reference is None and bag.has(ANGLE_TOPIC):
            table = bag.table(ANGLE_TOPIC)
            parts["reference"] = bag.cut(ANGLE_TOPIC, table, bag.names(ANGLE_TOPIC, table), "position")
    if reference is not None:
        parts["reference"] = _read_recorded(reference, start, end)
    if "reference" in parts and "angle" in parts:
        parts["reference"] = _matched(parts["reference"], parts["angle"].names, reference, notes)
    first, last = _shown(path, bag, start, end)
    return BagSeries(
        Path(path),
        limb,
        float(info["rate"]) if isinstance(info.get("rate"), (int, float)) else None,
        _version(info),
        first,
        last,
        source=str(info.get("source") or ""),
        notes=tuple(notes),
        **parts,
    )


def _check_times(start: float | None, end: float | None) -> None:
    for name, value in (("start", start), ("end", end)):
        if value is not None and not np.isfinite(value):
            raise FieldError(name, f"is {value:g}; a finite number in s is needed")
    if start is not None and end is not None and not start < end:
        raise FieldError("end", f"is {end:g}; a number > the start ({start:g}) in s is needed")


def _shown(path: str | Path, bag: _Bag, start: float | None, end: float | None) -> tuple[float, float]:
    """First and last time of the picture."""
    if start is not None and start >= bag.last:
        raise FieldError("start", f"is {start:g}; a number < {bag.last:g} in s is needed, the end of {path}")
    if end is not None and end <= bag.first:
        raise FieldError("end", f"is {end:g}; a number > {bag.first:g} in s is needed, the start of {path}")
    first = bag.first if start is None else max(start, bag.first)
    last = bag.last if end is None else min(end, bag.last)
    return first, last


def _prefix(reader: BagReader, namespace: str) -> str:
    """The namespace of the topics to draw, as `/left`, or empty."""
    known = {topic for topic in TOPIC_TYPES if not topic.startswith("/")}
    drawn: set[str] = set()
    for topic in reader.topics:
        prefix, _, name = topic.rpartition("/")
        if name in known and name in DRAWN and reader.has(topic):
            drawn.add(prefix)
    there = ", ".join(sorted(prefix.strip("/") or "/" for prefix in drawn))
    empty = [topic for topic in reader.topics if topic.rpartition("/")[2] in DRAWN]
    if not drawn and empty:
        raise UserError(
            f"{reader.path}: {', '.join(empty)} have no messages, nothing to draw; a run that has begun is needed"
        )
    if not drawn:
        raise UserError(
            f"{reader.path}: has {', '.join(reader.topics) or 'no topic'}, nothing to draw; "
            f"a message on {' or '.join(DRAWN)} is needed"
        )
    if namespace:
        asked = f"/{namespace.strip('/')}".rstrip("/")
        if asked not in drawn:
            raise FieldError("namespace", f"is {namespace}; one of {there} is needed", str(reader.path))
        return asked
    if len(drawn) > 1:
        raise FieldError("namespace", f"is empty; one of {there} is needed", str(reader.path))
    return drawn.pop()


def _limb(info: dict[str, Any], path: str) -> tuple[Limb | None, list[str]]:
    text = info.get("limb")
    if not isinstance(text, str):
        return None, []
    try:
        return outline(text, str(info.get("limb_file") or path)), []
    except UserError as error:
        # The recording can be drawn nevertheless.
        return None, [f"drawn without the limb, which can't be read: {error}"]


def _version(info: dict[str, Any]) -> str:
    versions = info.get("versions")
    return str(versions.get("limb_nodes", "")) if isinstance(versions, dict) else ""


def _read_drive(bag: _Bag) -> dict[str, Any]:
    topic = next((topic for topic in ("activation", ENVELOPE_TOPIC) if bag.has(topic)), None)
    if topic is None:
        return {}
    table = bag.table(topic)
    # Bags of former versions have their envelopes as activations.
    field = "envelope" if "envelope" in table else "activation"
    drive = bag.cut(topic, table, bag.names(topic, table), field)
    return {"drive": drive, "is_envelope": topic == ENVELOPE_TOPIC}


def _read_raw(bag: _Bag, info: dict[str, Any]) -> dict[str, Any]:
    """The raw EMG and what was noticed in it, if the bag is of `limb emg` and holds them."""
    channels, rate = info.get("channels"), info.get("raw_rate")
    if not isinstance(channels, list) or not isinstance(rate, (int, float)):
        return {}
    remarks = tuple(str(note) for note in info.get("notes") or ())
    if not bag.has(RAW_TOPIC):
        return {"remarks": remarks}
    times, values = read_raw(bag.reader, f"{bag.prefix}/{RAW_TOPIC}", float(rate), len(channels))
    names = {channel["column"]: str(channel["name"]) for channel in channels}
    events = tuple(
        Event(names[one["column"]], one["kind"], one["start"], one["end"], one["value"])
        for one in info.get("artefacts") or ()
    )
    series = bag.cut(RAW_TOPIC, {"time": times, "raw": values}, tuple(names.values()), "raw")
    units = tuple(str(channel["unit"]) for channel in channels)
    return {"remarks": remarks, "raw": RawEmg(series, units, events)}


def _read_units(bag: _Bag) -> dict[str, Any]:
    topic = "motor_unit_state"
    if not bag.has(topic):
        return {}
    table = bag.table(topic)
    frequency = bag.cut(topic, table, bag.names(topic, table, "unit"), "stimulation_frequency")
    return {"frequency": frequency, "owners": bag.names(topic, table, "muscle")}


def _read_muscles(bag: _Bag) -> dict[str, Any]:
    topic = "muscle_state"
    if not bag.has(topic):
        return {}
    table = bag.table(topic)
    names = bag.names(topic, table)
    found = {field: bag.cut(topic, table, names, field) for field in MUSCLE_FIELDS if field != "torque"}
    owners = names
    joints: tuple[str, ...] = ()
    # In bags of former versions every muscle has one torque.
    if len(table.get("torque_muscle", ())):
        owners, joints = (bag.names(topic, table, f"torque_{of}") for of in ("muscle", "joint"))
    return {"muscles": {**found, "torque": bag.cut(topic, table, owners, "torque")}, "torque_joints": joints}


def _read_joints(bag: _Bag) -> dict[str, Any]:
    series = {}
    if bag.has("joint_torque"):
        table = bag.table("joint_torque")
        series["torque"] = bag.cut("joint_torque", table, bag.names("joint_torque", table, "joint"), "torque")
    if bag.has("joint_states"):
        table = bag.table("joint_states")
        names = bag.names("joint_states", table)
        series["angle"] = bag.cut("joint_states", table, names, "position")
        # JointState may leave velocities out.
        if bag.field("joint_states", table, "velocity").shape[1:] == (len(names),):
            series["velocity"] = bag.cut("joint_states", table, names, "velocity")
    return series


def _read_recorded(path: str | Path, start: float | None, end: float | None) -> Series:
    """The recorded angles of a bag, whose time counts from its first sample on, as that of a run does."""
    with BagReader(path) as reader:
        if not reader.has(ANGLE_TOPIC):
            topics = ", ".join(reader.topics) or "no topic"
            raise FieldError("reference", f"is {path}, which has {topics}; a message on {ANGLE_TOPIC} is needed")
        bag = _Bag(reader, "", start, end)
        bag.offset = float(reader.table(f"{bag.prefix}/{ANGLE_TOPIC}")["time"][0])
        table = bag.table(ANGLE_TOPIC)
        return bag.cut(ANGLE_TOPIC, table, bag.names(ANGLE_TOPIC, table), "position")


def _matched(angles: Series, joints: tuple[str, ...], given: str | Path | None, notes: list[str]) -> Series | None:
    """The recorded angles under the names of the joints they belong to."""
    if len(angles.names) == len(joints) == 1:
        return Series(joints, angles.times, angles.values)
    same = [name for name in angles.names if name in joints]
    if same:
        return Series(tuple(same), angles.times, np.stack([angles.column(name) for name in same], axis=1))
    recorded = ", ".join(angles.names)
    wish = (
        f"the name of a joint ({', '.join(joints)}) is needed, as by `limb emg --angle {angles.names[0]}={joints[0]}`"
    )
    if given is not None:
        raise FieldError("reference", f"is {given}, whose angles are {recorded}; {wish}")
    notes.append(f"the recorded angles {recorded} are not drawn; {wish}")
    return None
