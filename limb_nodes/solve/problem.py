"""What the integrators work with: the problem, how it is solved, how far the solution is.

All functions of a problem are called by address as f(t, y, inputs, rows, model, data, out): time (s), state
[states], the input's pieces [rows, columns], the limb's model and data, and the result, which the function fills in.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import carray, from_dtype, types

from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.foundation.records import Record, new_record, whole_numbers
from limb_nodes.solve.inner import inner
from limb_nodes.solve.pointer import f8, i8, invoke, numbers

# states: how many. rates, jacobian, reactions, strike: addresses of functions, 0 if there is none: the rates of the
# states; their slopes, rows [states + 1, states], with each state and then with time; the torques of the limits at the
# state of the last call of `rates`; what an impact does to the state.
# inputs, rows, model, data: what they are given. joints: the first so many states are angles, the next as many their
# velocities, and they have limits; 0 if there are none. limits: address of the lowest, then the highest angles.
# locked: address of a flag for each joint, as in `data`.
PROBLEM = whole_numbers(
    "states",
    "rates",
    "jacobian",
    "reactions",
    "strike",
    "inputs",
    "rows",
    "model",
    "data",
    "joints",
    "limits",
    "locked",
)

# Addresses of the functions of a method (`limb_nodes.solve.method`) and of those that look for events
# (`limb_nodes.solve.limits`). tableau: of the method's coefficients; stages: how many it has. implicit: 1 if it needs
# the slopes of the rates.
METHOD = whole_numbers("step", "between", "tableau", "stages", "implicit", "settle", "find_event", "take_effect")

# Given: start, end: s. tolerance: of a step's error, relative to a state's size. longest: greatest step (s).
# Given and told: next_step: size of the step that comes next (s), chosen by the integrator if 0.
# Told: time: reached (s). error: of the last step over its tolerance. steps, rejected: how many. event, joint:
# what ended the last step, and which joint. quiet_until: until then no joint is released (s).
CONTROL = np.dtype(
    [
        *((name, np.float64) for name in ("start", "end", "tolerance", "longest")),
        *((name, np.float64) for name in ("next_step", "time", "error", "quiet_until")),
        *((name, np.int64) for name in ("steps", "rejected", "event", "joint")),
    ]
)

problem_type, method_type, control_type = (from_dtype(kind) for kind in (PROBLEM, METHOD, CONTROL))
problem_pointer, method_pointer, control_pointer = (
    types.CPointer(kind) for kind in (problem_type, method_type, control_type)
)


class Work(NamedTuple):
    """The arrays of a step of n states, views of one array.

    state, new_state: [n], at its start and its end. stage_state: [n], for which the rates are asked.
    scale: [n], typical sizes. start_rates: [n], at its start. stages: [stages, n], rates or increments.
    slopes: [n + 1, n], as the problem's jacobian gives them at its start; matrix: [n, n] and pivots: [n], factors
    that are made of them; these three only of an implicit method.
    """

    state: Any
    new_state: Any
    stage_state: Any
    scale: Any
    start_rates: Any
    stages: Any
    slopes: Any
    matrix: Any
    pivots: Any


@inner
def work_rows(problem, method):
    """How many rows of n states the array of `Work` has."""
    return 5 + method.stages + (2 * problem.states + 2) * method.implicit


@inner
def work_of(rows, problem, method):
    """The parts of an array of `work_rows`."""
    n, slopes = problem.states, 5 + method.stages
    matrix = slopes + n + 1
    return Work(
        rows[0],
        rows[1],
        rows[2],
        rows[3],
        rows[4],
        rows[5:slopes],
        rows[slopes:matrix],
        rows[matrix : matrix + n],
        rows[matrix + n * method.implicit],
    )


@inner
def work_at(pointer, problem, method):
    """The array of `Work` at a pointer."""
    return carray(pointer, (work_rows(problem, method), problem.states))


@inner
def evaluate(function, t, y, problem, out):
    """Call a function of the problem at time t and state y [states]."""
    invoke(function, t, y, problem.inputs, problem.rows, problem.model, problem.data, out)


@inner
def take_step(t, h, method, work, control, problem):
    """One step of size h by the method's function. work: the array of `Work`."""
    invoke(method.step, t, h, method, work, control, problem)


def arguments_of(model: Any, data: Any) -> tuple[Any, ...]:
    """The numba types of the arguments of a problem's functions, for records of these types."""
    return f8, numbers, numbers, i8, types.CPointer(model), types.CPointer(data), numbers


def new_problem(states: int, rates: int, model: Record, data: Record) -> Record:
    """A problem without limits; `give_inputs` must follow. The caller keeps the records alive."""
    problem = new_record(PROBLEM)
    problem.states, problem.rates = states, rates
    problem.model, problem.data = address_of(model), address_of(data)
    return problem


def give_inputs(problem: Record, inputs: FloatArray) -> None:
    """Let a problem read these pieces [rows, columns]; the caller keeps them alive."""
    problem.inputs, problem.rows = inputs.ctypes.data, len(inputs)


def address_of(record: Record) -> int:
    """Where the numbers of a record are."""
    return int(np.frombuffer(record, np.uint8).ctypes.data)
