"""Stiffly accurate Rosenbrock methods, compiled.

Hairer and Wanner, Solving Ordinary Differential Equations II, IV.7: increments u with
(I / (h gamma) - slopes) u_i = f(t + nodes_i h, y + sum of weights_ij u_j) + sum of couplings_ij u_j / h
+ times_i h df/dt. An L-stable one lets fast decaying motion not limit the step.
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

# Rows of the tableau [4 + 2 s, s] of a method of s stages, whose last increment is the estimated error: the time of
# each stage as a part of the step; the weights of the slopes in time; those of the increments in the continuous
# extension, of second and third order; then for each stage its weights, which give its state, and for each stage the
# couplings between the increments, 1 / gamma on the diagonal. The step is the last stage and its increment.
NODES, TIMES, BEND, TWIST, WEIGHTS = 0, 1, 2, 3, 4

# RODAS, order 4(3), L-stable: IV.10 and its code.
RODAS: FloatArray = np.array(
    [
        [0, 0.386, 0.21, 0.63, 1, 1],
        [0.25, -0.1043, 0.1035, -0.03620000000000023, 0, 0],
        [10.12623508344586, -7.487995877610167, -34.80091861555747, -7.992771707568823, 1.025137723295662, 0],
        [-0.6762803392801253, 6.087714651680015, 16.43084320892478, 24.76722511418386, -6.594389125716872, 0],
        [0, 0, 0, 0, 0, 0],
        [1.544, 0, 0, 0, 0, 0],
        [0.9466785280815826, 0.2557011698983284, 0, 0, 0, 0],
        [3.314825187068521, 2.896124015972201, 0.9986419139977817, 0, 0, 0],
        [1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950, 0, 0],
        [1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950, 1, 0],
        [4, 0, 0, 0, 0, 0],
        [-5.6688, 4, 0, 0, 0, 0],
        [-2.430093356833875, -0.2063599157091915, 4, 0, 0, 0],
        [-0.1073529058151375, -9.594562251023355, -20.47028614809616, 4, 0, 0],
        [7.496443313967647, -10.24680431464352, -33.99990352819905, 11.70890893206160, 4, 0],
        [8.083246795921522, -7.981132988064893, -31.52159432874371, 16.31930543123136, -6.058818238834054, 4],
    ]
)


@inner
def factor(diagonal, slopes, matrix, pivots):
    """LU factors of (diagonal I - slopes), with partial pivoting; slopes as the problem's jacobian gives them."""
    n = pivots.size
    for i in range(n):
        for j in range(n):
            matrix[i, j] = -slopes[j, i]
        matrix[i, i] += diagonal
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(matrix[i, k]) > abs(matrix[best, k]):
                best = i
        pivots[k] = best
        if best != k:
            for j in range(n):
                matrix[k, j], matrix[best, j] = matrix[best, j], matrix[k, j]
        for i in range(k + 1, n):
            if matrix[i, k] != 0.0:
                matrix[i, k] /= matrix[k, k]
                for j in range(k + 1, n):
                    matrix[i, j] -= matrix[i, k] * matrix[k, j]


@inner
def solve(matrix, pivots, right):
    """Solve with the factors, in place."""
    n = right.size
    for k in range(n):
        other = int(pivots[k])
        if other != k:
            right[k], right[other] = right[other], right[k]
    for i in range(n):
        for j in range(i):
            right[i] -= matrix[i, j] * right[j]
    for i in range(n - 1, -1, -1):
        for j in range(i + 1, n):
            right[i] -= matrix[i, j] * right[j]
        right[i] /= matrix[i, i]


@callback(*STEP)
def step(t, h, method_, work_, control_, problem_):
    """One step of size h; the stages hold the increments, the last of them the estimated error.

    If the error will do, the slopes at the end follow, and the error that they give: a muscle that begins to pull
    slows its tendon a million times, of which the slopes at the start know nothing.
    """
    method, problem = carray(method_, 1)[0], carray(problem_, 1)[0]
    n, stages, work = problem.states, method.stages, work_at(work_, problem, method)
    tableau, couplings = carray(numbers_at(method.tableau), (WEIGHTS + 2 * stages, stages)), WEIGHTS + stages
    slopes = work[STAGES + stages : STAGES + stages + n + 1]
    next_slopes = work[STAGES + stages + n + 1 : STAGES + stages + 2 * n + 2]
    factors = work[STAGES + stages + 2 * n + 2 :]
    matrix, pivots = factors[:n], factors[n]
    factor(tableau[couplings, 0] / h, slopes, matrix, pivots)
    for stage in range(stages):
        own = work[STAGES + stage]
        for i in range(n):
            work[STAGE_STATE, i] = work[STATE, i]
            for j in range(stage):
                work[STAGE_STATE, i] += tableau[WEIGHTS + stage, j] * work[STAGES + j, i]
        if stage == 0:
            own[:] = work[START_RATES]
        else:
            evaluate(problem.rates, t + tableau[NODES, stage] * h, work[STAGE_STATE], problem, own)
        for i in range(n):
            total = 0.0
            for j in range(stage):
                total += tableau[couplings + stage, j] * work[STAGES + j, i]
            own[i] += total / h + tableau[TIMES, stage] * h * slopes[n, i]
        solve(matrix, pivots, own)
    last = work[STAGES + stages - 1]
    for i in range(n):
        work[NEW_STATE, i] = work[STAGE_STATE, i] + last[i]
    control = carray(control_, 1)[0]
    judge(last, work, control)
    if control.error <= 1.0:
        evaluate(problem.jacobian, t + h, work[NEW_STATE], problem, next_slopes)
        error, diagonal, again = control.error, tableau[couplings, 0] / h, work[STAGE_STATE]
        for i in range(n):
            again[i] = diagonal * last[i]
            for j in range(n):
                again[i] -= slopes[j, i] * last[j]
        factor(diagonal, next_slopes, matrix, pivots)
        solve(matrix, pivots, again)
        judge(again, work, control)
        control.error = max(control.error, error)


@callback(*BETWEEN)
def between(t, h, count, times_, out_, method_, work_, problem_):
    """States at times from t to t + h, of third order."""
    method, problem = carray(method_, 1)[0], carray(problem_, 1)[0]
    n, stages, work = problem.states, method.stages, work_at(work_, problem, method)
    tableau = carray(numbers_at(method.tableau), (WEIGHTS + 2 * stages, stages))
    times, out = carray(times_, (count,)), carray(out_, (count, n))
    for i in range(n):
        bend = twist = 0.0
        for stage in range(stages):
            bend += tableau[BEND, stage] * work[STAGES + stage, i]
            twist += tableau[TWIST, stage] * work[STAGES + stage, i]
        start = work[STATE, i]
        difference = work[NEW_STATE, i] - start
        for row in range(count):
            part = min(1.0, (times[row] - t) / h)
            # Written so that what rests stays exactly as it is.
            out[row, i] = start + part * (difference + (1.0 - part) * (bend + part * twist))


IMPLICIT = Method(step, between, RODAS, RODAS.shape[1], implicit=True)
