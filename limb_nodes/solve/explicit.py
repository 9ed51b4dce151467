"""Explicit Runge-Kutta methods whose last stage is the first of the next step, compiled.

Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, II.1 (tableau), II.4 (error
estimate) and II.6 (continuous extension).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import carray

from limb_nodes.solve.inner import inner
from limb_nodes.solve.method import BETWEEN, STEP, Method, judge
from limb_nodes.solve.pointer import callback, numbers_at
from limb_nodes.solve.problem import evaluate, work_at, work_of


class Explicit(NamedTuple):
    """The tableau of a method of s stages; a step from y is y + h (weights of a row) (rates of the stages).

    stages: [s, s], below the diagonal; the last row is the step itself.
    nodes: [s], the time of each stage as a part of the step. error: [s], of the estimated error.
    bend: [s], of the term of fourth order in the continuous extension, which otherwise is the cubic
    through the states and rates of both ends.
    """

    stages: Any
    nodes: Any
    error: Any
    bend: Any


# Dormand and Prince, order 5(4).
DORMAND_PRINCE = Explicit(
    stages=np.array(
        [
            [0, 0, 0, 0, 0, 0, 0],
            [1 / 5, 0, 0, 0, 0, 0, 0],
            [3 / 40, 9 / 40, 0, 0, 0, 0, 0],
            [44 / 45, -56 / 15, 32 / 9, 0, 0, 0, 0],
            [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729, 0, 0, 0],
            [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656, 0, 0],
            [35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84, 0],
        ]
    ),
    nodes=np.array([0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1, 1]),
    error=np.array([71 / 57600, 0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40]),
    bend=np.array(
        [
            -12715105075 / 11282082432,
            0,
            87487479700 / 32700410799,
            -10690763975 / 1880347072,
            701980252875 / 199316789632,
            -1453857185 / 822651844,
            69997945 / 29380423,
        ]
    ),
)


@inner
def tableau_of(method):
    """The tableau of a method."""
    s = method.stages
    rows = carray(numbers_at(method.tableau), (s + 3, s))
    return Explicit(rows[:s], rows[s], rows[s + 1], rows[s + 2])


@inner
def combine(weights, stages, count, i):
    """Sum over the first `count` stages of weight times rate of state i."""
    total = weights[0] * stages[0, i]
    for stage in range(1, count):
        total += weights[stage] * stages[stage, i]
    return total


@callback(*STEP)
def step(t, h, method_, work_, control_, problem_):
    """One step of size h; the first stage holds the rates at t, the last then those at t + h."""
    method, problem = carray(method_, 1)[0], carray(problem_, 1)[0]
    n, tableau = problem.states, tableau_of(method)
    work = work_of(work_at(work_, problem, method), problem, method)
    for i in range(n):
        work.stages[0, i] = work.start_rates[i]
    # The second stage is a part of a step by Euler's method.
    for i in range(n):
        work.stage_state[i] = work.state[i] + h * tableau.nodes[1] * work.start_rates[i]
    evaluate(problem.rates, t + tableau.nodes[1] * h, work.stage_state, problem, work.stages[1])
    for stage in range(2, method.stages):
        state = work.stage_state if stage < method.stages - 1 else work.new_state
        for i in range(n):
            state[i] = work.state[i] + h * combine(tableau.stages[stage], work.stages, stage, i)
        evaluate(problem.rates, t + tableau.nodes[stage] * h, state, problem, work.stages[stage])
    # The rates have been asked for: their place is free.
    errors = work.stage_state
    for i in range(n):
        errors[i] = h * combine(tableau.error, work.stages, method.stages, i)
    judge(errors, work, carray(control_, 1)[0])


@callback(*BETWEEN)
def between(t, h, count, times_, out_, method_, work_, problem_):
    """States at times from t to t + h, of fourth order."""
    method, problem = carray(method_, 1)[0], carray(problem_, 1)[0]
    n, tableau = problem.states, tableau_of(method)
    work = work_of(work_at(work_, problem, method), problem, method)
    times, out = carray(times_, (count,)), carray(out_, (count, n))
    last = method.stages - 1
    for i in range(n):
        difference = work.new_state[i] - work.state[i]
        bend = h * work.stages[0, i] - difference
        twist = difference - h * work.stages[last, i] - bend
        fourth = h * combine(tableau.bend, work.stages, method.stages, i)
        for row in range(count):
            part = min(1.0, (times[row] - t) / h)
            rest = 1.0 - part
            out[row, i] = work.state[i] + part * (difference + rest * (bend + part * (twist + rest * fourth)))


EXPLICIT = Method(step, between, np.vstack(DORMAND_PRINCE), len(DORMAND_PRINCE.nodes), implicit=False)
