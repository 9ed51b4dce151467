"""Many samples of one limb: other numbers, the same input, solved in threads or on a cluster."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from itertools import islice
from threading import Lock
from typing import Any, TypeVar
from uuid import uuid4

import numpy as np

from limb_nodes.errors import FieldError, UserError
from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.model.limb import Limb
from limb_nodes.model.load import build_limb
from limb_nodes.model.user_code import UserCode
from limb_nodes.solve.course import METHODS, Stretch, stretch_of
from limb_nodes.solve.delay import delayed, delays_of, refuse_long_delays
from limb_nodes.solve.variants import Values, Variants
from limb_nodes.solve.whole import TOLERANCE, Movement, WholeModel

Samples = Iterable[Values] | Mapping[str, FloatArray]
Task = TypeVar("Task")
Started = TypeVar("Started")
# Samples or chunks that are under way or wait to be taken, per thread: they bound the memory.
AHEAD = 4
# Samples that travel to a worker of a cluster at once.
CHUNK = 20


@dataclass(frozen=True)
class Solution:
    """The movement of one sample at T instants, n joints.

    time: s [T]. angle, velocity: rad, rad/s [T, n]. internal: internal states [T, states].
    steps: accepted and rejected steps of the integrator.
    """

    time: FloatArray
    angle: FloatArray
    velocity: FloatArray
    internal: FloatArray
    steps: tuple[int, int]


@dataclass(frozen=True)
class Order:
    """What is done with every sample, as plain data that can travel."""

    content: dict[str, Any]
    file: str
    text: str
    excitation: FloatArray
    rate: float
    times: FloatArray | None
    function: Callable[[Movement], Any] | None
    tolerance: float
    method: str
    code: UserCode

    def limb(self) -> Limb:
        """The limb of all samples."""
        return build_limb(self.content, self.file, self.text, self.code)


class SampleSolver:
    """Solves samples one by one; its methods may be called from several threads."""

    def __init__(self, order: Order, limb: Limb) -> None:
        self.order = order
        self.variants = Variants(limb)
        self.period = 1.0 / order.rate
        asked = np.arange(len(order.excitation)) * self.period if order.times is None else order.times
        # The solution starts with the input, whether its start is asked for or not.
        self.early = bool(asked[0] > 0.0)
        self.times: FloatArray = np.concatenate([[0.0], asked]) if self.early else np.ascontiguousarray(asked)
        self.stretch = self.prepared(self.variants.base)
        # One method for all: to find how stiff a limb is takes a part of the time of solving it.
        self.method = self.variants.base.suited_method if order.method == "auto" else order.method

    def prepared(self, model: WholeModel) -> Stretch:
        """The whole input, and the times that are asked for."""
        given, limb = self.order.excitation, model.limb
        refuse_long_delays(limb, (len(given) - 1) * self.period)
        drives = model.drives(delayed(given, delays_of(limb, self.order.rate), 0, len(given)))
        return stretch_of(drives, 0, self.times, self.period, 0, len(drives))

    def solve(self, values: Values) -> Any:
        """What is asked of a sample, or the exception that kept it from being solved."""
        try:
            model = self.variants.model(values)
            order = self.order
            if order.function is not None:
                return order.function(
                    model.simulate(order.excitation, order.rate, tolerance=order.tolerance, method=self.method)
                )
            same = self.variants.same_drives(model)
            stretch = self.stretch if same else self.prepared(model)
            states, steps = model.solve(stretch, order.tolerance, self.method, order.method == "auto")
            n, first = model.layout.joints, int(self.early)
            kept = states[first:]
            return Solution(self.times[first:], kept[:, :n], kept[:, n : 2 * n], kept[:, 2 * n :], steps)
        except Exception as problem:
            return problem


class Ensemble:
    """Many samples of one limb: other numbers, the same input.

    limb: the limb of all samples. excitation: [T, muscles], sampled at `rate` Hz from t = 0, of all samples.
    tolerance, method: as for `WholeModel.simulate`; "auto" chooses for the limb itself, and all samples follow.
    Raises UserError if no sample can be solved with these.
    """

    def __init__(
        self, limb: Limb, excitation: FloatArray, rate: float, *, tolerance: float = TOLERANCE, method: str = "auto"
    ) -> None:
        self.limb, self.rate, self.tolerance, self.method = limb, rate, tolerance, method
        self.excitation = np.ascontiguousarray(excitation, dtype=np.float64)
        muscles = len(limb.muscles)
        if self.excitation.ndim != 2 or len(self.excitation) < 2 or self.excitation.shape[1] != muscles:
            shape = self.excitation.shape
            raise FieldError("excitation", f"has the shape {shape}; [two or more, {muscles}] is needed", limb.file)
        if not rate > 0.0:
            raise FieldError("rate", f"is {rate:g}; a number > 0 in Hz is needed", limb.file)
        refuse_long_delays(limb, (len(self.excitation) - 1) / rate)
        if method != "auto" and method not in METHODS:
            raise FieldError("method", f"is {method!r}; auto or {' or '.join(METHODS)} is needed", limb.file)

    def solve(
        self,
        samples: Samples,
        *,
        times: FloatArray | None = None,
        function: Callable[[Movement], Any] | None = None,
        threads: int | None = None,
        client: Any = None,
        ordered: bool = True,
    ) -> Iterator[tuple[int, Any]]:
        """Solve the limb with the numbers of each sample; yields (index of the sample, result).

        samples: one mapping of places to values each, as for `with_values`, from any iterable, which is
            read as results are taken; or one mapping of places to arrays [N].
        times: s, rising, within the input, at which a `Solution` is given; default: every input sample.
        function: called with the `Movement` of a sample, all outputs filled in; its result then takes
            the place of the `Solution`. On a cluster it must be picklable.
        threads: default: one per core of this process. client: a `dask.distributed.Client`, whose
            workers then do the work; they need this package. The limb's own laws go to them.
        ordered: whether results come in the order of the samples or as they are there.

        A sample that cannot be built or solved, or whose `function` raises, gives its exception as its
        result and leaves the others alone. Few samples are under way at a time, whatever their number.

        The numbers of a sample are checked against the ranges that their parameters declare, and a
        muscle's lengths against its joint; curves of laws are examined for the limb itself alone,
        unless a sample changes more than single numbers.
        """
        limb = self.limb
        if threads is not None and threads < 1:
            raise FieldError("threads", f"is {threads}; an integer >= 1 is needed", limb.file)
        asked = None if times is None else self._within(times)
        if asked is not None and function is not None:
            raise FieldError("times", "is given, and function too; a function gets every input sample", limb.file)
        order = Order(
            limb.content,
            limb.file,
            limb.text,
            self.excitation,
            self.rate,
            asked,
            function,
            self.tolerance,
            self.method,
            limb.code,
        )
        numbered = enumerate(one_by_one(limb, samples))
        if client is not None:
            return on_cluster(client, order, numbered, ordered)
        return in_threads(SampleSolver(order, limb).solve, numbered, threads or cores(), ordered)

    def _within(self, times: FloatArray) -> FloatArray:
        """Times (s) that the input covers."""
        end = (len(self.excitation) - 1) / self.rate
        given = np.array(times, dtype=np.float64)
        rising = given.ndim == 1 and given.size > 0 and bool((np.diff(given) > 0.0).all())
        if not (rising and given[0] >= 0.0 and given[-1] <= end * (1.0 + 1e-12)):
            raise FieldError(
                "times", f"leave the input; times that rise from 0 to {end:g} s are needed", self.limb.file
            )
        return given


def one_by_one(limb: Limb, samples: Samples) -> Iterator[Values]:
    """Samples as mappings of places to values."""
    if not isinstance(samples, Mapping):
        yield from samples
        return
    columns = {place: np.asarray(column) for place, column in samples.items()}
    if len({column.shape[:1] for column in columns.values()}) > 1 or any(c.ndim == 0 for c in columns.values()):
        lengths = ", ".join(f"{place} {column.shape}" for place, column in columns.items())
        raise UserError(f"{limb.file}: arrays of samples differ in length: {lengths}")
    for row in zip(*columns.values(), strict=True):
        yield {place: value.tolist() for place, value in zip(columns, row, strict=True)}


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0))


def in_threads(
    work: Callable[[Values], Any], numbered: Iterable[tuple[int, Values]], threads: int, ordered: bool
) -> Iterator[tuple[int, Any]]:
    """Results of samples from this process's threads."""
    with ThreadPoolExecutor(threads) as pool:

        def begin(task: tuple[int, Values]) -> Future[tuple[int, Any]]:
            return pool.submit(lambda: (task[0], work(task[1])))

        def first(running: deque[Future[tuple[int, Any]]]) -> Future[tuple[int, Any]]:
            return next(iter(wait(running, return_when=FIRST_COMPLETED).done))

        try:
            for future in flow(numbered, begin, AHEAD * threads, None if ordered else first):
                yield future.result()
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


def flow(
    tasks: Iterable[Task],
    begin: Callable[[Task], Started],
    ahead: int,
    first: Callable[[deque[Started]], Started] | None,
) -> Iterator[Started]:
    """Begin tasks, at most `ahead` before the one that is taken next.

    first: picks the next of those that run; None takes them in their order.
    """
    source = iter(tasks)
    running: deque[Started] = deque()
    while True:
        running.extend(begin(task) for task in islice(source, ahead - len(running)))
        if not running:
            return
        chosen = running[0] if first is None else first(running)
        running.remove(chosen)
        yield chosen


class Workshop:
    """The solvers that a worker of a cluster keeps from chunk to chunk, by the token of their order."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._lock = Lock()
        self._solvers: dict[str, SampleSolver] = {}

    def solver(self, token: str, order: Order) -> SampleSolver:
        """That of an order, built if it is not there; the oldest gives way."""
        with self._lock:
            if token not in self._solvers:
                while len(self._solvers) >= self._most:
                    del self._solvers[next(iter(self._solvers))]
                self._solvers[token] = SampleSolver(order, order.limb())
            return self._solvers[token]


WORKSHOP = Workshop(4)


def solve_chunk(token: str, order: Order, chunk: list[tuple[int, Values]]) -> list[tuple[int, Any]]:
    """What a worker of a cluster does."""
    try:
        solver = WORKSHOP.solver(token, order)
    except Exception as problem:
        return [(index, problem) for index, _ in chunk]
    return [(index, solver.solve(values)) for index, values in chunk]


def on_cluster(
    client: Any, order: Order, numbered: Iterable[tuple[int, Values]], ordered: bool
) -> Iterator[tuple[int, Any]]:
    """Results of samples from the workers of a Dask cluster."""
    from distributed import wait as wait_for

    token = uuid4().hex
    [shared] = client.scatter([order], broadcast=True, hash=False)
    tasks = iter(numbered)
    chunks = iter(lambda: list(islice(tasks, CHUNK)), [])
    indices: dict[str, list[int]] = {}

    def begin(chunk: list[tuple[int, Values]]) -> Any:
        future = client.submit(solve_chunk, token, shared, chunk, pure=False)
        indices[future.key] = [index for index, _ in chunk]
        return future

    def first(running: deque[Any]) -> Any:
        return next(iter(wait_for(list(running), return_when="FIRST_COMPLETED").done))

    running = sum(client.nthreads().values()) or 1
    for future in flow(chunks, begin, AHEAD * running, None if ordered else first):
        numbers = indices.pop(future.key)
        try:
            results = future.result()
        except Exception as problem:
            # A worker that died, say: the others go on.
            results = [(index, problem) for index in numbers]
        future.release()
        yield from results
