"""Advancing states in time with step control, joint limits as events, and dense output, compiled.

Two methods: explicit (`limb_nodes.solve.explicit`) where the motion sets the step, implicit
(`limb_nodes.solve.implicit`) where stiff muscles or light segments would.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, types

from limb_nodes.solve.inner import inner
from limb_nodes.solve.limits import LEAST_FLIGHT, NOTHING, RELEASE
from limb_nodes.solve.method import take_step
from limb_nodes.solve.pointer import call, f8, i8, invoke

vector, integers, table = f8[::1], i8[::1], f8[:, ::1]

DONE, TOO_MANY_STEPS, STEP_TOO_SMALL, NOT_FINITE = 0, 1, 2, 3
# Steps per second of movement, at least for one second, after which the solver gives up.
MOST_STEPS = 1e6


@inner
def copy(source, target):
    """Copy the numbers of an array [n]."""
    for i in range(source.size):
        target[i] = source[i]


@njit(types.void(i8, vector, vector, integers, table, vector, vector, table), cache=True, error_model="numpy")
def difference_slopes(rates, y, p, k, u, c, scale, out):
    """Slopes of the rates at time 0, out [states, states], by central differences."""
    n = y.size
    moved, low, high = y.copy(), np.empty(n), np.empty(n)
    for j in range(n):
        change = 1e-6 * scale[j]
        moved[j] = y[j] - change
        call(rates, 0.0, moved, p, k, u, c, low)
        moved[j] = y[j] + change
        call(rates, 0.0, moved, p, k, u, c, high)
        moved[j] = y[j]
        for i in range(n):
            out[i, j] = (high[i] - low[i]) / (2.0 * change)


SIGNATURE = types.int64(
    integers,
    integers,
    i8,
    i8,
    i8,
    i8,
    f8,
    f8,
    vector,
    vector,
    table,
    vector,
    vector,
    integers,
    table,
    vector,
    i8,
    i8,
    i8,
    vector,
    f8,
    f8,
    vector,
)


@njit(SIGNATURE, cache=True, error_model="numpy", nogil=True)
def integrate(
    method,
    limiting,
    rates,
    jacobian,
    reactions,
    strike,
    start,
    end,
    y,
    times,
    out,
    scale,
    p,
    k,
    u,
    c,
    joints,
    limit_offset,
    locked_offset,
    stops,
    tolerance,
    longest,
    progress,
):
    """Advance y in place from start to end and fill out [times, states]; a status.

    method: addresses of EXPLICIT or IMPLICIT. limiting: those of `limits`. rates, jacobian, reactions, strike:
        addresses of the program's functions; jacobian is used by the implicit method, the last two where there
        are joints.
    joints: the first `joints` states are angles, the next as many their velocities; 0 where there
        are no limits. Limits stand in p at limit_offset, the flags of joints on a limit in c at
        locked_offset.
    stops: times (rising) that no step may cross: kinks of the input.
    longest: greatest step. progress: [steps, rejected, time reached, next step]; the next step is
        read at the start where it is positive.
    """
    n = y.size
    step, error_of, between = method[0], method[1], method[2]
    settle, find_event, take_effect = limiting[0], limiting[1], limiting[2]
    rows = u.shape[0]
    found = np.empty(3)
    stages = np.empty((7, n))
    stage_y, new_y, start_rates = np.empty(n), np.empty(n), np.empty(n)
    stiff = jacobian != 0
    slopes = np.empty(n * (n + 1) if stiff else 0)
    matrix = np.empty((n, n) if stiff else (0, 0))
    pivots = np.empty(n if stiff else 0, dtype=np.int64)
    arrays = y, start_rates, slopes, stages, p, k, u, c, stage_y, new_y, matrix, pivots
    span = end - start
    t = start
    row, stop = 0, 0
    while row < times.size and times[row] <= start:
        copy(y, out[row])
        row += 1
    if joints > 0:
        invoke(
            settle, rates, strike, t, n, rows, joints, limit_offset, locked_offset, y, p, k, u, c, start_rates
        )  # fmt: skip
    call(rates, t, y, p, k, u, c, start_rates)
    fresh = False
    h = progress[3] if progress[3] > 0.0 else min(longest, span) * 0.01
    h = min(h, longest)
    power = -0.25 if stiff else -0.2
    last_error = 1e-4
    quiet_until = start
    while t < end:
        if progress[0] + progress[1] > MOST_STEPS * max(1.0, span):
            progress[2] = t
            return TOO_MANY_STEPS
        while stop < stops.size and stops[stop] <= t + 1e-15 * max(1.0, abs(t)):
            stop += 1
        barrier = min(end, stops[stop]) if stop < stops.size else end
        wanted = h
        clipped = t + 1.0000001 * h >= barrier
        if clipped:
            h = barrier - t
        if h < 1e-14 * max(1.0, abs(t)) and not clipped:
            progress[2] = t
            return STEP_TOO_SMALL
        if stiff and not fresh:
            call(jacobian, t, y, p, k, u, c, slopes)
            fresh = True
        take_step(step, rates, t, h, arrays)
        invoke(error_of, h, tolerance, n, y, new_y, stages, scale, found)
        error = found[0]
        if not error <= 1.0:
            if not math.isfinite(error):
                if h < 1e-12:
                    progress[2] = t
                    return NOT_FINITE
                h *= 0.1
            else:
                h *= max(0.2, 0.9 * error**power)
            progress[1] += 1
            continue
        event, joint = NOTHING, -1
        if joints > 0:
            invoke(
                find_event, step, rates, reactions, t, h, quiet_until, n, rows, joints, limit_offset, locked_offset,
                jacobian, found, *arrays,
            )  # fmt: skip
            event, joint = int(found[0]), int(found[1])
            clipped = clipped and found[2] == h
            h = found[2]
        first = row
        while row < times.size and times[row] <= t + h * (1.0 + 1e-12):
            row += 1
        if row > first:
            invoke(between, t, h, n, row - first, times[first:], y, new_y, stages, out[first:])
        t = barrier if clipped and event == NOTHING else t + h
        copy(new_y, y)
        progress[0] += 1
        fresh = False
        if event != NOTHING:
            invoke(
                take_effect, strike, t, n, rows, joints, limit_offset, locked_offset, event, joint,
                y, p, k, u, c, stage_y,
            )  # fmt: skip
            if event == RELEASE:
                quiet_until = t + LEAST_FLIGHT
            h = max(h, 0.1 * wanted)
        else:
            if stiff:
                growth = 0.9 * max(error, 1e-10) ** -0.25
            else:
                growth = 0.9 * math.exp(0.08 * math.log(last_error) - 0.14 * math.log(max(error, 1e-10)))
            last_error = max(error, 1e-4)
            h = h * min(5.0, max(0.2, growth))
            if clipped:
                h = max(h, wanted)
        h = min(h, longest)
        if event != NOTHING or stiff:
            call(rates, t, y, p, k, u, c, start_rates)
        else:
            copy(stages[6], start_rates)
    while row < times.size:
        copy(y, out[row])
        row += 1
    progress[2] = t
    progress[3] = h
    return DONE
