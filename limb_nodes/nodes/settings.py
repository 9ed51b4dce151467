"""What to run, checked before anything is written, and how a run went."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from limb_nodes.bags.folder import refuse_existing
from limb_nodes.bags.read import BagReader
from limb_nodes.errors import FieldError, UserError
from limb_nodes.exchange.identity import new_identity
from limb_nodes.exchange.recorded import RecordedRun
from limb_nodes.exchange.ticks import Ticks
from limb_nodes.exchange.watch import STALL, STALL_LIMIT
from limb_nodes.foundation.topics import NODES, STATES
from limb_nodes.model import load_limb
from limb_nodes.nodes.live_readers import reader
from limb_nodes.nodes.live_settings import HEARD, LiveSettings
from limb_nodes.nodes.running import check_namespace
from limb_nodes.signals.activation import load_activation
from limb_nodes.solve.delay import refuse_long_delays
from limb_nodes.solve.ranges import OUT_OF_RANGE

# Longest run (s).
LONGEST = 1e9

Progress = Callable[[int], None]


@dataclass(frozen=True)
class RunSettings:
    """What to run. limb: YAML file. source: of activations, empty for live input. rate: Hz.

    duration: s, 0 for the whole source. out: folder of the bag. namespace: of all nodes. states: topics of states to
    record, every `state_every` ticks. command: that started the run, for the record. live: how a live source is taken.
    identity: of the run. allow_laws: whether the code of the limb's own laws may run although it is not trusted.
    resume: bag of the run that this one goes on with, empty for a new one. stall_limit: end the run if no tick has come
    for so long (s). respawn: start nodes that are killed anew.
    """

    limb: str
    source: str
    rate: float
    duration: float
    out: str
    mode: str = "lockstep"
    namespace: str = ""
    states: tuple[str, ...] = STATES
    state_every: int = 1
    command: str = ""
    live: LiveSettings = field(default_factory=LiveSettings)
    identity: str = field(default_factory=new_identity)
    allow_laws: bool = False
    resume: str = ""
    stall_limit: float = STALL_LIMIT
    respawn: bool = False

    def parameters(self, node: str) -> dict[str, Any]:
        """The ROS parameters of a node."""
        common = {
            "limb": self.limb,
            "allow_laws": self.allow_laws,
            "mode": self.mode,
            "rate": self.rate,
            "identity": self.identity,
            "resume": self.resume,
            "stall_limit": self.stall_limit,
        }
        own: dict[str, dict[str, Any]] = {
            "activation_input": {"source": self.source, "duration": self.duration, **asdict(self.live)},
            "muscle_stack": {
                "state_every": self.state_every,
                **{f"publish_{topic}": topic in self.states for topic in STATES},
            },
            "limb_dynamics": {"await_recorder": True},
            "recorder": {"out": self.out, "command": self.command},
        }
        return {**common, **own[node]}


@dataclass(frozen=True)
class Outcome:
    """How a run went. ticks: that the limb has made; missing: ticks not in the bag, over all topics;
    missed: deadlines in real time; bad_input: messages that could not be used; foreign: messages of others; conflicts:
    ticks that came twice with different values; seconds: wall time. live: how a live source did, in words, empty
    without one; lost: whether it never came, or was silent at the end. ranges: by length, how far muscles were out
    of their range, in words. work: which muscles do other work than their torque, in words, empty if none does.
    """

    ticks: int
    missing: int
    missed: int
    bad_input: int
    foreign: int
    conflicts: int
    seconds: float
    interrupted: bool
    live: str = ""
    lost: bool = False
    ranges: Mapping[str, str] = field(default_factory=dict)
    work: str = ""


def checked(settings: RunSettings) -> tuple[RunSettings, int | None]:
    """Check a run before anything is written; the settings with absolute paths, and the last tick if it has one.

    Raises FieldError, or UserError for what is wrong in a file.
    """
    limb = load_limb(settings.limb, settings.allow_laws)
    Ticks(settings.rate)
    check_namespace(settings.namespace)
    refuse_existing(Path(settings.out))
    STALL.check(settings.stall_limit)
    tick = 1 / settings.rate
    if settings.duration and not tick <= settings.duration <= LONGEST:
        raise FieldError(
            "duration",
            f"is {settings.duration:g}; a number from {tick:g}, one tick, to {LONGEST:g} in s is needed",
        )
    final = round(settings.duration * settings.rate) if settings.duration else None
    source = settings.source
    if source:
        activation = load_activation(source, limb.muscle_names, settings.rate, settings.duration or None)
        final = len(activation.values) - 1
        refuse_long_delays(limb, activation.duration)
        source = str(Path(source).resolve()) if Path(source).exists() else source
        for name, value in asdict(settings.live).items():
            if value != getattr(LiveSettings(), name):
                raise FieldError(name, f"is {value}; a live source is needed, not {settings.source}")
    elif settings.mode == "lockstep":
        raise FieldError("source", "is missing; in lockstep a bag, CSV, waveform YAML or constants are needed")
    else:
        reader(limb.muscle_names, settings.live)
    if settings.resume and final is not None and RecordedRun.read(settings.resume).past().complete >= final:
        raise UserError(f"{settings.resume}: is complete; the bag of a run that was cut short is needed")
    resume = str(Path(settings.resume).resolve()) if settings.resume else ""
    limb_file, out = str(Path(settings.limb).resolve()), str(Path(settings.out).resolve())
    return replace(settings, limb=limb_file, out=out, source=source, resume=resume), final


def recorded_outcome(settings: RunSettings, seconds: float, interrupted: bool, work: str) -> Outcome:
    """Count what the bag of a run holds. work: as in `Outcome`."""
    with BagReader(settings.out) as bag:
        ticks = bag.count("joint_states")
        missing = 0
        for topic in ("activation", "joint_torque", "movement_pattern", *settings.states):
            every = settings.state_every if topic in settings.states else 1
            missing += max(0, -(-ticks // every) - bag.count(topic))
        counted = {"seconds": seconds, "interrupted": interrupted, "work": work}
        return Outcome(ticks, missing, **counted, **reported(bag, settings))


def reported(bag: BagReader, settings: RunSettings) -> dict[str, Any]:
    """What the nodes have told on `/diagnostics`, as fields of an `Outcome`."""
    counts = {key: dict.fromkeys(NODES, 0) for key in ("missed_deadlines", "bad_input", "foreign", "conflicts")}
    ranges: dict[str, str] = {}
    live, lost = ("nothing is known of the live source", True) if not settings.source else ("", False)
    names = {f"/{settings.namespace.strip('/')}/{node}".replace("//", "/"): node for node in NODES}
    messages = bag.read_topic("/diagnostics") if bag.has("/diagnostics") else ()
    for status in (status for _, message in messages for status in message.status):
        values = {pair.key: pair.value for pair in status.values}
        if status.name not in names or values.get("run") != settings.identity:
            continue  # anybody may write on this topic
        node = names[status.name]
        for key, of_node in counts.items():
            told = values.get(key, "0")
            of_node[node] = max(of_node[node], int(told) if re.fullmatch("[0-9]{1,18}", told) else 0)
        ranges |= {k.removeprefix(OUT_OF_RANGE): text for k, text in values.items() if k.startswith(OUT_OF_RANGE)}
        if "input" in values:
            live, lost = status.message, values["input"] != HEARD
    sums = {key: sum(of_node.values()) for key, of_node in counts.items()}
    return {"missed": sums.pop("missed_deadlines"), **sums, "live": live, "lost": lost, "ranges": ranges}
