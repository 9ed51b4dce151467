"""Nodes as children of this process, each in a process of its own."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from limb_nodes.bags.unclosed import new_part
from limb_nodes.errors import RunError, UserError
from limb_nodes.exchange.recorded import RecordedRun
from limb_nodes.foundation.topics import NODES
from limb_nodes.nodes.base import PARENT, STAY
from limb_nodes.nodes.settings import RunSettings

# How long a node may take to end when asked to (s): a recorder may have much to write.
ENDING = 60.0
ERROR = "limb: error: "
# A child imports from where its parent does: `python -m` and `-c` look in the working folder before all others.
START = (
    "import sys; sys.path[:] = {path!r}; from limb_nodes.edge import as_program; as_program(); "
    "from limb_nodes.nodes.{name} import main; main()"
)
# The order in which nodes are ended: the recorder last.
ENDED = ("activation_input", "limb_dynamics", "muscle_stack", "recorder")


class Crew:
    """The nodes of a run, each in a process of its own.

    recorded: tells the newest tick that is recorded, -1 before the first.
    """

    def __init__(self, settings: RunSettings, recorded: Callable[[], int]) -> None:
        self._settings, self._recorded = settings, recorded
        self.children: dict[str, Child] = {}
        # Tick at which each node was last started anew: one that dies there again would die for ever.
        self._revived: dict[str, int] = {}

    def start(self) -> None:
        """Start the nodes."""
        for name in NODES:
            self.children[name] = Child(self._settings, name)

    def __getitem__(self, name: str) -> Child:
        return self.children[name]

    def stopped(self) -> str:
        """In words, which nodes somebody has stopped."""
        return ", ".join(
            f"{name} (process {child.handle.pid})" for name, child in self.children.items() if child.stopped
        )

    def look(self) -> None:
        """Start anew what was killed, if that is asked for. Raises UserError if a node has failed."""
        for name, child in self.children.items():
            tick = self._recorded()
            if self._settings.respawn and child.killed and self._revived.get(name) != tick:
                self._revived[name] = tick
                print(
                    f"limb: the node {name} {child.how_it_ended()}; it goes on from what is recorded", file=sys.stderr
                )
                self.children[name] = self._revive(name)
            self.children[name].raise_failure()

    def _revive(self, name: str) -> Child:
        """The node anew, which goes on from the bag of the run once something is in it."""
        settings = self._settings
        out = Path(settings.out)
        # On a busy machine the bag may hold ticks of which this process has not heard yet.
        if self._recorded() >= 0 or holds_ticks(out):
            settings = replace(settings, resume=settings.out)
            if name == "recorder":
                return Child(replace(settings, out=str(new_part(out))), name, copies=False)
        elif name == "recorder" and out.exists():
            # In it is at most a copy that was cut short.
            shutil.rmtree(out)
        return Child(settings, name)

    def stop(self) -> None:
        """End all nodes, the recorder last."""
        for name in ENDED:
            if name in self.children:
                self.children[name].end()


def holds_ticks(bag: Path) -> bool:
    """Whether a run could go on from what a bag holds."""
    try:
        return RecordedRun.read(str(bag)).past().complete >= 0
    except UserError:
        return False


class Child:
    """A node in a process of its own. What it says goes on to standard error; its errors are kept."""

    def __init__(self, settings: RunSettings, name: str, copies: bool = True) -> None:
        """copies: whether a recorder copies the bag that it goes on with into its own."""
        self.name = name
        self.said: deque[str] = deque(maxlen=20)
        arguments = ["--ros-args"]
        if settings.namespace:
            arguments += ["-r", f"__ns:=/{settings.namespace.removeprefix('/')}"]
        stays = settings.respawn and name != "recorder"
        own = {} if copies else {"copies": False}
        for key, value in {**settings.parameters(name), **own}.items():
            text = str(value).lower() if isinstance(value, bool) else value
            # Quoted, so that a text such as 'yes' or '1' stays a text.
            given = "'" + str(value).replace("'", "''") + "'" if isinstance(value, str) else text
            arguments += ["-p", f"{key}:={given}"]
        self.handle = subprocess.Popen(
            [sys.executable, "-c", START.format(path=sys.path, name=name), *arguments],
            stderr=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stdin=subprocess.DEVNULL,
            text=True,
            errors="replace",
            # Ctrl-C goes to this process alone, which then ends the others in order.
            start_new_session=True,
            env={**os.environ, PARENT: str(os.getpid()), STAY: "1" if stays else ""},
        )
        # Read all the time: a child whose pipe is full would stand still.
        self.reader = threading.Thread(target=self._read, daemon=True)
        self.reader.start()

    def _read(self) -> None:
        assert self.handle.stderr is not None
        for line in self.handle.stderr:
            self.said.append(line.rstrip("\n"))
            if not line.startswith(ERROR):
                print(line, end="", file=sys.stderr)

    @property
    def status(self) -> int | None:
        """The exit status, None while it runs."""
        return self.handle.poll()

    def end(self) -> None:
        """End it by its own handle."""
        if self.status is None:
            self.handle.terminate()
            # One that somebody has stopped would not hear of it.
            self.handle.send_signal(signal.SIGCONT)
            try:
                self.handle.wait(ENDING)
            except subprocess.TimeoutExpired:
                self.handle.kill()
                self.handle.wait()
        self.reader.join(ENDING)

    @property
    def stopped(self) -> bool:
        """Whether somebody has stopped it, as Ctrl-Z does."""
        with suppress(OSError):
            return Path(f"/proc/{self.handle.pid}/stat").read_text().rpartition(")")[2].split()[0] in "Tt"
        return False

    @property
    def killed(self) -> bool:
        """Whether a signal has ended it."""
        return self.status is not None and self.status < 0

    def how_it_ended(self) -> str:
        """In words, how it ended."""
        assert self.status is not None
        return (
            f"was ended by {signal.Signals(-self.status).name}" if self.killed else f"ended with status {self.status}"
        )

    def raise_failure(self) -> None:
        """Raise UserError with what the node has said if it has failed."""
        if self.status in (None, 0):
            return
        self.reader.join(ENDING)
        lines = [line.removeprefix(ERROR) for line in self.said if line.startswith(ERROR)]
        if lines and self.status == UserError.status:
            raise UserError(lines[-1])
        raise RunError(lines[-1] if lines else f"the node {self.name} {self.how_it_ended()}")
