"""Advancing states in time with step control, joint limits as events, and dense output, compiled.

Two methods: explicit (`limb_nodes.solve.explicit`) if the motion sets the step, implicit
(`limb_nodes.solve.implicit`) if stiff muscles or light segments would.
"""

from __future__ import annotations

import math

import numpy as np
from numba import carray, njit, types

from limb_nodes.solve.inner import inner
from limb_nodes.solve.limits import IMPACT, NOTHING
from limb_nodes.solve.pointer import f8, i8, invoke, numbers_at, record_at
from limb_nodes.solve.problem import (
    NEW_STATE,
    SCALE,
    STAGES,
    START_RATES,
    STATE,
    control_type,
    evaluate,
    method_type,
    problem_type,
    take_step,
    work_rows,
)

vector, table = f8[::1], f8[:, ::1]

DONE, TOO_MANY_STEPS, STEP_TOO_SMALL, NOT_FINITE, PAUSED, STRUCK, CRAWLING = 0, 1, 2, 3, 4, 5, 6
# Steps per second of movement, at least for one second, after which the solver gives up.
MOST_STEPS = 1e6
# A solve that may change its method crawls if so many steps, as long as accuracy and stability allow, reach less far
# than so long (s).
WATCHED, LEAST_WAY = 1000, 0.02


@inner
def copy(source, target):
    """Copy the numbers of an array [n]."""
    for i in range(source.size):
        target[i] = source[i]


@njit(types.void(i8, vector, vector, table), cache=True, error_model="numpy")
def difference_slopes(problem_, y, scale, out):
    """Slopes of the rates at time 0, out [states, states], by central differences.

    problem_: address of the problem. scale: typical sizes [states].
    """
    problem = record_at(problem_, problem_type)
    n = y.size
    moved, low, high = y.copy(), np.empty(n), np.empty(n)
    for j in range(n):
        change = 1e-6 * scale[j]
        moved[j] = y[j] - change
        evaluate(problem.rates, 0.0, moved, problem, low)
        moved[j] = y[j] + change
        evaluate(problem.rates, 0.0, moved, problem, high)
        moved[j] = y[j]
        for i in range(n):
            out[i, j] = (high[i] - low[i]) / (2.0 * change)


@inner
def after_error(h, control, method):
    """The size of the step that is tried again behind one with too large an error."""
    if not math.isfinite(control.error):
        return 0.1 * h
    return h * max(0.2, 0.9 * control.error ** (-0.25 if method.implicit else -0.2))


@inner
def growth(error, last_error, method):
    """By how much the next step may be longer: by the error alone, or by it and the one before (explicit)."""
    least = max(error, 1e-10)
    factor = least**-0.25 if method.implicit else math.exp(0.08 * math.log(last_error) - 0.14 * math.log(least))
    return min(5.0, max(0.2, 0.9 * factor))


@inner
def jolted(before, after, joints):
    """By how much an impact has changed the velocity of a joint, at most (rad/s)."""
    most = 0.0
    for j in range(joints, 2 * joints):
        most = max(most, abs(after[j] - before[j]))
    return most


@inner
def fill(t, h, row, times, out, method, work, problem):
    """Fill out [times, states] from `row` on with the states at times within a step; the row behind them."""
    first = row
    while row < times.size and times[row] <= t + h * (1.0 + 1e-12):
        row += 1
    if row > first:
        invoke(method.between, t, h, row - first, times[first:], out[first:], method, work, problem)
    return row


@njit(
    types.int64(i8, i8, i8, vector, vector, vector, vector, table),
    cache=True,
    error_model="numpy",
    nogil=True,
)
def integrate(method_, problem_, control_, stops, scale, y, times, out):
    """Advance y [states] in place from `control.start`, or where it paused, to `control.end`; a status.

    STRUCK behind an impact at `control.time` that has jolted a joint by more than `control.jolt`. CRAWLING if
    `control.watched` and the steps are small; the solve may go on with another method, as if it had paused.

    method_, problem_, control_: addresses of the records.
    stops: times (rising) that no step may cross: kinks of the input. scale: typical sizes of the states.
    times, out: rising times within, and the states there [times, states]. A solve that paused goes on with the times
    behind those that it has reached, and takes the same steps as one that never pauses.
    """
    method, problem = record_at(method_, method_type), record_at(problem_, problem_type)
    control = record_at(control_, control_type)
    end, span = control.end, control.end - control.start
    work = np.empty((work_rows(problem, method), problem.states))
    state, start_rates = work[STATE], work[START_RATES]
    copy(y, state)
    copy(scale, work[SCALE])
    rest = carray(numbers_at(control.rest), (problem.states + 2, problem.states))
    struck = carray(numbers_at(control.struck), (problem.states,))
    row, stop = 0, 0
    # Whether the slopes are those of the state.
    fresh = False
    first_slope = STAGES + method.stages
    end_slope = first_slope + problem.states + 1
    if control.paused:
        t, h, last_error = control.time, control.next_step, control.last_error
        copy(rest[0], start_rates)
        fresh = control.sloped != 0
        if fresh:
            work[first_slope:end_slope] = rest[1:]
    else:
        t = control.start
        while row < times.size and times[row] <= t:
            copy(y, out[row])
            row += 1
        if problem.joints > 0:
            invoke(method.settle, t, method, work, problem)
        evaluate(problem.rates, t, state, problem, start_rates)
        h = control.next_step if control.next_step > 0.0 else min(control.longest, span) * 0.01
        h = min(h, control.longest)
        last_error = 1e-4
        control.steps = control.rejected = 0
        control.quiet_until = control.start
        control.tried, control.way = 0, 0.0
    status = DONE
    while t < end:
        if control.rest != 0 and t >= control.pause:
            status = PAUSED
            break
        if control.steps + control.rejected > MOST_STEPS * max(1.0, span):
            status = TOO_MANY_STEPS
            break
        if control.watched and control.tried >= WATCHED:
            crawls = control.way < LEAST_WAY
            control.tried, control.way = 0, 0.0
            if crawls:
                status = CRAWLING
                break
        control.tried += 1
        control.way += h
        while stop < stops.size and stops[stop] <= t + 1e-15 * max(1.0, abs(t)):
            stop += 1
        barrier = min(end, stops[stop]) if stop < stops.size else end
        wanted = h
        clipped = t + 1.0000001 * h >= barrier
        if clipped:
            h = barrier - t
        if h < 1e-14 * max(1e-4, abs(t)) and not clipped:
            status = STEP_TOO_SMALL
            break
        if method.implicit and not fresh:
            evaluate(problem.jacobian, t, state, problem, work[first_slope])
            fresh = True
        take_step(t, h, method, work, control, problem)
        error = control.error
        if not error <= 1.0:
            if not math.isfinite(error) and h < 1e-12:
                status = NOT_FINITE
                break
            h = after_error(h, control, method)
            control.rejected += 1
            continue
        control.event, whole = NOTHING, True
        if problem.joints > 0:
            invoke(method.find_event, t, h, method, work, control, problem)
            whole = control.next_step == h
            clipped = clipped and whole
            h = control.next_step
        event = control.event != NOTHING
        row = fill(t, h, row, times, out, method, work, problem)
        t = barrier if clipped and not event else t + h
        copy(work[NEW_STATE], state)
        control.steps += 1
        fresh = method.implicit and whole and not event
        if fresh:
            work[first_slope:end_slope] = work[end_slope : end_slope + problem.states + 1]
        if event:
            watched = control.jolt > 0.0 and control.event == IMPACT
            if watched:
                copy(state, struck)
            invoke(method.take_effect, t, method, work, control, problem)
            h = max(h, 0.1 * wanted)
            if watched and jolted(struck, state, problem.joints) > control.jolt:
                status = STRUCK
                break
        else:
            h *= growth(error, last_error, method)
            last_error = max(error, 1e-4)
            if clipped:
                h = max(h, wanted)
        h = min(h, control.longest)
        if event or method.implicit:
            evaluate(problem.rates, t, state, problem, start_rates)
        else:
            copy(work[STAGES + method.stages - 1], start_rates)
    copy(state, y)
    control.time = t
    control.next_step = h
    control.last_error = last_error
    control.paused = status in (PAUSED, CRAWLING)
    if control.paused:
        copy(start_rates, rest[0])
        control.sloped = fresh
        if fresh:
            rest[1:] = work[first_slope:end_slope]
    if status == DONE:
        while row < times.size:
            copy(y, out[row])
            row += 1
    control.rows = row
    return status
