"""One step of the method of Dormand and Prince of order 5(4), compiled.

Coefficients, error estimate and interpolant: Hairer, Norsett and Wanner, Solving Ordinary
Differential Equations I, II.5 and II.6.
"""

from __future__ import annotations

import math

from numba import carray

from limb_nodes.solve.method import BETWEEN, ERROR, STEP, Method
from limb_nodes.solve.pointer import call, callback


@callback(*STEP)
def step(rates, t, h, n, rows, y_, start_rates_, slopes_, stages_, p_, k_, u_, c_, stage_y_, new_y_, matrix_, pivots_):
    """One step of size h; stages[0] holds the rates at t, stages[6] then those at t + h."""
    y, start_rates, stages = carray(y_, (n,)), carray(start_rates_, (n,)), carray(stages_, (7, n))
    stage_y, new_y = carray(stage_y_, (n,)), carray(new_y_, (n,))
    p, k, u, c = carray(p_, (1,)), carray(k_, (1,)), carray(u_, (rows, 1)), carray(c_, (1,))
    for i in range(n):
        stages[0, i] = start_rates[i]
    for i in range(n):
        stage_y[i] = y[i] + h * 0.2 * stages[0, i]
    call(rates, t + 0.2 * h, stage_y, p, k, u, c, stages[1])
    for i in range(n):
        stage_y[i] = y[i] + h * (3.0 / 40.0 * stages[0, i] + 9.0 / 40.0 * stages[1, i])
    call(rates, t + 0.3 * h, stage_y, p, k, u, c, stages[2])
    for i in range(n):
        stage_y[i] = y[i] + h * (44.0 / 45.0 * stages[0, i] - 56.0 / 15.0 * stages[1, i] + 32.0 / 9.0 * stages[2, i])
    call(rates, t + 0.8 * h, stage_y, p, k, u, c, stages[3])
    for i in range(n):
        stage_y[i] = y[i] + h * (
            19372.0 / 6561.0 * stages[0, i]
            - 25360.0 / 2187.0 * stages[1, i]
            + 64448.0 / 6561.0 * stages[2, i]
            - 212.0 / 729.0 * stages[3, i]
        )
    call(rates, t + 8.0 / 9.0 * h, stage_y, p, k, u, c, stages[4])
    for i in range(n):
        stage_y[i] = y[i] + h * (
            9017.0 / 3168.0 * stages[0, i]
            - 355.0 / 33.0 * stages[1, i]
            + 46732.0 / 5247.0 * stages[2, i]
            + 49.0 / 176.0 * stages[3, i]
            - 5103.0 / 18656.0 * stages[4, i]
        )
    call(rates, t + h, stage_y, p, k, u, c, stages[5])
    for i in range(n):
        new_y[i] = y[i] + h * (
            35.0 / 384.0 * stages[0, i]
            + 500.0 / 1113.0 * stages[2, i]
            + 125.0 / 192.0 * stages[3, i]
            - 2187.0 / 6784.0 * stages[4, i]
            + 11.0 / 84.0 * stages[5, i]
        )
    call(rates, t + h, new_y, p, k, u, c, stages[6])


@callback(*ERROR)
def error_norm(h, tolerance, n, y_, new_y_, stages_, scale_, found):
    """Largest estimated error over its tolerance."""
    y, new_y, stages, scale = carray(y_, (n,)), carray(new_y_, (n,)), carray(stages_, (7, n)), carray(scale_, (n,))
    worst = 0.0
    for i in range(n):
        error = h * (
            71.0 / 57600.0 * stages[0, i]
            - 71.0 / 16695.0 * stages[2, i]
            + 71.0 / 1920.0 * stages[3, i]
            - 17253.0 / 339200.0 * stages[4, i]
            + 22.0 / 525.0 * stages[5, i]
            - 1.0 / 40.0 * stages[6, i]
        )
        size = max(scale[i], abs(y[i]), abs(new_y[i]))
        ratio = abs(error) / (tolerance * size)
        if not ratio <= worst:
            worst = ratio
        if not math.isfinite(worst):
            break
    found[0] = worst


@callback(*BETWEEN)
def interpolate(t, h, n, count, times_, y_, new_y_, stages_, out_):
    """States at times from t to t + h, of fourth order."""
    y, new_y, stages = carray(y_, (n,)), carray(new_y_, (n,)), carray(stages_, (7, n))
    times, out = carray(times_, (count,)), carray(out_, (count, n))
    for i in range(n):
        difference = new_y[i] - y[i]
        bend = h * stages[0, i] - difference
        twist = difference - h * stages[6, i] - bend
        fourth = h * (
            -12715105075.0 / 11282082432.0 * stages[0, i]
            + 87487479700.0 / 32700410799.0 * stages[2, i]
            - 10690763975.0 / 1880347072.0 * stages[3, i]
            + 701980252875.0 / 199316789632.0 * stages[4, i]
            - 1453857185.0 / 822651844.0 * stages[5, i]
            + 69997945.0 / 29380423.0 * stages[6, i]
        )
        for row in range(count):
            part = min(1.0, (times[row] - t) / h)
            rest = 1.0 - part
            out[row, i] = y[i] + part * (difference + rest * (bend + part * (twist + rest * fourth)))


EXPLICIT = Method(step, error_norm, interpolate)
