"""The edge of the program: whatever goes wrong in a command or a node ends in one line and an exit status."""

from __future__ import annotations

import errno
import os
import re
import resource
import sys
import threading
import traceback
import warnings
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout, suppress
from pathlib import Path
from typing import Any

from limb_nodes.errors import RunError, UserError, clean, escaped, shortened, shown

# The variable that shows tracebacks.
DEBUG = "LIMB_DEBUG"
# The status of a fault of the program itself, as EX_SOFTWARE of sysexits.h.
FAULT = 70
INTERRUPTED = 130
# Address space for the libraries and four nodes (bytes), and what threads of OpenBLAS take on each processor.
_MEMORY = 2**31
_MEMORY_OF_PROCESSOR = 2**26
_PACKAGE = Path(__file__).parent
_FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO}
_SHORT = {errno.ENOMEM, errno.EAGAIN, errno.EMFILE, errno.ENFILE}
_NEEDED = "more memory, processes or files are needed than the system allows (see ulimit -a)"
_SHORT_WORDS = re.compile(
    "cannot allocate memory|start new thread|failed to map segment|too many open files", re.IGNORECASE
)
# The place in the source of ROS, which its errors end with.
_ROS_PLACE = re.compile(r",? at /\S+:\d+")


def check_limits() -> int:
    """Return 0. Raises UserError if the system gives so little memory that OpenBLAS would wait for more for ever."""
    needed = _MEMORY + _MEMORY_OF_PROCESSOR * (os.cpu_count() or 1)
    for name, kind in (("ulimit -v", resource.RLIMIT_AS), ("ulimit -d", resource.RLIMIT_DATA)):
        limit = resource.getrlimit(kind)[0]
        if limit != resource.RLIM_INFINITY and limit < needed:
            raise UserError(f"{name} is {limit // 1024}; unlimited, or at least {needed // 1024} in kB, is needed")
    return 0


def guarded(work: Callable[[], int], line: Callable[[UserError], str] = str) -> int:
    """Do the work of a command or a node; its exit status, which is that of the process.

    What goes wrong is told in one line on standard error. With LIMB_DEBUG set, the traceback stands before it, unless
    the user's mistake is all there is to tell.

    line: of an error, if it is not its text.
    """
    _fill_descriptors()
    sys.stdout, sys.stderr = sys.stdout or _nowhere(), sys.stderr or _nowhere()
    hooks = threading.excepthook, sys.unraisablehook, warnings.formatwarning
    warnings.formatwarning = format_warning
    threading.excepthook = lambda given: _say(*told(given.exc_value or MemoryError()))
    sys.unraisablehook = lambda given: _say(*told(given.exc_value or MemoryError()))
    try:
        with redirect_stdout(_Printable(sys.stdout)), redirect_stderr(_Forgiving(sys.stderr)):
            try:
                status = _status_of(check_limits, line) or _status_of(work, line)
            finally:
                # What waits until Python itself ends could be told by Python alone.
                written = _status_of(_flushed, str)
            return status or written
    finally:
        threading.excepthook, sys.unraisablehook, warnings.formatwarning = hooks


def _status_of(work: Callable[[], int], line: Callable[[UserError], str]) -> int:
    try:
        return work()
    except UserError as error:
        return _say(line(error), error.status)
    except KeyboardInterrupt:
        print("limb: interrupted", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        # The reader of a pipe has gone, as in `limb ... | head`.
        return 0
    except Exception as error:
        return _say(*told(error))


def excepthook(kind: type[BaseException], error: BaseException, trace: Any) -> None:
    """For `sys.excepthook`: end with one line and the exit status for what a program raises while it is imported."""

    def work() -> int:
        raise error

    raise SystemExit(_status_of(work, str))


def as_program() -> None:
    """Tell whatever goes wrong while the rest of a program is imported in one line.

    Raises UserError for limits of the system that are too narrow.
    """
    sys.excepthook, warnings.formatwarning = excepthook, format_warning
    check_limits()


def format_warning(message: Warning | str, *_: Any, **__: Any) -> str:
    """A line for a warning of a library, for `warnings.formatwarning`: the first of its own, without its place."""
    return f"limb: warning: {clean(next(iter(str(message).splitlines()), ''))}\n"


def told(error: BaseException) -> tuple[str, int]:
    """The line for an exception that nobody turned into a UserError, and the exit status."""
    if os.environ.get(DEBUG):
        traceback.print_exception(error)
    if isinstance(error, UserError):
        return str(error), error.status
    text = str(error) or type(error).__name__
    if isinstance(error, MemoryError) or getattr(error, "errno", None) in _SHORT or _SHORT_WORDS.search(text):
        return f"{text}; {_NEEDED}", 1
    if isinstance(error, OSError):
        name = "" if error.filename is None else f"{shortened(os.fsdecode(error.filename))}: "
        return f"{name}{error.strerror or text}", 1 if error.errno in _FULL else 2
    if isinstance(error, UnicodeError):
        return f"{shown(repr(getattr(error, 'object', text)))} cannot be written as UTF-8; a text in UTF-8 is needed", 2
    if isinstance(error, ImportError):
        return f"{text}; a complete installation is needed", 2
    if type(error).__module__.split(".")[0] == "rclpy":
        return f"ROS 2: {_ROS_PLACE.sub('', text)}", 2
    frames = traceback.extract_tb(error.__traceback__)
    own = [frame for frame in frames if _PACKAGE in Path(frame.filename).parents]
    if own and any(frame.name == "<module>" for frame in frames[frames.index(own[-1]) + 1 :]):
        return f"a library cannot be loaded: {text}; it, or what the environment sets for it, is to be put right", 2
    where = f" ({Path(own[-1].filename).relative_to(_PACKAGE)}:{own[-1].lineno})" if own else ""
    return f"a fault of limb: {type(error).__name__}: {text}{where}; please report it, with what {DEBUG}=1 shows", FAULT


def _say(text: str, status: int) -> int:
    print(f"limb: error: {clean(text)}", file=sys.stderr)
    return status


def _fill_descriptors() -> None:
    """Open what of 0, 1 and 2 is closed: the next file to be opened, perhaps a bag, would get what is printed."""
    while (number := os.open(os.devnull, os.O_RDWR)) <= 2:
        os.set_inheritable(number, True)
    os.close(number)


def _nowhere() -> Any:
    return open(os.devnull, "w")


def _flushed() -> int:
    sys.stdout.flush()
    return 0


class _Printable:
    """Standard output without control characters, and with what its encoding lacks as escapes.

    What cannot be written raises RunError, or BrokenPipeError; then nothing more is.
    """

    _KEPT = "\n\t"

    def __init__(self, stream: Any) -> None:
        self._stream = stream

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        """Write a text; its length."""
        shown = escaped(text, self._KEPT)
        if not shown.isascii() and self.encoding:
            shown = shown.encode(self.encoding, "backslashreplace").decode(self.encoding)
        self._try(lambda: self._stream.write(shown))
        return len(text)

    def flush(self) -> None:
        """Pass on what is waiting."""
        self._try(self._stream.flush)

    def _try(self, act: Callable[[], object]) -> None:
        try:
            act()
        except OSError as problem:
            # What is waiting in it would fail again when Python ends.
            with suppress(OSError, ValueError):
                null = os.open(os.devnull, os.O_WRONLY)
                os.dup2(null, self._stream.fileno())
                os.close(null)
            self._fail(problem)

    def _fail(self, problem: OSError) -> None:
        if isinstance(problem, BrokenPipeError):
            raise problem
        raise RunError(f"standard output cannot be written: {problem.strerror or problem}") from None


class _Forgiving(_Printable):
    """Standard error: if it takes nothing any more, nothing is said, and the work goes on."""

    _KEPT = "\n\t\r"

    def _fail(self, problem: OSError) -> None:
        pass
