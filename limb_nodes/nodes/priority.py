"""The priority with which the processor serves a node, before all that has none."""

from __future__ import annotations

import os
import resource
from contextlib import suppress
from pathlib import Path

from limb_nodes.errors import UserError

HIGHEST = 99


def take_priority(node: str, priority: int) -> None:
    """Let all threads of this process go first (SCHED_FIFO). Raises UserError if it is not allowed."""
    for thread in Path("/proc/self/task").iterdir():
        # One may have ended meanwhile.
        with suppress(ProcessLookupError):
            try:
                os.sched_setscheduler(int(thread.name), os.SCHED_FIFO, os.sched_param(priority))
            except PermissionError:
                allowed, _ = resource.getrlimit(resource.RLIMIT_RTPRIO)
                raise UserError(
                    f"{node}: the parameter priority is {priority}, and this user is allowed {allowed}; "
                    "a greater rtprio in /etc/security/limits.conf, or priority 0, is needed"
                ) from None
