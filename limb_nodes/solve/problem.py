"""What the integrators work with: the problem, how it is solved, how far the solution is.

All functions of a problem are called by address as f(t, y, inputs, rows, model, data, out): time (s), state
[states], the input's pieces [rows, columns], addresses of the limb's model and data, and the result to be filled in.
"""

from __future__ import annotations

import numpy as np
from numba import carray, from_dtype, types

from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.foundation.records import Record, whole_numbers
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
# pause: time (s) at or behind which the solve pauses, at the end of a step; rest: address of the rates and
# slopes [states + 2, states] that a paused solve goes on with, 0 if it is never to pause.
# jolt: the change of a velocity (rad/s) above which the solve ends behind an impact, 0 if it is never to; struck:
# address of the state [states] before that impact, 0 likewise. watched: whether the solve pauses if its steps become
# small.
# Given and told: next_step: size of the step that comes next (s), chosen by the integrator if 0. paused: whether the
# solve goes on where it paused.
# Told: time: reached (s). rows: how many of the wanted times were reached. error: of the last step over its tolerance;
# last_error: of the one before. steps, rejected: how many. event, joint: what ended the last step, and which joint.
# quiet_until: until then no joint is released (s). tried: steps since it was last judged whether the solve crawls; way:
# how far they would reach (s). sloped: whether a paused solve knows the slopes.
CONTROL = np.dtype(
    [
        *((name, np.float64) for name in ("start", "end", "tolerance", "longest", "pause", "jolt")),
        *((name, np.float64) for name in ("next_step", "time", "error", "last_error", "quiet_until", "way")),
        *((name, np.int64) for name in ("steps", "rejected", "event", "joint", "rest", "paused", "rows", "struck")),
        *((name, np.int64) for name in ("watched", "tried", "sloped")),
    ]
)

problem_type, method_type, control_type = (from_dtype(kind) for kind in (PROBLEM, METHOD, CONTROL))
problem_pointer, method_pointer, control_pointer = (
    types.CPointer(kind) for kind in (problem_type, method_type, control_type)
)


# The types of the arguments of a problem's functions.
FUNCTION = (f8, numbers, numbers, i8, i8, i8, numbers)


# Rows of the array of a step [rows, n] of n states: at its start and its end, and for which the rates are asked;
# their typical sizes; the rates at its start; then rates or increments of the method's stages. An implicit method has
# n + 1 more rows for the slopes, as the problem's jacobian gives them at its start, n + 1 for those at its end, and
# n + 1 for factors.
STATE, NEW_STATE, STAGE_STATE, SCALE, START_RATES, STAGES = 0, 1, 2, 3, 4, 5


@inner
def work_rows(problem, method):
    """How many rows the array of a step has."""
    return STAGES + method.stages + 3 * (problem.states + 1) * method.implicit


@inner
def work_at(pointer, problem, method):
    """The array of a step at a pointer."""
    return carray(pointer, (work_rows(problem, method), problem.states))


@inner
def evaluate(function, t, y, problem, out):
    """Call a function of the problem at time t and state y [states]."""
    invoke(function, t, y, problem.inputs, problem.rows, problem.model, problem.data, out)


@inner
def take_step(t, h, method, work, control, problem):
    """One step of size h by the method's function. work: the array of the step."""
    invoke(method.step, t, h, method, work, control, problem)


def new_problem(states: int, rates: int, model: Record, data: Record) -> Record:
    """A problem without limits; `give_inputs` must follow. The caller keeps the records alive."""
    problem = Record(PROBLEM)
    problem.states[0], problem.rates[0] = states, rates
    problem.model[0], problem.data[0] = model.address, data.address
    return problem


def give_inputs(problem: Record, inputs: FloatArray) -> None:
    """Let a problem read these pieces [rows, columns]; the caller keeps them alive."""
    problem.inputs[0], problem.rows[0] = inputs.ctypes.data, len(inputs)
