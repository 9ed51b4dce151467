"""One step of RODAS, a stiffly accurate Rosenbrock method of order 4(3), compiled.

Coefficients and interpolant: Hairer and Wanner, Solving Ordinary Differential Equations II, IV.7
and IV.10. It is L-stable: fast decaying motion does not limit the step.
"""

from __future__ import annotations

import math

from numba import carray

from limb_nodes.solve.inner import inner
from limb_nodes.solve.method import BETWEEN, ERROR, STEP, Method
from limb_nodes.solve.pointer import call, callback


@inner
def factor(n, h, slopes, matrix, pivots):
    """LU factors of I / (h gamma) - slopes, with partial pivoting."""
    for i in range(n):
        for j in range(n):
            matrix[i, j] = -slopes[i * n + j]
        matrix[i, i] += 4.0 / h
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
def solve(n, matrix, pivots, right):
    """Solve with the factors, in place."""
    for k in range(n):
        other = pivots[k]
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
def step(rates, t, h, n, rows, y_, start_rates_, slopes_, stages_, p_, k_, u_, c_, stage_y_, new_y_, matrix_, pivots_):
    """One step of size h; stages [6] holds the increments, the last of them the estimated error.

    start_rates: at t. slopes: what the program's `jacobian` gives at t.
    """
    y, start_rates, s = carray(y_, (n,)), carray(start_rates_, (n,)), carray(stages_, (7, n))
    stage_y, new_y = carray(stage_y_, (n,)), carray(new_y_, (n,))
    p, k, u, c = carray(p_, (1,)), carray(k_, (1,)), carray(u_, (rows, 1)), carray(c_, (1,))
    slopes, matrix, pivots = carray(slopes_, (n * n + n,)), carray(matrix_, (n, n)), carray(pivots_, (n,))
    factor(n, h, slopes, matrix, pivots)
    by_time = slopes[n * n :]
    for i in range(n):
        s[0, i] = start_rates[i] + 0.25 * h * by_time[i]
    solve(n, matrix, pivots, s[0])
    for i in range(n):
        stage_y[i] = y[i] + 1.544 * s[0, i]
    call(rates, t + 0.386 * h, stage_y, p, k, u, c, s[1])
    for i in range(n):
        s[1, i] += -5.6688 / h * s[0, i] - 0.1043 * h * by_time[i]
    solve(n, matrix, pivots, s[1])
    for i in range(n):
        stage_y[i] = y[i] + 0.9466785280815826 * s[0, i] + 0.2557011698983284 * s[1, i]
    call(rates, t + 0.21 * h, stage_y, p, k, u, c, s[2])
    for i in range(n):
        s[2, i] += (-2.430093356833875 * s[0, i] - 0.2063599157091915 * s[1, i]) / h + 0.1035 * h * by_time[i]
    solve(n, matrix, pivots, s[2])
    for i in range(n):
        stage_y[i] = y[i] + 3.314825187068521 * s[0, i] + 2.896124015972201 * s[1, i] + 0.9986419139977817 * s[2, i]
    call(rates, t + 0.63 * h, stage_y, p, k, u, c, s[3])
    for i in range(n):
        s[3, i] += (-0.1073529058151375 * s[0, i] - 9.594562251023355 * s[1, i] - 20.47028614809616 * s[2, i]) / h
        s[3, i] -= 0.03620000000000023 * h * by_time[i]
    solve(n, matrix, pivots, s[3])
    for i in range(n):
        stage_y[i] = (
            y[i]
            + 1.221224509226641 * s[0, i]
            + 6.019134481288629 * s[1, i]
            + 12.53708332932087 * s[2, i]
            - 0.6878860361058950 * s[3, i]
        )
    call(rates, t + h, stage_y, p, k, u, c, s[4])
    for i in range(n):
        s[4, i] += (
            7.496443313967647 * s[0, i]
            - 10.24680431464352 * s[1, i]
            - 33.99990352819905 * s[2, i]
            + 11.70890893206160 * s[3, i]
        ) / h
    solve(n, matrix, pivots, s[4])
    for i in range(n):
        stage_y[i] += s[4, i]
    call(rates, t + h, stage_y, p, k, u, c, s[5])
    for i in range(n):
        s[5, i] += (
            8.083246795921522 * s[0, i]
            - 7.981132988064893 * s[1, i]
            - 31.52159432874371 * s[2, i]
            + 16.31930543123136 * s[3, i]
            - 6.058818238834054 * s[4, i]
        ) / h
    solve(n, matrix, pivots, s[5])
    for i in range(n):
        new_y[i] = stage_y[i] + s[5, i]


@callback(*ERROR)
def error_norm(h, tolerance, n, y_, new_y_, stages_, scale_, found):
    """Largest estimated error over its tolerance."""
    y, new_y, stages, scale = carray(y_, (n,)), carray(new_y_, (n,)), carray(stages_, (7, n)), carray(scale_, (n,))
    worst = 0.0
    for i in range(n):
        ratio = abs(stages[5, i]) / (tolerance * max(scale[i], abs(y[i]), abs(new_y[i])))
        if not ratio <= worst:
            worst = ratio
        if not math.isfinite(worst):
            break
    found[0] = worst


@callback(*BETWEEN)
def interpolate(t, h, n, count, times_, y_, new_y_, stages_, out_):
    """States at times from t to t + h, of third order."""
    y, new_y, stages = carray(y_, (n,)), carray(new_y_, (n,)), carray(stages_, (7, n))
    times, out = carray(times_, (count,)), carray(out_, (count, n))
    for i in range(n):
        bend = (
            10.12623508344586 * stages[0, i]
            - 7.487995877610167 * stages[1, i]
            - 34.80091861555747 * stages[2, i]
            - 7.992771707568823 * stages[3, i]
            + 1.025137723295662 * stages[4, i]
        )
        twist = (
            -0.6762803392801253 * stages[0, i]
            + 6.087714651680015 * stages[1, i]
            + 16.43084320892478 * stages[2, i]
            + 24.76722511418386 * stages[3, i]
            - 6.594389125716872 * stages[4, i]
        )
        for row in range(count):
            part = min(1.0, (times[row] - t) / h)
            rest = 1.0 - part
            # Written so that what rests stays exactly where it is.
            out[row, i] = y[i] + part * (new_y[i] - y[i] + rest * (bend + part * twist))


IMPLICIT = Method(step, error_norm, interpolate)
