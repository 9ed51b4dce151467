"""The solve of a whole limb over an input, piece by piece: what it takes of memory does not grow with the duration."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np

from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.foundation.records import Record
from limb_nodes.solve.explicit import EXPLICIT
from limb_nodes.solve.failure import FAILURES, SolveError, where
from limb_nodes.solve.implicit import IMPLICIT
from limb_nodes.solve.integrate import CRAWLING, DONE, PAUSED, integrate
from limb_nodes.solve.method import Method
from limb_nodes.solve.pieces import REACH, corners, pieces
from limb_nodes.solve.problem import CONTROL, give_inputs

if TYPE_CHECKING:
    from limb_nodes.solve.whole import WholeModel

LONGEST_STEP = 0.1
METHODS = {"explicit": EXPLICIT, "implicit": IMPLICIT}


class Input(Protocol):
    """Samples [T, inputs] of an input: an array, or what computes a stretch of them when it is asked for."""

    def __len__(self) -> int: ...

    def __getitem__(self, rows: slice, /) -> FloatArray: ...


class Stretch(NamedTuple):
    """A part of a movement that is to be solved.

    times: s [T], rising, at which the states are wanted. inputs: pieces of the drives [rows, 4 drives].
    stops: times (s) of their corners. period: of a piece (s). first: the number of the first piece, 0 from 0 s on.
    """

    times: FloatArray
    inputs: FloatArray
    stops: FloatArray
    period: float
    first: int = 0


class Course:
    """A solve from 0 s to `end` (s), with pieces of the input every `period` s.

    state: [states] where it stands. rows: how many wanted times it has passed. failure: why it cannot go further.
    tolerance, method: as for `WholeModel.simulate`. may_change: whether an explicit method gives way to the implicit
        one if its steps are small; always so with the method "auto".
    """

    def __init__(
        self, model: WholeModel, end: float, period: float, tolerance: float, method: str, may_change: bool = False
    ) -> None:
        self.model = model
        self.state = model.initial_state()
        self.rows = 0
        self.failure: SolveError | None = None
        self._data = model.new_data(period)
        self._rest = np.empty((self.state.size + 2, self.state.size))
        self._control = Record(CONTROL)
        self._choose(METHODS[model.suited_method if method == "auto" else method])
        self._control.watched[0] = not self._chosen.implicit and (may_change or method == "auto")
        self._control.end[0], self._control.rest[0] = end, self._rest.ctypes.data
        self._control.tolerance[0], self._control.longest[0] = tolerance, LONGEST_STEP

    def _choose(self, method: Method) -> None:
        self._chosen = method
        self._method = method.limited if self.model.limited else method.free
        self._problem = self.model.problem(self._data, jacobian=method.implicit)

    @property
    def time(self) -> float:
        """How far the solve is (s)."""
        return float(self._control.time[0])

    @property
    def steps(self) -> tuple[int, int]:
        """Accepted and rejected steps so far."""
        return int(self._control.steps[0]), int(self._control.rejected[0])

    def advance(self, stretch: Stretch, pause: float = math.inf) -> FloatArray:
        """Go on to the end of the step that reaches `pause` (s); the states [rows, states] at the times passed.

        stretch: its inputs and stops reach one longest step further than `pause`.
        """
        out = np.empty((len(stretch.times), self.state.size))
        self._data.first[0] = stretch.first
        self._control.pause[0] = pause
        reached, status = 0, CRAWLING
        while status == CRAWLING:
            give_inputs(self._problem, stretch.inputs)
            records = self._method.address, self._problem.address, self._control.address
            times, rows = stretch.times[reached:], out[reached:]
            status = integrate(*records, stretch.stops, self.model.state_scale, self.state, times, rows)
            reached += int(self._control.rows[0])
            if status == CRAWLING:
                self._choose(IMPLICIT)
                self._control.watched[0] = 0
        if status not in (DONE, PAUSED):
            part = where(self.model, status, self.time, self.state, stretch.inputs, self._data)
            text = f"the solution stops at {self.time:.6g} s: {FAILURES[status]}{part}"
            self.failure = SolveError(f"{self.model.limb.file}: {text}")
        self.rows += reached
        return out[:reached]


def stretches(
    drives: Callable[[int, int], FloatArray], count: int, period: float, rows: int, course: Course
) -> Iterator[tuple[Stretch, float]]:
    """The parts of a movement for `Course.advance`, each with the time (s) of its pause, as the course goes on.

    drives: gives the samples [T, drives] from one number to before another, of `count`. rows: of a part, or so.
    """
    ahead = math.ceil(LONGEST_STEP / period) + 1
    while course.rows < count and course.failure is None:
        first = max(0, int(course.time / period) - 1)
        last = min(course.rows + max(rows, ahead), count) - 1
        end = min(last + ahead + 1, count)
        start, stop = max(0, first - REACH), min(count, end + 1 + REACH)
        times = np.arange(course.rows, end, dtype=np.float64) * period
        yield stretch_of(drives(start, stop), start, times, period, first, end), last * period


def stretch_of(samples: FloatArray, start: int, times: FloatArray, period: float, first: int, end: int) -> Stretch:
    """The part of a movement with the pieces from one number to another of an input's, which are those of the whole.

    samples: of the drives [T, drives], from number `start` on; `REACH` more on both sides, if there are so many.
    A step of high order must not cross a corner: it would not notice.
    """
    sharp = corners(samples)
    rows = np.unique(np.flatnonzero(sharp) // max(1, samples.shape[1])) + start
    stops = rows[(rows >= first) & (rows <= end)].astype(np.float64) * period
    return Stretch(times, pieces(samples, sharp)[first - start : end - start + 1], stops, period, first)
