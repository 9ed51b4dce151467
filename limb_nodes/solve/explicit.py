"""Explicit Runge-Kutta methods whose last stage is the first of the next step, compiled.

Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, II.1 (tableau), II.4 (error
estimate) and II.6 (continuous extension).
"""

from __future__ import annotations

import numpy as np
from numba import carray

from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.solve.inner import inner
from limb_nodes.solve.method import BETWEEN, STEP, Method, judge
from limb_nodes.solve.pointer import callback, numbers_at
from limb_nodes.solve.problem import (
    NEW_STATE,
    STAGE_STATE,
    STAGES,
    START_RATES,
    STATE,
    evaluate,
    work_at,
)

# Rows of the tableau [3 + s, s] of a method of s stages: the time of each stage as a part of the step; the weights of
# the estimated error; those of the term of fourth order in the continuous extension, which otherwise is the cubic
# through the states and rates of both ends; then for each stage the weights of the rates of those before it, the last
# of which are the step itself. A step from y is y + h (weights of a row) (rates of the stages).
NODES, ERROR, BEND, WEIGHTS = 0, 1, 2, 3

# Dormand and Prince, order 5(4).
DORMAND_PRINCE: FloatArray = np.array(
    [
        [0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1, 1],
        [71 / 57600, 0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40],
        [
            -12715105075 / 11282082432,
            0,
            87487479700 / 32700410799,
            -10690763975 / 1880347072,
            701980252875 / 199316789632,
            -1453857185 / 822651844,
            69997945 / 29380423,
        ],
        [0, 0, 0, 0, 0, 0, 0],
        [1 / 5, 0, 0, 0, 0, 0, 0],
        [3 / 40, 9 / 40, 0, 0, 0, 0, 0],
        [44 / 45, -56 / 15, 32 / 9, 0, 0, 0, 0],
        [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729, 0, 0, 0],
        [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656, 0, 0],
        [35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84, 0],
    ]
)


@inner
def combine(tableau, row, work, count, i):
    """Sum over the first `count` stages of a row's weights times the rates of state i."""
    total = tableau[row, 0] * work[STAGES, i]
    for stage in range(1, count):
        total += tableau[row, stage] * work[STAGES + stage, i]
    return total


@callback(*STEP)
def step(t, h, method_, work_, control_, problem_):
    """One step of size h; the first stage holds the rates at t, the last then those at t + h."""
    method, problem = carray(method_, 1)[0], carray(problem_, 1)[0]
    n, stages, work = problem.states, method.stages, work_at(work_, problem, method)
    tableau = carray(numbers_at(method.tableau), (WEIGHTS + stages, stages))
    # The second stage is a part of a step by Euler's method.
    for i in range(n):
        work[STAGES, i] = work[START_RATES, i]
        work[STAGE_STATE, i] = work[STATE, i] + h * tableau[NODES, 1] * work[START_RATES, i]
    evaluate(problem.rates, t + tableau[NODES, 1] * h, work[STAGE_STATE], problem, work[STAGES + 1])
    for stage in range(2, stages):
        state = STAGE_STATE if stage < stages - 1 else NEW_STATE
        for i in range(n):
            work[state, i] = work[STATE, i] + h * combine(tableau, WEIGHTS + stage, work, stage, i)
        evaluate(problem.rates, t + tableau[NODES, stage] * h, work[state], problem, work[STAGES + stage])
    # The rates have been asked for: their place is free.
    for i in range(n):
        work[STAGE_STATE, i] = h * combine(tableau, ERROR, work, stages, i)
    judge(work[STAGE_STATE], work, carray(control_, 1)[0])


@callback(*BETWEEN)
def between(t, h, count, times_, out_, method_, work_, problem_):
    """States at times from t to t + h, of fourth order."""
    method, problem = carray(method_, 1)[0], carray(problem_, 1)[0]
    n, stages, work = problem.states, method.stages, work_at(work_, problem, method)
    tableau = carray(numbers_at(method.tableau), (WEIGHTS + stages, stages))
    times, out = carray(times_, (count,)), carray(out_, (count, n))
    for i in range(n):
        start = work[STATE, i]
        difference = work[NEW_STATE, i] - start
        bend = h * work[STAGES, i] - difference
        twist = difference - h * work[STAGES + stages - 1, i] - bend
        fourth = h * combine(tableau, BEND, work, stages, i)
        for row in range(count):
            part = min(1.0, (times[row] - t) / h)
            rest = 1.0 - part
            out[row, i] = start + part * (difference + rest * (bend + part * (twist + rest * fourth)))


EXPLICIT = Method(step, between, DORMAND_PRINCE, DORMAND_PRINCE.shape[1], implicit=False)
