"""Nodes as children of this process, each in a process of its own."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Mapping

from limb_nodes.errors import UserError
from limb_nodes.nodes.base import PARENT
from limb_nodes.nodes.settings import RunSettings

# How long a node may take to end when asked to (s): a recorder may have much to write.
ENDING = 60.0
ERROR = "limb: error: "


class Child:
    """A node in a process of its own. What it says goes on to standard error; its errors are kept."""

    def __init__(self, settings: RunSettings, name: str) -> None:
        self.name = name
        self.said: deque[str] = deque(maxlen=20)
        arguments = ["--ros-args"]
        if settings.namespace:
            arguments += ["-r", f"__ns:=/{settings.namespace.removeprefix('/')}"]
        for key, value in settings.parameters(name).items():
            text = str(value).lower() if isinstance(value, bool) else value
            # Quoted, so that a text such as 'yes' or '1' stays a text.
            given = "'" + str(value).replace("'", "''") + "'" if isinstance(value, str) else text
            arguments += ["-p", f"{key}:={given}"]
        self.handle = subprocess.Popen(
            [sys.executable, "-m", f"limb_nodes.nodes.{name}", *arguments],
            stderr=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stdin=subprocess.DEVNULL,
            text=True,
            errors="replace",
            # Ctrl-C goes to this process alone, which then ends the others in order.
            start_new_session=True,
            env={**os.environ, PARENT: str(os.getpid())},
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
            try:
                self.handle.wait(ENDING)
            except subprocess.TimeoutExpired:
                self.handle.kill()
                self.handle.wait()
        self.reader.join(ENDING)

    def raise_failure(self) -> None:
        """Raise UserError with what the node has said if it has failed."""
        if self.status in (None, 0):
            return
        self.reader.join(ENDING)
        lines = [line.removeprefix(ERROR) for line in self.said if line.startswith(ERROR)]
        raise UserError(lines[-1] if lines else f"the node {self.name} ended with status {self.status}")


def stop(children: Mapping[str, Child]) -> None:
    """End all nodes, the recorder last."""
    for name in ("activation_input", "limb_dynamics", "muscle_stack", "recorder"):
        if name in children:
            children[name].end()
