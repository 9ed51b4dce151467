"""A run in one process without ROS: the parts of the real nodes, their messages carried by a scheduler with a seed.

Time is simulated. As with a reliable transport each pair of publisher and subscriber has its messages in order, and who
comes late gets the newest ones that the publisher keeps; across pairs any order may come. What a schedule holds against
that are faults.
"""

from __future__ import annotations

import functools
import heapq
import itertools
import math
import random
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from functools import partial
from typing import Any
from unittest.mock import patch

import numpy as np

from limb_nodes.errors import UserError
from limb_nodes.exchange import movement, muscles
from limb_nodes.exchange import part as part_module
from limb_nodes.exchange import past as past_module
from limb_nodes.exchange import stream as stream_module
from limb_nodes.exchange.activations import ActivationPart
from limb_nodes.exchange.identity import bytes_of
from limb_nodes.exchange.movement import LimbPart
from limb_nodes.exchange.muscles import MusclePart
from limb_nodes.exchange.part import Part
from limb_nodes.exchange.past import Past, expected_topics, past_of
from limb_nodes.exchange.recording import RecordingPart
from limb_nodes.exchange.ticks import Ticks
from limb_nodes.exchange.watch import LOOK_PERIOD, Watch
from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.foundation.topics import NODES, RECORDED
from limb_nodes.model import Limb
from limb_nodes.solve import stepping
from tests.faults.forged import FORGERS, of_run

IDENTITY = "5eed" * 8
PROGRESS = "recorded"
# As in the nodes (s): how often the recorder empties its topics, how long it may keep from the disk what it wrote,
# how long that takes at most, how often the parent looks at its children, and how long a node that has finished stays.
POLL, FLUSH, FLUSHING, TURN, LINGER = 0.005, 0.2, 0.02, 0.05, 5.0
# How long the first tick may take unsaid, of a node alone and of one with a parent, who gives up then; how much later
# than its children a parent gives up waiting, and after which time it says that it waits (s).
START, STARTING, SLACK, SOON = 10.0, 300.0, 5.0, 3.0
# Who looks after the nodes: nobody, a parent that ends the run with any of them, or one that starts them anew.
ALONE, PARENT, RESPAWN = "alone", "parent", "respawn"
# Longest standstill without a word (s).
SILENCE = 5.0


@dataclass(frozen=True)
class Setting:
    """What is run. activations: [ticks, muscles]."""

    limb: Limb
    activations: FloatArray
    ticks: Ticks = field(default_factory=lambda: Ticks(1000.0))

    @property
    def final(self) -> int:
        """The last tick."""
        return len(self.activations) - 1


@dataclass(frozen=True)
class Fault:
    """What goes wrong. where: a node, or a topic. reader: who does not get the message as it was sent.

    at: the number of the message among those of the topic to the reader, or how many messages have been taken in all.
    seconds: how late a message is, or when a node goes on or is started anew; None: never. what: kind of a stranger's
    message.
    """

    kind: str
    where: str
    at: int
    reader: str = ""
    seconds: float | None = None
    what: str = ""


@dataclass(frozen=True)
class Schedule:
    """The faults of a run. mode: who looks after the nodes. limit: of waiting (s).

    lag: how many ticks the limb may be ahead of the recorder; topics keep twice as many. state_every: of states.
    """

    seed: int
    faults: tuple[Fault, ...] = ()
    mode: str = PARENT
    state_every: int = 1
    limit: float = 5.0
    lag: int = stream_module.RECORDER_LAG


@contextmanager
def shared(lag: int = stream_module.RECORDER_LAG) -> Iterator[None]:
    """Let parts of one limb share what none of them changes, and be at most `lag` ticks apart."""
    with ExitStack() as stack:
        stack.enter_context(patch.object(stepping, "WholeModel", model_of))
        stack.enter_context(patch.object(part_module, "forms_of", forms_once))
        stack.enter_context(patch.object(movement, "RECORDER_LAG", lag))
        stack.enter_context(patch.object(stream_module, "HISTORY", 2 * lag))
        for module in movement, muscles, past_module:
            stack.enter_context(patch.object(module, "CHECKPOINT", lag // 2))
        yield


def once_for_each(make: Callable[..., Any]) -> Callable[..., Any]:
    """The same result for the same object and numbers; equal limbs are too long to compare."""
    made: dict[tuple[Any, ...], tuple[Limb, Any]] = {}

    @functools.wraps(make)
    def known(limb: Limb, *numbers: float) -> Any:
        key = (id(limb), *numbers)
        if key not in made:
            made[key] = limb, make(limb, *numbers)
        return made[key][1]

    return known


model_of = once_for_each(stepping.WholeModel)
forms_once = once_for_each(part_module.forms_of)


# Topic, tick, message, and when it was written (s).
Written = tuple[str, int, bytes, float]


class Publisher:
    """A node's messages of a topic. kept: the newest, for who comes late. links: to who is there."""

    def __init__(self, owner: Process, topic: str) -> None:
        self.owner, self.topic = owner, topic
        self.kept: deque[Any] = deque(maxlen=1 if topic == PROGRESS else stream_module.HISTORY)
        self.links: list[Link] = []

    def publish(self, data: Any) -> None:
        self.kept.append(data)
        self.owner.run.newest[self.topic] = data
        for link in self.links:
            link.send(data)


class Link:
    """The way from a publisher to one subscriber. under_way: messages that have not been taken."""

    def __init__(self, run: Run, publisher: Publisher, reader: Process) -> None:
        self.run, self.topic, self.reader = run, publisher.topic, reader
        self.under_way = 0
        self._cut = False
        self._free = 0.0
        publisher.links.append(self)
        for data in publisher.kept:
            self.send(data)

    def cut(self) -> None:
        """Lose what is under way."""
        self._cut = True

    def send(self, data: Any) -> None:
        kind, seconds = self.run.fate(self.topic, self.reader.name)
        if kind == "drop":
            return
        arrival = max(self._free, self.run.now + self.run.delay())
        if kind == "reorder":
            # Those after it do not wait for it.
            arrival += seconds
        else:
            arrival += seconds if kind == "delay" else 0.0
            self._free = arrival
        self._carry(arrival, data)
        if kind == "duplicate":
            self._carry(arrival + seconds, data)

    def _carry(self, arrival: float, data: Any) -> None:
        self.under_way += 1
        self.run.at(arrival, partial(self._arrive, data))

    def _arrive(self, data: Any) -> None:
        if self._cut or not self.reader.alive:
            self.under_way -= 1
        else:
            self.reader.do(partial(self._taken, data))

    def _taken(self, data: Any) -> None:
        self.under_way -= 1
        self.reader.take(self.topic, data)


class Process:
    """A node's process: it handles one message after the other, may be stopped, and ends in one of several ways.

    status: None while it is alive, then as a process has it. told: whether it has said that it does not go on.
    """

    takes: tuple[str, ...] = ()

    def __init__(self, run: Run, name: str, part: Part) -> None:
        self.run, self.name, self.part = run, name, part
        self.status: int | None = None
        self.failure = ""
        self.stopped = False
        self.finished_at: float | None = None
        self._waiting: deque[Callable[[], None]] = deque()
        self._done: int | None = None
        self.told = False
        self.watch = Watch(run.schedule.limit, START if run.schedule.mode == ALONE else math.inf)
        part.complain = lambda what: run.say(name, what, still=False)
        self.publishers = {topic: Publisher(self, topic) for topic in part.outgoing}
        for topic, messages in part.outgoing.items():
            messages.send = self.publishers[topic].publish
        self.readable = (*part.streams, *self.takes)

    @property
    def alive(self) -> bool:
        return self.status is None

    @property
    def waits(self) -> bool:
        """Whether it takes part in a run that has begun."""
        return self.alive and not self.stopped and self.finished_at is None and self.part.done > 0

    def begin(self) -> None:
        """What it does once it is there."""
        self.run.after(self.run.random.uniform(0.0, LOOK_PERIOD), self._look)
        if isinstance(self.part, LimbPart):
            self.do(self.part.begin)

    def do(self, what: Callable[[], None]) -> None:
        """Do something, if it is alive, and when it is not stopped; what cannot be done ends the process."""
        if self.stopped:
            self._waiting.append(what)
        if self.stopped or not self.alive:
            return
        try:
            what()
        except UserError as error:
            self.fail(str(error))
        except Exception as error:
            self.run.tracebacks.append(f"{self.name}: {error!r}")
            self.fail("Traceback")
        self.look_done()
        if self.part.finished and self.finished_at is None:
            self.finished_at = self.run.now
            # Whoever is started anew may need what it has sent.
            if self.run.schedule.mode != RESPAWN or self.name == "recorder":
                self._leave()

    def look_done(self) -> None:
        """Notice whether it has gone on."""
        if self.part.done != self._done:
            self._done, self.told = self.part.done, False
            self.run.progress()

    def take(self, topic: str, data: Any) -> None:
        """Take a message that has arrived."""
        self.run.taken()
        self.part.receive(topic, data)

    def _look(self) -> None:
        if not self.alive:
            return
        self.run.after(LOOK_PERIOD, self._look)
        if self.stopped or self.finished_at is not None:
            return
        if said := self.watch.look(self.run.now, self.part.done, self.part.awaited()):
            self.run.say(self.name, said)
            self.told = True
        if self.watch.given_up:
            self.fail(f"has waited {self.watch.waited:.0f} s for {self.part.awaited()}")

    def _leave(self) -> None:
        """End once all that it has sent is taken, or after a while."""
        links = [link for publisher in self.publishers.values() for link in publisher.links if link.reader.alive]
        if not self.alive:
            return
        if self.run.now - self.finished_at < LINGER and any(link.under_way for link in links):
            self.run.after(TURN, self._leave)
        else:
            self.end(0)

    def fail(self, why: str) -> None:
        if self.alive:
            self.failure = why
            self.run.say(self.name, why)
            self.end(1)

    def end(self, status: int) -> None:
        """Be gone."""
        if self.alive:
            self.status = status
            self.run.left(self)

    def kill(self) -> None:
        """kill -9: what it has sent may be lost or not."""
        if self.alive:
            for publisher in self.publishers.values():
                for link in publisher.links:
                    if self.run.random.random() < 0.5:
                        link.cut()
            self.end(-9)

    def stop(self) -> None:
        self.stopped = True
        self.run.look_around()

    def go_on(self) -> None:
        self.run.look_around()
        self.stopped = False
        waiting, self._waiting = self._waiting, deque()
        for what in waiting:
            self.do(what)

    def terminate(self) -> None:
        """End as the parent asks for it, which lets those go on that are stopped."""
        self.go_on()
        self.end(0)


class LimbProcess(Process):
    part: LimbPart
    takes = (PROGRESS,)

    def take(self, topic: str, data: Any) -> None:
        if topic != PROGRESS:
            super().take(topic, data)
            return
        self.run.taken()
        identity, tick = data
        if identity == self.part.identity:
            self.part.on_recorded(tick)


class RecorderProcess(Process):
    """disk: what it has written; safe: how many of these a kill cannot take away. resume: bag that it goes on from."""

    part: RecordingPart

    def __init__(self, *given: Any) -> None:
        super().__init__(*given)
        self.publishers[PROGRESS] = Publisher(self, PROGRESS)
        self.disk: list[Written] = []
        self.safe = 0
        self.announced = -2
        self.resume = ""
        self.lost = 0.0
        self.opened = self._flushing = self._polls = False
        self._come: dict[str, list[bytes]] = {topic: [] for topic in RECORDED}

    def begin(self) -> None:
        super().begin()
        self.run.after(self.run.random.uniform(0.0, POLL), partial(self.do, self._open))

    def take(self, topic: str, data: Any) -> None:
        self.run.taken()
        self._come[topic].append(data)
        self._poll_soon()

    def _poll_soon(self) -> None:
        if self.opened and not self._polls:
            self._polls = True
            self.run.after(self.run.random.uniform(0.0, POLL), partial(self.do, self._poll))

    def _open(self) -> None:
        self.opened = self.part.ready = True
        self.part.expect_states({"state_every": self.run.schedule.state_every})
        if self.resume:
            last = self.part.complete
            found = self.run.files[self.resume]
            self.disk += [one for one in found if one[0] in self.part.expected and one[1] <= last]
            self.safe = len(self.disk)
        self.run.files["bag"] = self
        if self.resume:
            self.run.files.pop("short", None)
        self._poll()

    def _poll(self) -> None:
        self._polls = False
        part, before = self.part, len(self.disk)
        for topic, data in self._come.items():
            for stamp, message in part.drain(topic, data):
                self.disk.append((topic, stamp // part.ticks.nanoseconds, message, self.run.now))
            data.clear()
        if len(self.disk) > before:
            self.run.after(FLUSH, partial(self._flushed, len(self.disk), None))
        part.finished = 0 <= part.last_tick <= part.complete
        step = max(1, self.run.schedule.lag // 4) if self.announced >= 0 else 1
        if not self._flushing and part.complete >= self.announced + step:
            self._flushing = True
            done = partial(self._flushed, len(self.disk), part.complete)
            self.run.after(self.run.random.uniform(0.0, FLUSHING), done)

    def _flushed(self, count: int, tick: int | None) -> None:
        """So many messages are on the disk; tick: to be announced."""
        if self.alive:
            self.safe = max(self.safe, count)
        if tick is not None:
            self.do(partial(self._announce, tick))

    def _announce(self, tick: int) -> None:
        self._flushing, self.announced = False, tick
        self.publishers[PROGRESS].publish((self.part.identity, tick))
        self.run.after(self.run.delay(), partial(setattr, self.run, "recorded", tick))
        self._poll_soon()

    def end(self, status: int) -> None:
        if self.alive and status == -9:
            gone = self.disk[self.safe :]
            self.lost = self.run.now - gone[0][3] if gone else 0.0
            del self.disk[self.safe :]
        elif self.alive:
            if self.opened and not status:
                self._poll()
            self.safe = len(self.disk)
        super().end(status)

    def __iter__(self) -> Iterator[Written]:
        """What somebody else finds on the disk."""
        return iter(self.disk[: self.safe])


KINDS = dict(zip(NODES, (Process, Process, LimbProcess, RecorderProcess), strict=True))


class Run:
    """A run under a schedule.

    now: simulated time (s). words: when, by whom and what was said. silent: longest standstill before a word (s);
    said: longest time from a standstill to a word. tracebacks: errors that nobody has turned into a line.
    """

    def __init__(self, setting: Setting, schedule: Schedule) -> None:
        self.setting, self.schedule = setting, schedule
        self.random = random.Random(f"delays {schedule.seed}")
        self.now = 0.0
        self.words: list[tuple[float, str, str]] = []
        self.tracebacks: list[str] = []
        self.silent, self.said = 0.0, None
        self.processes: dict[str, Process] = {}
        self.gone: list[Process] = []
        self._events: list[tuple[float, int, Callable[[], None]]] = []
        self._order = itertools.count()
        self._moved, self._word = 0.0, False
        # The bags that are there; who is to come; what the parent has heard; when it started whom anew.
        self.files: dict[str, RecorderProcess] = {}
        self.recorded = -1
        self.ended = self.gave_up = False
        self._coming: set[str] = set()
        self._revived: dict[str, int] = {}
        limit = schedule.limit + SLACK
        self._watch, self._stops = Watch(limit, math.inf, SOON), Watch(limit, math.inf, SOON)
        self._taken = 0
        self.newest: dict[str, Any] = {}
        self._sent: dict[tuple[str, str], int] = {}
        self._fates = {(one.where, one.reader, one.at): one for one in schedule.faults if one.reader}
        self._acts = sorted((one for one in schedule.faults if not one.reader), key=lambda one: one.at)

    @property
    def unsaid(self) -> float:
        """How long the first tick may take unsaid (s)."""
        return START if self.schedule.mode == ALONE else STARTING

    def go(self) -> Run:
        """Run to the end."""
        with shared(self.schedule.lag):
            for name in NODES:
                self.after(self.random.uniform(0.0, 0.05), partial(self.start, name))
            if self.schedule.mode != ALONE:
                self.after(LOOK_PERIOD, self._look)
            last = self.unsaid + 3.0 * self.schedule.limit + sum(one.seconds or 0.0 for one in self._acts) + 20.0
            while self._events and self.now < last:
                if len(self.processes) == len(NODES) and not any(self.acting()):
                    break
                self.now, _, action = heapq.heappop(self._events)
                action()
        self._note_silence()
        return self

    def _look(self) -> None:
        """Say if nothing is recorded, and give up at last, as a parent does."""
        if self.ended:
            return
        self.after(LOOK_PERIOD, self._look)
        stopped = ", ".join(name for name, process in self.processes.items() if process.alive and process.stopped)
        for watch, done, awaited in (self._watch, self.recorded, "a tick"), (self._stops, 1, stopped):
            if said := watch.look(self.now, done, awaited):
                self.say("limb run", said)
        if self._watch.given_up or self._stops.given_up or (self.recorded < 1 and self.now > STARTING):
            self.say("limb run", "no tick has been recorded")
            self.gave_up = True
            self.end_all()

    def acting(self) -> Iterator[bool]:
        """Of each process whether anything is to be expected of it."""
        for name, process in self.processes.items():
            yield (process.alive and not process.stopped) or name in self._coming

    def start(self, name: str, resume: str = "") -> None:
        """Start a node's process; resume: the bag that it goes on from."""
        self.look_around()
        part = self.part_of(name)
        found = list(self.files.get(resume, ()))
        if resume:
            part.take_up(self.past(found))
        process = self.processes[name] = KINDS[name](self, name, part)
        if isinstance(process, RecorderProcess):
            process.resume = resume
        if resume and not found:
            process.fail(f"{resume}: is no bag of a run")
            return
        for other in self.processes.values():
            if other.alive:
                self._meet(process, other)
                if other is not process:
                    self._meet(other, process)
        process.begin()

    def part_of(self, name: str) -> Part:
        """The part of a node."""
        setting = self.setting
        common = {"limb": setting.limb, "ticks": setting.ticks, "identity": IDENTITY}
        if name == "activation_input":
            return ActivationPart(**common, values_at=lambda tick: setting.activations[tick], final=setting.final)
        if name == "muscle_stack":
            return MusclePart(**common, state_every=self.schedule.state_every)
        if name == "limb_dynamics":
            return LimbPart(**common, awaits_recorder=True)
        return RecordingPart(**common)

    def past(self, found: Iterable[Written]) -> Past:
        """What is needed to go on with what is in a bag."""
        every = expected_topics({"state_every": self.schedule.state_every})
        return past_of(((topic, data) for topic, _, data, _ in found), every, self.setting.ticks.nanoseconds)

    def _meet(self, writer: Process, reader: Process) -> None:
        """Let a reader and a writer find each other."""
        for topic, publisher in writer.publishers.items():
            if topic in reader.readable:
                link = partial(writer.do, partial(Link, self, publisher, reader))
                self.after(self.random.uniform(0.001, 0.02), link)

    def at(self, time: float, action: Callable[[], None]) -> None:
        heapq.heappush(self._events, (time, next(self._order), action))

    def after(self, seconds: float, action: Callable[[], None]) -> None:
        self.at(self.now + seconds, action)

    def delay(self) -> float:
        """How long a message takes (s): mostly little."""
        return self.random.expovariate(1.0 / 2e-4)

    def fate(self, topic: str, reader: str) -> tuple[str, float]:
        """What becomes of the next message of a topic to a reader."""
        number = self._sent.get((topic, reader), 0)
        self._sent[topic, reader] = number + 1
        fault = self._fates.get((topic, reader, number))
        return (fault.kind, fault.seconds or 0.0) if fault else ("", 0.0)

    def taken(self) -> None:
        """Count a message that is taken; faults come in between."""
        self._taken += 1
        while self._acts and self._acts[0].at <= self._taken:
            self.after(0.0, partial(self._strike, self._acts.pop(0)))

    def _strike(self, fault: Fault) -> None:
        if fault.kind == "stranger":
            self._intrude(fault)
            return
        process = self.processes.get(fault.where)
        if process is None or not process.alive or process.stopped:
            return
        if fault.kind == "stop":
            process.stop()
            again = process.go_on
        else:
            process.kill()
            again = partial(self.start, fault.where)
            if self.schedule.mode != ALONE:
                self._coming.add(fault.where)
                self.after(TURN, partial(self._look_after, fault))
                return
        if fault.seconds is not None:
            self._come_again(fault.where, fault.seconds, again)

    def _come_again(self, name: str, seconds: float, again: Callable[[], None]) -> None:
        """Let a node come again after a while, unless the run has ended by then."""

        def come() -> None:
            self._coming.discard(name)
            if not self.ended:
                again()

        self._coming.add(name)
        self.after(seconds, come)

    def _look_after(self, fault: Fault) -> None:
        """What a parent does when a child was killed."""
        name = fault.where
        self._coming.discard(name)
        self.say("limb run", f"the node {name} was ended by SIGKILL")
        if self.schedule.mode == PARENT or self._revived.get(name) == self.recorded:
            self.end_all()
            return
        self._revived[name] = self.recorded
        if name == "recorder" and "bag" in self.files:
            bag = self.files.pop("bag")
            if "short" not in self.files and self.recorded >= 0:
                self.files["short"] = bag
        whole = "short" if "short" in self.files else "bag" if self.recorded >= 0 else ""
        self._come_again(name, fault.seconds or 0.0, partial(self.start, name, whole))

    def _intrude(self, fault: Fault) -> None:
        """Send a stranger's messages to all who listen."""
        messages = self.forged(fault)
        for process in self.processes.values():
            for data in messages if fault.where in process.readable else ():
                self.after(self.delay(), partial(process.do, partial(process.take, fault.where, data)))

    def forged(self, fault: Fault) -> list[Any]:
        """The messages of a stranger."""
        if fault.where == PROGRESS:
            return [(IDENTITY, int(fault.what))]
        form = forms_once(self.setting.limb, self.setting.ticks.rate)[fault.where]
        data = self.newest.get(fault.where, of_run(form, form.data, bytes_of(IDENTITY)))
        return FORGERS[fault.what](form, data, self.setting.ticks.nanoseconds)

    def say(self, who: str, what: str, still: bool = True) -> None:
        """Somebody says something that a person can read; still: that the run does not go on."""
        self.words.append((self.now, who, what))
        if still and not self._word:
            self._note_silence()
            self._word = True
            self.said = max(self.said or 0.0, self.now - self._moved)

    def progress(self) -> None:
        """Somebody has gone on."""
        self._note_silence()
        self._moved, self._word = self.now, False

    def look_around(self) -> None:
        """If nobody is there who could say anything, nothing is to be said until somebody is.

        A parent speaks for those who are stopped; of nodes that were started by hand nobody does.
        """
        deaf = self.schedule.mode == ALONE
        if not any(one.alive and not (deaf and one.stopped) for one in self.processes.values()):
            self.progress()
            self._word = True

    def _note_silence(self) -> None:
        if not self._word and not any(process.told and process.alive for process in self.processes.values()):
            allowed = 0.0 if any(process.waits for process in self.processes.values()) else self.unsaid
            self.silent = max(self.silent, self.now - self._moved - allowed)

    def left(self, process: Process) -> None:
        """A process is gone; its parent notices."""
        self.gone.append(process)
        self.look_around()
        if self.schedule.mode != ALONE and process.status != -9 and (process.status or process.name == "recorder"):
            self.after(TURN, self.end_all)

    def end_all(self) -> None:
        """End all nodes, the recorder last."""
        self.ended = True
        for name in ("activation_input", "limb_dynamics", "muscle_stack", "recorder"):
            if name in self.processes and self.processes[name].alive:
                self.processes[name].terminate()

    @property
    def everyone(self) -> list[Process]:
        """All processes that have been."""
        return [*self.gone, *(process for process in self.processes.values() if process.alive)]

    @property
    def bags(self) -> list[RecorderProcess]:
        """The recorders that have been, with what each has on its disk."""
        return [process for process in self.everyone if isinstance(process, RecorderProcess)]


def waves(ticks: int, muscles: int) -> FloatArray:
    """Activations [ticks, muscles] that differ from tick to tick."""
    phase = np.arange(ticks)[:, np.newaxis] * 0.15 + np.arange(muscles)
    return 0.5 + 0.45 * np.sin(phase)


def recorded(process: RecorderProcess) -> dict[tuple[str, int], bytes]:
    """What a recorder has on its disk, by topic and tick."""
    return {(topic, tick): data for topic, tick, data, _ in process.disk}
