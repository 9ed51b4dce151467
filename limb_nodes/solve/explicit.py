"""Adaptive Dormand-Prince 5(4) with joint limits as events, compiled.

Coefficients, error estimate and interpolant: Hairer, Norsett and Wanner, Solving Ordinary
Differential Equations I, II.5 and II.6.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, types

from limb_nodes.solve.pointer import call

f8, i8 = types.float64, types.int64
vector, integers, table = f8[::1], i8[::1], f8[:, ::1]

DONE, TOO_MANY_STEPS, STEP_TOO_SMALL, NOT_FINITE = 0, 1, 2, 3
# Joints within this distance (rad) of a limit are on it.
TOUCH = 1e-12
# After a release the joint is left alone for this long (s), so that rounding cannot catch it again.
LEAST_FLIGHT = 1e-9


@njit(cache=True, error_model="numpy")
def step(rates, t, h, y, stages, p, k, u, c, stage_y, new_y):
    """One step of size h; stages[0] holds the rates at t, stages[6] then those at t + h."""
    n = y.size
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


@njit(cache=True, error_model="numpy")
def error_norm(h, y, new_y, stages, scale, tolerance):
    """Largest estimated error over its tolerance."""
    worst = 0.0
    for i in range(y.size):
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
    return worst


@njit(cache=True, error_model="numpy")
def interpolate(part, h, y, new_y, stages, out):
    """State at t + part h, 0 <= part <= 1, of fourth order."""
    rest = 1.0 - part
    for i in range(y.size):
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
        out[i] = y[i] + part * (difference + rest * (bend + part * (twist + rest * fourth)))


@njit(cache=True, error_model="numpy")
def overshoot(new_y, limits, joints, locked):
    """The free joint farthest beyond its limit and how far (rad); joint -1 where there is none."""
    joint, worst = -1, TOUCH
    for j in range(joints):
        if locked[j] == 0.0:
            beyond = max(new_y[j] - limits[joints + j], limits[j] - new_y[j])
            if beyond > worst:
                joint, worst = j, beyond
    return joint, worst


@njit(cache=True, error_model="numpy")
def pulled_back(reaction, joints, locked):
    """The joint on a limit that is pulled off it most strongly, and the pull (N m), or -1."""
    joint, worst = -1, 0.0
    for j in range(joints):
        if locked[j] != 0.0 and locked[j] * reaction[j] > worst:
            joint, worst = j, locked[j] * reaction[j]
    return joint, worst


@njit(cache=True, error_model="numpy")
def lock_touching(rates, t, y, joints, limits, locked, p, k, u, c, dy):
    """Lock the joints that start on a limit and press against it."""
    for _ in range(joints):
        call(rates, t, y, p, k, u, c, dy)
        found = False
        for j in range(joints):
            if locked[j] != 0.0:
                continue
            for side, limit in ((1.0, limits[joints + j]), (-1.0, limits[j])):
                if side * (y[j] - limit) >= -TOUCH:
                    outward = side * y[joints + j]
                    if outward > 0.0 or (outward == 0.0 and side * dy[joints + j] > 0.0):
                        locked[j] = side
                        y[j] = limit
                        found = True
        if not found:
            break


SIGNATURE = types.int64(
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


@njit(SIGNATURE, cache=True, error_model="numpy")
def integrate(
    rates,
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

    joints: the first `joints` states are angles, the next as many their velocities; 0 where there
        are no limits. Limits stand in p at limit_offset, the flags of joints on a limit in c at
        locked_offset.
    stops: times (rising) that no step may cross: kinks of the input.
    longest: greatest step. progress: [steps, rejected, time reached, next step]; the next step is
        read at the start where it is positive.
    """
    n = y.size
    stages = np.empty((7, n))
    stage_y, new_y = np.empty(n), np.empty(n)
    limits = p[limit_offset : limit_offset + 2 * joints]
    locked = c[locked_offset : locked_offset + joints]
    span = end - start
    t = start
    row, stop = 0, 0
    while row < times.size and times[row] <= start:
        out[row] = y
        row += 1
    if joints > 0:
        lock_touching(rates, t, y, joints, limits, locked, p, k, u, c, stages[0])
        for j in range(joints):
            if locked[j] != 0.0 and y[joints + j] != 0.0:
                call(strike, t, y, p, k, u, c, stages[1])
                break
    call(rates, t, y, p, k, u, c, stages[0])
    h = progress[3] if progress[3] > 0.0 else min(longest, span) * 0.01
    h = min(h, longest)
    last_error = 1e-4
    quiet_until = start
    while t < end:
        if progress[0] + progress[1] > 2e8:
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
        step(rates, t, h, y, stages, p, k, u, c, stage_y, new_y)
        error = error_norm(h, y, new_y, stages, scale, tolerance)
        if not error <= 1.0:
            if not math.isfinite(error):
                if h < 1e-12:
                    progress[2] = t
                    return NOT_FINITE
                h *= 0.1
            else:
                h *= max(0.2, 0.9 * error**-0.2)
            progress[1] += 1
            continue
        event = 0
        joint = -1
        if joints > 0:
            joint, _ = overshoot(new_y, limits, joints, locked)
            if joint >= 0:
                event = 1
            elif t + h > quiet_until:
                call(reactions, t + h, new_y, p, k, u, c, stage_y)
                joint, _ = pulled_back(stage_y, joints, locked)
                if joint >= 0:
                    event = 2
        if event != 0:
            # Shorten the step until the event lies at its end (Illinois variant of false position).
            short, long = 0.0, h
            short_value, long_value = -1.0, 0.0
            if event == 1:
                side = 1.0 if new_y[joint] > limits[joints + joint] else -1.0
                limit = limits[joints + joint] if side > 0.0 else limits[joint]
                short_value = min(-1e-300, side * (y[joint] - limit))
                long_value = side * (new_y[joint] - limit)
            else:
                long_value = locked[joint] * stage_y[joint]
                call(reactions, t, y, p, k, u, c, stage_y)
                short_value = min(-1e-300, locked[joint] * stage_y[joint])
            for _ in range(60):
                part = short_value / (short_value - long_value)
                h = short + min(0.99, max(0.01, part)) * (long - short)
                step(rates, t, h, y, stages, p, k, u, c, stage_y, new_y)
                if event == 1:
                    value = side * (new_y[joint] - limit)
                else:
                    call(reactions, t + h, new_y, p, k, u, c, stage_y)
                    value = locked[joint] * stage_y[joint]
                if value > 0.0:
                    if long_value > 0.0 and value > 0.5 * long_value:
                        short_value *= 0.5
                    long, long_value = h, value
                else:
                    if value < 0.5 * short_value:
                        long_value *= 0.5
                    short, short_value = h, min(-1e-300, value)
                near = abs(value) <= 1e-13 if event == 1 else False
                if near or long - short <= 1e-12 * max(1e-3, h):
                    break
        while row < times.size and times[row] <= t + h * (1.0 + 1e-12):
            interpolate(min(1.0, (times[row] - t) / h), h, y, new_y, stages, out[row])
            row += 1
        t = barrier if clipped and event == 0 else t + h
        for i in range(n):
            y[i] = new_y[i]
        progress[0] += 1
        if event == 1:
            y[joint] = limit
            locked[joint] = side
            call(strike, t, y, p, k, u, c, stage_y)
            call(rates, t, y, p, k, u, c, stages[0])
            h = max(h, 0.1 * wanted)
        elif event == 2:
            locked[joint] = 0.0
            quiet_until = t + LEAST_FLIGHT
            call(rates, t, y, p, k, u, c, stages[0])
            h = max(h, 0.1 * wanted)
        else:
            for i in range(n):
                stages[0, i] = stages[6, i]
            growth = 0.9 * max(error, 1e-10) ** -0.14 * last_error**0.08
            last_error = max(error, 1e-4)
            h = h * min(5.0, max(0.2, growth))
            if clipped:
                h = max(h, wanted)
            h = min(h, longest)
    while row < times.size:
        out[row] = y
        row += 1
    progress[2] = t
    progress[3] = h
    return DONE
