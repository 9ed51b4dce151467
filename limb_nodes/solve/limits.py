"""Joint limits as events of a solve, compiled: a joint meets its limit, rests on it, and is pulled off it.

Called by address, as a method is, so that limbs without limits need not wait for their compilation.

limits: lowest angles, then highest [2 joints]; they stand in the parameters p at limit_offset. locked: per joint
1 or -1 while it rests on its highest or lowest; in the context c at locked_offset.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from numba import carray

from limb_nodes.foundation.arrays import IntArray
from limb_nodes.solve.inner import inner
from limb_nodes.solve.method import STEP, take_step
from limb_nodes.solve.pointer import call, callback, f8, i8, numbers, whole_numbers

# What happens at the end of a step.
NOTHING, IMPACT, RELEASE = 0, 1, 2

# Joints within this distance (rad) of a limit are on it.
TOUCH = 1e-12
# A joint that meets its limit is brought so near to it (rad).
ON_LIMIT = 1e-13
# A joint leaves its limit where the pull has fallen to this part of that at the step's end.
JUST = 1e-11
# After a release the joint is left alone for this long (s), so that rounding cannot catch it again.
LEAST_FLIGHT = 1e-9


@inner
def overshoot(new_y, limits, joints, locked):
    """The free joint farthest beyond its limit and how far (rad, negative where none is)."""
    joint, worst = -1, -math.inf
    for j in range(joints):
        if locked[j] == 0.0:
            beyond = max(new_y[j] - limits[joints + j], limits[j] - new_y[j])
            if beyond > worst:
                joint, worst = j, beyond
    return joint, worst


@inner
def any_locked(locked):
    """Whether a joint rests on its limit."""
    for flag in locked:
        if flag != 0.0:
            return True
    return False


@inner
def turning_point(y, new_y, limits, joints, locked, h):
    """Part of a step after which a free joint turns back so near its limit that it may have crossed it.

    The largest such part, 0.0 where there is none: by its velocity a joint that turns within the
    step has gone at most a quarter of the step beyond both its ends.
    """
    found = 0.0
    for j in range(joints):
        if locked[j] != 0.0:
            continue
        before, after = y[joints + j], new_y[joints + j]
        if before > 0.0 and after < 0.0:
            room = limits[joints + j] - max(y[j], new_y[j])
        elif before < 0.0 and after > 0.0:
            room = min(y[j], new_y[j]) - limits[j]
        else:
            continue
        if room < 0.25 * h * max(abs(before), abs(after)):
            found = max(found, before / (before - after))
    return found


@inner
def pulled_back(reaction, joints, locked):
    """The joint on a limit that is pulled off it most strongly, and the pull (N m, negative where none is)."""
    joint, worst = -1, -math.inf
    for j in range(joints):
        if locked[j] != 0.0 and locked[j] * reaction[j] > worst:
            joint, worst = j, locked[j] * reaction[j]
    return joint, worst


@inner
def pull_behind(rates, reactions, stiff, t, arrays, joints, locked):
    """`pulled_back` at the end t of a step."""
    _, _, _, _, p, k, u, c, stage_y, new_y, _, _ = arrays
    if stiff != 0:
        # The explicit step ends with the rates there, which leave the torques that `reactions` takes.
        call(rates, t, new_y, p, k, u, c, stage_y)
    call(reactions, t, new_y, p, k, u, c, stage_y)
    return pulled_back(stage_y, joints, locked)


@inner
def crossed(y, limits, joints, joint):
    """The limit that a joint is farther beyond: 1 for the highest or -1 for the lowest, and its angle."""
    if y[joint] - limits[joints + joint] > limits[joint] - y[joint]:
        return 1.0, limits[joints + joint]
    return -1.0, limits[joint]


@inner
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


@inner
def crossing(start, gap, speed, end, end_gap, end_speed):
    """Where the cubic through two gaps and their changes per time rises through zero; gap < 0 < end_gap."""
    width = end - start
    rise = end_gap - gap
    bend, twist = speed * width - rise, rise - end_speed * width
    low, high = 0.0, 1.0
    part = -gap / rise
    for _ in range(60):
        rest = 1.0 - part
        value = gap + part * rise + part * rest * (rest * bend + part * twist)
        if value > 0.0:
            high = part
        else:
            low = part
        slope = rise + (rest - part) * (rest * bend + part * twist) + part * rest * (twist - bend)
        before = part
        part -= value / slope
        if not low < part < high:
            part = 0.5 * (low + high)
        if abs(part - before) <= 1e-15:
            break
    return start + part * width


@inner
def meet_limit(step, rates, t, h, arrays, limits, joints, locked):
    """Shorten a step of size h until the first joint that crosses its limit is on it; the size, and the joint."""
    y, new_y = arrays[0], arrays[9]
    joint, side, limit = -1, 0.0, 0.0
    short, long = 0.0, h
    short_gap, short_speed, long_gap, long_speed = 0.0, 0.0, 0.0, 0.0
    for _ in range(60):
        worst, value = overshoot(new_y, limits, joints, locked)
        if value > TOUCH and worst != joint:
            joint = worst
            side, limit = crossed(new_y, limits, joints, joint)
            short, short_gap, short_speed = 0.0, min(-1e-300, side * (y[joint] - limit)), side * y[joints + joint]
        gap, speed = side * (new_y[joint] - limit), side * new_y[joints + joint]
        if gap > 0.0:
            long, long_gap, long_speed = h, gap, speed
        else:
            short, short_gap, short_speed = h, gap, speed
        if abs(gap) <= ON_LIMIT or long - short <= 1e-12 * max(1e-3, h):
            break
        h = crossing(short, short_gap, short_speed, long, long_gap, long_speed)
        take_step(step, rates, t, h, arrays)
    return h, joint


@inner
def leave_limit(step, rates, reactions, stiff, t, h, arrays, pull, joints, locked):
    """Shorten a step of size h, at whose end a joint is pulled off its limit by `pull` (N m), until it just is.

    The size, and the joint. Illinois variant of false position.
    """
    y, _, _, _, p, k, u, c, stage_y, _, _, _ = arrays
    call(rates, t, y, p, k, u, c, stage_y)
    call(reactions, t, y, p, k, u, c, stage_y)
    short_value = min(-1e-300, pulled_back(stage_y, joints, locked)[1])
    short, long, long_value = 0.0, h, pull
    joint = -1
    for _ in range(60):
        part = short_value / (short_value - long_value)
        h = short + min(0.99, max(0.01, part)) * (long - short)
        take_step(step, rates, t, h, arrays)
        joint, value = pull_behind(rates, reactions, stiff, t + h, arrays, joints, locked)
        if value > 0.0:
            if value > 0.5 * long_value:
                short_value *= 0.5
            long, long_value = h, value
        else:
            if value < 0.5 * short_value:
                long_value *= 0.5
            short, short_value = h, min(-1e-300, value)
        if abs(value) <= JUST * pull or long - short <= 1e-12 * max(1e-3, h):
            break
    return h, joint


@inner
def parts(joints, limit_offset, locked_offset, p_, c_):
    """limits and locked as arrays."""
    return (
        carray(p_, (limit_offset + 2 * joints,))[limit_offset:],
        carray(c_, (locked_offset + joints,))[locked_offset:],
    )


# rates, strike, t, n, rows of u, joints, limit_offset, locked_offset, y, p, k, u, c, dy
@callback(i8, i8, f8, *[i8] * 5, *[numbers] * 2, whole_numbers, *[numbers] * 3)
def settle(rates, strike, t, n, rows, joints, limit_offset, locked_offset, y_, p_, k_, u_, c_, dy_):
    """Lock the joints that start on a limit and press against it, and stop those that move there."""
    y, dy = carray(y_, (n,)), carray(dy_, (n,))
    p, k, u, c = carray(p_, (1,)), carray(k_, (1,)), carray(u_, (rows, 1)), carray(c_, (1,))
    limits, locked = parts(joints, limit_offset, locked_offset, p_, c_)
    lock_touching(rates, t, y, joints, limits, locked, p, k, u, c, dy)
    for j in range(joints):
        if locked[j] != 0.0 and y[joints + j] != 0.0:
            call(strike, t, y, p, k, u, c, dy)
            break


# step, rates, reactions, t, h, quiet_until, n, rows of u, joints, limit_offset, locked_offset, stiff, found,
# and the arrays of `STEP`
@callback(*[i8] * 3, *[f8] * 3, *[i8] * 6, numbers, *STEP[5:])
def find_event(
    step, rates, reactions, t, h, quiet_until, n, rows, joints, limit_offset, locked_offset, stiff, found,
    y_, start_rates, slopes, stages, p_, k_, u_, c_, stage_y_, new_y_, matrix, pivots,
):  # fmt: skip
    """End a step of size h with the first event in it. found: the event, the joint, the size of the step.

    Until the time quiet_until no joint is released.
    """
    y, stage_y, new_y = carray(y_, (n,)), carray(stage_y_, (n,)), carray(new_y_, (n,))
    p, k, u, c = carray(p_, (1,)), carray(k_, (1,)), carray(u_, (rows, 1)), carray(c_, (1,))
    limits, locked = parts(joints, limit_offset, locked_offset, p_, c_)
    arrays = y, start_rates, slopes, stages, p, k, u, c, stage_y, new_y, matrix, pivots
    part = turning_point(y, new_y, limits, joints, locked, h)
    if part > 0.0:
        # The ends of a step do not tell of a touch in between: look where the joint turns.
        take_step(step, rates, t, part * h, arrays)
        if overshoot(new_y, limits, joints, locked)[1] > TOUCH:
            h = part * h
        else:
            take_step(step, rates, t, h, arrays)
    event = NOTHING
    joint, value = overshoot(new_y, limits, joints, locked)
    if value > TOUCH:
        event = IMPACT
        h, joint = meet_limit(step, rates, t, h, arrays, limits, joints, locked)
    elif t + h > quiet_until and any_locked(locked):
        joint, value = pull_behind(rates, reactions, stiff, t + h, arrays, joints, locked)
        if value > 0.0:
            event = RELEASE
            h, joint = leave_limit(step, rates, reactions, stiff, t, h, arrays, value, joints, locked)
    found[0], found[1], found[2] = event, joint, h


# strike, t, n, rows of u, joints, limit_offset, locked_offset, event, joint, y, p, k, u, c, scratch
@callback(i8, f8, *[i8] * 7, *[numbers] * 2, whole_numbers, *[numbers] * 3)
def take_effect(strike, t, n, rows, joints, limit_offset, locked_offset, event, joint, y_, p_, k_, u_, c_, scratch_):
    """What an event does to the state y: an impact stops its joint and jolts the others."""
    y, scratch = carray(y_, (n,)), carray(scratch_, (n,))
    p, k, u, c = carray(p_, (1,)), carray(k_, (1,)), carray(u_, (rows, 1)), carray(c_, (1,))
    limits, locked = parts(joints, limit_offset, locked_offset, p_, c_)
    if event == RELEASE:
        locked[joint] = 0.0
        return
    locked[joint], y[joint] = crossed(y, limits, joints, joint)
    call(strike, t, y, p, k, u, c, scratch)


@cache
def addresses() -> IntArray:
    """Where `settle`, `find_event` and `take_effect` are."""
    return np.array([settle.address, find_event.address, take_effect.address], dtype=np.int64)


NO_LIMITS: IntArray = np.zeros(3, dtype=np.int64)
