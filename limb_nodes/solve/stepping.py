"""The steps that the nodes take: muscles on one side, the chain of segments on the other.

Both sides meet at ticks. The muscles give the torque at a tick with its slopes in joint angles,
joint velocities and time; the chain advances under that linear model; the muscles then advance
their internal states along the cubic through the joint states of both ticks. By how much the
linear model of one tick missed the torque of the next tells the curvature, which the chain takes
along into the next tick.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.foundation.records import Record
from limb_nodes.model.limb import Limb
from limb_nodes.solve.explicit import EXPLICIT
from limb_nodes.solve.failure import FAILURES, SolveError, fault_of
from limb_nodes.solve.held import hold, predict
from limb_nodes.solve.implicit import IMPLICIT
from limb_nodes.solve.integrate import DONE, STRUCK, integrate
from limb_nodes.solve.outputs import CROSSING_OUTPUTS, MUSCLE_OUTPUTS, UNIT_OUTPUTS
from limb_nodes.solve.pieces import bent, part_of, straight
from limb_nodes.solve.problem import CONTROL, give_inputs, new_problem
from limb_nodes.solve.ranges import Ranges
from limb_nodes.solve.small import same
from limb_nodes.solve.stiffness import STIFF, stiffness_of
from limb_nodes.solve.whole import WholeModel

TICK_TOLERANCE = 1e-9
# An impact that changes a joint's velocity by more than this (rad/s) asks for the torque behind it: what the linear
# model of the torque misses there grows with the square of the change.
JOLT = 1e-2
WHOLE = (0.0, 1.0)
# The part of a tick that is left at least behind an impact: slopes in time are per the rest of the tick.
LEAST_REST = 1e-9
NO_TIMES = np.empty(0)
NO_ROWS = np.empty((0, 0))
# A tick of the rehearsal (s).
REHEARSAL = 1e-3


def tick_control() -> Record:
    """How exactly a tick is solved."""
    control = Record(CONTROL)
    control.tolerance[0] = TICK_TOLERANCE
    return control


def solve_tick(
    method: Record, problem: Record, control: Record, scale: FloatArray, state: FloatArray, period: float
) -> int:
    """Advance a state by `period` (s) from time 0, in one step if it will do; the status of `integrate`."""
    control.end[0] = control.longest[0] = control.next_step[0] = period
    addresses = method.address, problem.address, control.address
    status: int = integrate(*addresses, NO_TIMES, scale, state, NO_TIMES, NO_ROWS)
    return status


class MuscleStepper:
    """All muscles of a limb between joint states and torques.

    internal: internal states, at the tick of the last joint state. ranges: what `look` has seen.
    """

    def __init__(self, limb: Limb) -> None:
        self.model = WholeModel(limb)
        layout = self.model.layout
        self.joints = layout.joints
        self.internal: FloatArray = layout.initial_states.copy()
        self._state = np.zeros(2 * layout.joints + layout.states)
        self._row = self._state[np.newaxis]
        self.ranges = Ranges(self.model)
        self._muscles = np.zeros((layout.muscles, len(MUSCLE_OUTPUTS)))
        self._crossings = np.zeros((layout.crossings, len(CROSSING_OUTPUTS)))
        self._units = np.zeros((layout.units, len(UNIT_OUTPUTS)))
        self._control = tick_control()
        self._start()
        self._rehearse()

    def _start(self) -> None:
        """Fresh data, and the muscles alone as a problem of it."""
        layout, program = self.model.layout, self.model.program
        self._data = self.model.new_data(1.0)
        rates = program.muscle_rates_c.address if layout.states else 0
        self._problem = new_problem(layout.states, rates, layout.model, self._data)
        self._method = EXPLICIT.free
        if self._stiffness() > STIFF:
            self._method = IMPLICIT.free
            self._problem.jacobian[0] = program.muscle_jacobian_c.address

    def _stiffness(self) -> float:
        """Fastest rate (1/s) of the muscles, the joints as at the start; the limb's own rates need not be compiled."""
        layout, n = self.model.layout, self.joints
        if not layout.states:
            return 0.0
        data, start = self.model.new_data(1.0), self.model.initial_state()
        data.angles_before[:] = data.angles_after[:] = start[:n]
        data.velocities_before[:] = data.velocities_after[:] = start[n : 2 * n]
        problem = new_problem(layout.states, self.model.program.muscle_rates_c.address, layout.model, data)
        given = layout.initial_states.copy(), layout.state_scales, layout.states, self.model.equal_drives
        return stiffness_of(problem, *given)

    def adopt(self, model: WholeModel) -> None:
        """Go on with the numbers of another model that has the same program."""
        self.model = model
        self.ranges = Ranges(model)
        self._start()

    def _rehearse(self) -> None:
        """Do what a tick does, so that it is compiled and loaded before the first."""
        n, layout = self.joints, self.model.layout
        start = self.model.initial_state()
        posture = start[:n], start[n : 2 * n]
        excitation = np.zeros(layout.muscles)
        drive = self.drive(excitation)
        for last_drive in (None, drive):
            self.torque(*posture, drive, drive, REHEARSAL, last_drive)
            self.advance(posture, posture, drive, drive, REHEARSAL, last_drive)
        self.observe(*posture, excitation)
        self.look()
        self.ranges = Ranges(self.model)
        self.internal[:] = layout.initial_states
        self._start()

    @property
    def remembered(self) -> FloatArray:
        """All that the next ticks depend on [states + scratch]; `remember` takes it.

        Beside the internal states it is what the search for the forces starts from.
        """
        return np.concatenate([self.internal, self._data.scratch])

    def remember(self, values: FloatArray) -> None:
        """Go on from what another stepper of the same limb remembered."""
        self.internal[:], self._data.scratch[:] = np.split(values, [self.internal.size])

    @property
    def shown(self) -> dict[str, FloatArray]:
        """What `observe` fills in, by name of `MUSCLE_OUTPUTS` [muscles], `CROSSING_OUTPUTS` [crossings] and so on."""
        tables = (
            (self._muscles, MUSCLE_OUTPUTS), (self._crossings, CROSSING_OUTPUTS), (self._units, UNIT_OUTPUTS)
        )  # fmt: skip
        return {name: table[:, i] for table, names in tables for i, name in enumerate(names)}

    def drive(self, excitation: FloatArray) -> FloatArray:
        """What excitations [muscles] do to muscles and motor units [drives]."""
        drives: FloatArray = self.model.drives(excitation[np.newaxis, :])[0]
        return drives

    def torque(
        self,
        angle: FloatArray,
        velocity: FloatArray,
        drive: FloatArray,
        next_drive: FloatArray,
        period: float,
        last_drive: FloatArray | None = None,
        span: tuple[float, float] = WHOLE,
    ) -> FloatArray:
        """Torque (N m), its slope in time, in the angles and in the velocities: 1, 1, n and n rows of [2 + 2 n, n].

        drive, next_drive: at this tick and one `period` (s) later. last_drive: one period before,
        if it is known; the input is then a parabola instead of a straight line. span: the part of the tick at whose
        start the torque is asked for.
        """
        self._set_state(angle, velocity)
        self._data.period[0] = period * (span[1] - span[0])
        out = np.empty((2 + 2 * self.joints, self.joints))
        model = self.model
        inputs = tick_input(last_drive, drive, next_drive, span)
        model.program.torque_slopes(self._state, inputs, model.layout.model.address, self._data.address, out)
        return out

    def _set_state(self, angle: FloatArray, velocity: FloatArray) -> None:
        n = self.joints
        self._state[:n] = angle
        self._state[n : 2 * n] = velocity
        self._state[2 * n :] = self.internal

    def advance(
        self,
        before: tuple[FloatArray, FloatArray],
        after: tuple[FloatArray, FloatArray],
        drive: FloatArray,
        next_drive: FloatArray,
        period: float,
        last_drive: FloatArray | None = None,
        span: tuple[float, float] = WHOLE,
    ) -> None:
        """Advance the internal states over one tick, as long as `period` (s), or over a part of it.

        before, after: joint angles and velocities at the ends of the part; drives as for `torque` at the tick's start.
        span: the part. Raises SolveError.
        """
        if self.internal.size == 0:
            return
        data, period = self._data, period * (span[1] - span[0])
        data.period[0] = period
        (data.angles_before[:], data.velocities_before[:]), (data.angles_after[:], data.velocities_after[:]) = (
            before,
            after,
        )
        inputs = tick_input(last_drive, drive, next_drive, span)
        give_inputs(self._problem, inputs)
        scale = self.model.layout.state_scales
        status = solve_tick(self._method, self._problem, self._control, scale, self.internal, period)
        if status != DONE:
            raise SolveError(f"{self.model.limb.file}: the muscles cannot be advanced: {FAILURES[status]}")

    def observe(self, angle: FloatArray, velocity: FloatArray, excitation: FloatArray) -> tuple[FloatArray, FloatArray]:
        """What muscles [muscles, MUSCLE_OUTPUTS] and units [units, UNIT_OUTPUTS] show; see also `shown`.

        Both arrays are used again by the next call.
        """
        self._set_state(angle, velocity)
        model = self.model
        records = model.layout.model.address, self._data.address
        model.program.observe(self._state, excitation, *records, self._muscles, self._crossings, self._units)
        return self._muscles, self._units

    def look(self) -> bool:
        """Judge the lengths of the muscles at the last `torque`; whether one leaves its range for the first time."""
        return self.ranges.look(self._row)

    def fault(self) -> str:
        """In words, what of the muscles is not finite in the state of the last torque; "" if it is not known."""
        return fault_of(self.model, self._state, self._data, np.zeros_like(self._data.scratch))


class Impact(NamedTuple):
    """What has struck a limb within a tick: joints that have reached the ends of their ranges.

    time: since the tick's start (s). angle: of the joints (rad) [n]. before, after: their velocities (rad/s) [n].
    """

    time: float
    angle: FloatArray
    before: FloatArray
    after: FloatArray


class LimbStepper:
    """The chain of segments under torques with slopes.

    asks: whether a step ends behind an impact, to ask for the torque there. angle, velocity: of the joints [n] at the
    current tick. load: tip force x, y (N), tip torque (N m). command: torque on the joints [n] beside that of the
    muscles, the same during a tick (N m).
    """

    def __init__(self, limb: Limb, asks: bool = False) -> None:
        self.model = WholeModel(limb)
        self.joints = n = self.model.layout.joints
        state = self.model.initial_state()[: 2 * n]
        self._state: FloatArray = state.copy()
        self._scale = self.model.state_scale[: 2 * n]
        self._rates = np.empty(2 * n)
        self.command = np.zeros(n)
        self._control = tick_control()
        self._struck = np.empty(2 * n)
        self._control.struck[0] = self._struck.ctypes.data
        # How far into the tick the limb is (s), and what holds until its end.
        self._passed = self._period = 0.0
        # What the last step expects of the next torque; empty if it says nothing.
        self._expected: FloatArray = np.empty(n)
        self._predicted = NO_TIMES
        self._start()
        self._rehearse(state)
        self._control.jolt[0] = JOLT if asks else 0.0

    def _start(self) -> None:
        """Fresh data, and the chain alone as a problem of it."""
        model = self.model
        self._data = model.new_data(1.0)
        self._problem = new_problem(2 * self.joints, model.program.limb_rates_c.address, model.layout.model, self._data)
        model.limit(self._problem, self._data)

    def _rehearse(self, start: FloatArray) -> None:
        """Do what a tick does, so that it is compiled and loaded before the first."""
        torque = np.zeros((2 + 2 * self.joints, self.joints))
        self.acceleration(torque)
        self.step(torque, REHEARSAL)
        self.step(torque, REHEARSAL)
        self._state[:] = start
        self._start()
        self._predicted = NO_TIMES

    @property
    def angle(self) -> FloatArray:
        """Joint angles [n], rad."""
        return self._state[: self.joints]

    @property
    def velocity(self) -> FloatArray:
        """Joint velocities [n], rad/s."""
        return self._state[self.joints :]

    @property
    def load(self) -> FloatArray:
        """Force (N) and torque (N m) of the environment on the tip: x, y, torque."""
        load: FloatArray = self._data.load
        return load

    @property
    def remembered(self) -> FloatArray:
        """All that the next steps depend on [4 n + 4]; `remember` takes it.

        Joint states, the torque that is expected, which joints are locked, the load, and whether a torque is expected.
        """
        expects = self._predicted.size > 0
        expected = self._predicted if expects else np.zeros(self.joints)
        return np.concatenate([self._state, expected, self._data.locked, self.load, [float(expects)]])

    def remember(self, values: FloatArray) -> None:
        """Go on from what another stepper of the same limb remembered."""
        n = self.joints
        self._state[:], self._expected[:] = values[: 2 * n], values[2 * n : 3 * n]
        self._data.locked[:], self.load[:] = values[3 * n : 4 * n], values[4 * n : 4 * n + 3]
        self._predicted = self._expected if values[-1] else NO_TIMES

    def acceleration(self, torque: FloatArray) -> FloatArray:
        """Joint accelerations [n] (rad/s^2) at the current tick under rows of torque [2 + 2 n, n]."""
        data, model = self._data, self.model
        hold(self._commanded(torque), self._state, NO_TIMES, 1.0, data.held)
        model.program.limb_rates(0.0, self._state, NO_ROWS, model.layout.model.address, data.address, self._rates)
        return self._rates[self.joints :].copy()

    def step(self, torque: FloatArray, period: float) -> Impact | None:
        """Advance by `period` (s) under torque and slopes [2 + 2 n, n], or until an impact if the stepper asks.

        `go_on` must follow then. Raises SolveError.
        """
        predicted = self._predicted + self.command if self._predicted.size else self._predicted
        self._passed, self._period = 0.0, period
        return self._advance(torque, predicted)

    def go_on(self, torque: FloatArray) -> Impact | None:
        """Go on behind an impact, under the torque and slopes there, until the tick's end or the next impact."""
        return self._advance(torque, NO_TIMES)

    def _advance(self, torque: FloatArray, predicted: FloatArray) -> Impact | None:
        """The rest of a tick."""
        data, n = self._data, self.joints
        rest = self._period - self._passed
        hold(self._commanded(torque), self._state, predicted, rest, data.held)
        before = data.locked.copy()
        how = EXPLICIT.limited if self.model.limited else EXPLICIT.free
        status = solve_tick(how, self._problem, self._control, self._scale, self._state, rest)
        if status == STRUCK:
            self._predicted = NO_TIMES
            self._passed = min(self._passed + float(self._control.time[0]), self._period * (1.0 - LEAST_REST))
            return Impact(self._passed, self.angle.copy(), self._struck[n:].copy(), self.velocity.copy())
        if status != DONE:
            raise SolveError(f"{self.model.limb.file}: the limb cannot be advanced: {FAILURES[status]}")
        # An impact bends the torque at once, which tells nothing about the tick that follows.
        if same(data.locked, before) and not self._passed:
            predict(data.held, self._state, rest, self._expected)
            # What is expected is of the muscles alone: a command may change at any tick.
            self._expected -= self.command
            self._predicted = self._expected
        else:
            self._predicted = NO_TIMES
        return None

    def _commanded(self, torque: FloatArray) -> FloatArray:
        """Rows of torque [2 + 2 n, n] of muscles and command."""
        both = torque.copy()
        both[0] += self.command
        return both


def tick_input(
    last_drive: FloatArray | None, drive: FloatArray, next_drive: FloatArray, span: tuple[float, float]
) -> FloatArray:
    """The input over one tick, or over a part of it."""
    piece: FloatArray = straight(drive, next_drive) if last_drive is None else bent(last_drive, drive, next_drive)
    return piece if span == WHOLE else np.asarray(part_of(piece, *span))
