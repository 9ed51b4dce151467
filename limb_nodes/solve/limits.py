"""Joint limits as events of a solve, compiled: a joint meets its limit, rests on it, and is pulled off it.

Called by address, as a method is, so that limbs without limits need not wait for their compilation.

limits: lowest angles, then highest [2 joints]. locked: per joint 1 or -1 while it rests on its highest or lowest.
"""

from __future__ import annotations

import math

from numba import carray

from limb_nodes.solve.inner import inner
from limb_nodes.solve.pointer import callback, f8, numbers, numbers_at
from limb_nodes.solve.problem import (
    NEW_STATE,
    STAGE_STATE,
    START_RATES,
    STATE,
    control_pointer,
    evaluate,
    method_pointer,
    problem_pointer,
    take_step,
    work_at,
)

# What happens at the end of a step.
NOTHING, IMPACT, RELEASE = 0, 1, 2

# Joints within this distance (rad) of a limit are on it.
TOUCH = 1e-12
# A joint that meets its limit is brought so near to it (rad).
ON_LIMIT = 1e-13
# A joint leaves its limit when the pull has fallen to this part of that at the step's end.
JUST = 1e-11
# After a release the joint is left alone for this long (s), so that rounding cannot catch it again.
LEAST_FLIGHT = 1e-9


@inner
def overshoot(new_y, limits, joints, locked):
    """The free joint farthest beyond its limit and how far (rad, negative if none is)."""
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

    The largest such part, 0.0 if there is none: by its velocity a joint that turns within the
    step has gone at most a quarter of the step beyond both its ends.
    """
    largest = 0.0
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
            largest = max(largest, before / (before - after))
    return largest


@inner
def pulled_back(reaction, joints, locked):
    """The joint on a limit that is pulled off it most strongly, and the pull (N m, negative if none is)."""
    joint, worst = -1, -math.inf
    for j in range(joints):
        if locked[j] != 0.0 and locked[j] * reaction[j] > worst:
            joint, worst = j, locked[j] * reaction[j]
    return joint, worst


@inner
def pull_behind(t, method, work, problem, locked):
    """`pulled_back` at the end t of a step."""
    if method.implicit:
        # The explicit step ends with the rates there, which leave the torques that `reactions` takes.
        evaluate(problem.rates, t, work[NEW_STATE], problem, work[STAGE_STATE])
    evaluate(problem.reactions, t, work[NEW_STATE], problem, work[STAGE_STATE])
    return pulled_back(work[STAGE_STATE], problem.joints, locked)


@inner
def crossed(y, limits, joints, joint):
    """The limit that a joint is farther beyond: 1 for the highest or -1 for the lowest, and its angle."""
    if y[joint] - limits[joints + joint] > limits[joint] - y[joint]:
        return 1.0, limits[joints + joint]
    return -1.0, limits[joint]


@inner
def lock_touching(t, work, problem, limits, locked):
    """Lock the joints that start on a limit and press against it."""
    joints, state, rates = problem.joints, work[STATE], work[START_RATES]
    for _ in range(joints):
        evaluate(problem.rates, t, state, problem, rates)
        changed = False
        for j in range(joints):
            if locked[j] != 0.0:
                continue
            for side, limit in ((1.0, limits[joints + j]), (-1.0, limits[j])):
                if side * (state[j] - limit) >= -TOUCH:
                    outward = side * state[joints + j]
                    if outward > 0.0 or (outward == 0.0 and side * rates[joints + j] > 0.0):
                        locked[j] = side
                        state[j] = limit
                        changed = True
        if not changed:
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
def meet_limit(t, h, method, work, control, problem, limits, locked):
    """Shorten a step of size h until the first joint that crosses its limit is on it; the size, and the joint."""
    joints, state, new_state = problem.joints, work[STATE], work[NEW_STATE]
    joint, side, limit = -1, 0.0, 0.0
    short, long = 0.0, h
    short_gap, short_speed, long_gap, long_speed = 0.0, 0.0, 0.0, 0.0
    for _ in range(60):
        worst, value = overshoot(new_state, limits, joints, locked)
        if value > TOUCH and worst != joint:
            joint = worst
            side, limit = crossed(new_state, limits, joints, joint)
            short, short_gap, short_speed = (
                0.0,
                min(-1e-300, side * (state[joint] - limit)),
                side * state[joints + joint],
            )
        gap, speed = side * (new_state[joint] - limit), side * new_state[joints + joint]
        if gap > 0.0:
            long, long_gap, long_speed = h, gap, speed
        else:
            short, short_gap, short_speed = h, gap, speed
        if abs(gap) <= ON_LIMIT or long - short <= 1e-12 * max(1e-3, h):
            break
        h = crossing(short, short_gap, short_speed, long, long_gap, long_speed)
        take_step(t, h, method, work, control, problem)
    return h, joint


@inner
def leave_limit(t, h, pull, method, work, control, problem, locked):
    """Shorten a step of size h, at whose end a joint is pulled off its limit by `pull` (N m), until it just is.

    The size, and the joint. Illinois variant of false position.
    """
    evaluate(problem.rates, t, work[STATE], problem, work[STAGE_STATE])
    evaluate(problem.reactions, t, work[STATE], problem, work[STAGE_STATE])
    short_value = min(-1e-300, pulled_back(work[STAGE_STATE], problem.joints, locked)[1])
    short, long, long_value = 0.0, h, pull
    joint = -1
    for _ in range(60):
        part = short_value / (short_value - long_value)
        h = short + min(0.99, max(0.01, part)) * (long - short)
        take_step(t, h, method, work, control, problem)
        joint, value = pull_behind(t + h, method, work, problem, locked)
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
def limits_and_locked(problem):
    """Both as arrays."""
    joints = problem.joints
    return carray(numbers_at(problem.limits), (2 * joints,)), carray(numbers_at(problem.locked), (joints,))


# t, method, work, problem
@callback(f8, method_pointer, numbers, problem_pointer)
def settle(t, method_, work_, problem_):
    """Lock the joints that start on a limit and press against it, and stop those that move there."""
    method, problem = carray(method_, 1)[0], carray(problem_, 1)[0]
    work = work_at(work_, problem, method)
    limits, locked = limits_and_locked(problem)
    lock_touching(t, work, problem, limits, locked)
    for j in range(problem.joints):
        if locked[j] != 0.0 and work[STATE, problem.joints + j] != 0.0:
            evaluate(problem.rates, t, work[STATE], problem, work[START_RATES])
            evaluate(problem.strike, t, work[STATE], problem, work[START_RATES])
            break


# t, h, method, work, control, problem
@callback(f8, f8, method_pointer, numbers, control_pointer, problem_pointer)
def find_event(t, h, method_, work_, control_, problem_):
    """End a step of size h with the first event in it: `control.event`, its joint, and in `next_step` the step's size.

    Until the time `control.quiet_until` no joint is released.
    """
    method, control, problem = carray(method_, 1)[0], carray(control_, 1)[0], carray(problem_, 1)[0]
    work, joints = work_at(work_, problem, method), problem.joints
    limits, locked = limits_and_locked(problem)
    part = turning_point(work[STATE], work[NEW_STATE], limits, joints, locked, h)
    if part > 0.0:
        # The ends of a step do not tell of a touch in between: look at the place at which the joint turns.
        take_step(t, part * h, method, work, control, problem)
        if overshoot(work[NEW_STATE], limits, joints, locked)[1] > TOUCH:
            h = part * h
        else:
            take_step(t, h, method, work, control, problem)
    event = NOTHING
    joint, value = overshoot(work[NEW_STATE], limits, joints, locked)
    if value > TOUCH:
        event = IMPACT
        h, joint = meet_limit(t, h, method, work, control, problem, limits, locked)
    elif t + h > control.quiet_until and any_locked(locked):
        joint, value = pull_behind(t + h, method, work, problem, locked)
        if value > 0.0:
            event = RELEASE
            h, joint = leave_limit(t, h, value, method, work, control, problem, locked)
    control.event, control.joint, control.next_step = event, joint, h


# t, method, work, control, problem
@callback(f8, method_pointer, numbers, control_pointer, problem_pointer)
def take_effect(t, method_, work_, control_, problem_):
    """What an event does to the state: an impact stops its joint, jolts the others, and may throw some off a limit."""
    method, problem = carray(method_, 1)[0], carray(problem_, 1)[0]
    work = work_at(work_, problem, method)
    control = carray(control_, 1)[0]
    limits, locked = limits_and_locked(problem)
    joint, state = control.joint, work[STATE]
    if control.event == RELEASE:
        locked[joint] = 0.0
        control.quiet_until = t + LEAST_FLIGHT
        return
    locked[joint], state[joint] = crossed(state, limits, problem.joints, joint)
    evaluate(problem.rates, t, state, problem, work[STAGE_STATE])
    evaluate(problem.strike, t, state, problem, work[STAGE_STATE])
