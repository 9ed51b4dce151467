"""The steps that the nodes take: muscles on one side, the chain of segments on the other.

Both sides meet at ticks. The muscles give the torque at a tick with its slopes in joint angle,
joint velocity and time; the chain advances under that linear model; the muscles then advance
their internal states along the cubic through the joint states of both ticks. By how much the
linear model of one tick missed the torque of the next tells the curvature, which the chain takes
along into the next tick.
"""

from __future__ import annotations

import numpy as np

from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.model.limb import Limb
from limb_nodes.solve import limits
from limb_nodes.solve.explicit import EXPLICIT
from limb_nodes.solve.integrate import DONE, integrate
from limb_nodes.solve.outputs import MUSCLE_OUTPUTS, UNIT_OUTPUTS
from limb_nodes.solve.pieces import bent, straight
from limb_nodes.solve.small import hold, predict, same
from limb_nodes.solve.whole import FAILURES, SolveError, WholeModel

TICK_TOLERANCE = 1e-9
NO_TIMES = np.empty(0)
# A tick of the rehearsal (s).
REHEARSAL = 1e-3
NO_ROWS = np.empty((0, 0))


class MuscleStepper:
    """All muscles of a limb between joint states and torques.

    internal: internal states, at the tick of the last joint state.
    """

    def __init__(self, limb: Limb) -> None:
        self.model = WholeModel(limb)
        layout = self.model.layout
        self.joints = layout.joints
        self.internal: FloatArray = layout.initial_states.copy()
        self._scale = layout.state_scales
        self._context = self.model.context(0.0, 1.0)
        self._state = np.zeros(2 * layout.joints + layout.states)
        self._muscles = np.zeros((layout.muscles, len(MUSCLE_OUTPUTS)))
        self._units = np.zeros((layout.units, len(UNIT_OUTPUTS)))
        self._progress = np.zeros(4)
        self._rehearse()

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
        self.internal[:] = layout.initial_states
        self._context = self.model.context(0.0, 1.0)

    @property
    def shown(self) -> tuple[FloatArray, FloatArray]:
        """The arrays that `observe` fills in."""
        return self._muscles, self._units

    def drive(self, excitation: FloatArray) -> FloatArray:
        """What excitations [muscles] do to muscles and motor units [drives]."""
        found: FloatArray = self.model.drives(excitation[np.newaxis, :])[0]
        return found

    def torque(
        self,
        angle: FloatArray,
        velocity: FloatArray,
        drive: FloatArray,
        next_drive: FloatArray,
        period: float,
        last_drive: FloatArray | None = None,
    ) -> FloatArray:
        """Torque [n] (N m) and its slopes in angle, velocity and time, rows of [4, n].

        drive, next_drive: at this tick and one `period` (s) later. last_drive: one period before,
        where it is known; the input is then a parabola instead of a straight line.
        """
        n, program = self.joints, self.model.program
        self._state[:n] = angle
        self._state[n : 2 * n] = velocity
        self._state[2 * n :] = self.internal
        self._context[:2] = 0.0, period
        out = np.empty((4, n))
        layout = self.model.layout
        program.torque_slopes(
            self._state,
            layout.parameters,
            layout.index,
            interval(last_drive, drive, next_drive),
            self._context,
            out,
        )
        return out

    def advance(
        self,
        before: tuple[FloatArray, FloatArray],
        after: tuple[FloatArray, FloatArray],
        drive: FloatArray,
        next_drive: FloatArray,
        period: float,
        last_drive: FloatArray | None = None,
    ) -> None:
        """Advance the internal states over one `period` (s).

        before, after: joint angles and velocities at its ends; drives as for `torque` at its start.
        Raises SolveError.
        """
        if self.internal.size == 0:
            return
        program, layout = self.model.program, self.model.layout
        c = self._context
        c[:2] = 0.0, period
        c[program.CUBIC : program.TORQUE] = np.concatenate([*before, *after])
        self._progress[:3] = 0.0
        self._progress[3] = period
        status = integrate(
            EXPLICIT.addresses,
            limits.NO_LIMITS,
            program.muscle_rates_c.address,
            0,
            0,
            0,
            0.0,
            period,
            self.internal,
            NO_TIMES,
            NO_ROWS,
            self._scale,
            layout.parameters,
            layout.index,
            interval(last_drive, drive, next_drive),
            c,
            0,
            0,
            0,
            NO_TIMES,
            TICK_TOLERANCE,
            period,
            self._progress,
        )
        if status != DONE:
            raise SolveError(f"{self.model.limb.file}: the muscles cannot be advanced: {FAILURES[status]}")

    def observe(self, angle: FloatArray, velocity: FloatArray, excitation: FloatArray) -> tuple[FloatArray, FloatArray]:
        """What muscles [muscles, MUSCLE_OUTPUTS] and units [units, UNIT_OUTPUTS] show.

        Both arrays are used again by the next call.
        """
        n, layout = self.joints, self.model.layout
        self._state[:n] = angle
        self._state[n : 2 * n] = velocity
        self._state[2 * n :] = self.internal
        self.model.program.observe(
            self._state,
            excitation,
            layout.parameters,
            layout.index,
            self._context,
            self._muscles,
            self._units,
        )
        return self._muscles, self._units


class LimbStepper:
    """The chain of segments under torques with slopes.

    angle, velocity: of the joints [n] at the current tick. load: tip force x, y (N), tip torque
    (N m).
    """

    def __init__(self, limb: Limb) -> None:
        self.model = WholeModel(limb)
        n = self.model.layout.joints
        self.joints = n
        state = self.model.initial_state()[: 2 * n]
        self._state: FloatArray = state.copy()
        self._scale = self.model.state_scale[: 2 * n]
        self._context = self.model.context(0.0, 1.0)
        self._rates = np.empty(2 * n)
        self._torque = np.zeros((7, n))
        self._progress = np.zeros(4)
        # What the last step expects of the next torque; empty where it says nothing.
        self._expected: FloatArray = np.empty(n)
        self._predicted = NO_TIMES
        self._rehearse(state)

    def _rehearse(self, start: FloatArray) -> None:
        """Do what a tick does, so that it is compiled and loaded before the first."""
        torque = np.zeros((4, self.joints))
        self.acceleration(torque)
        self.step(torque, REHEARSAL)
        self.step(torque, REHEARSAL)
        self._state[:] = start
        self._context = self.model.context(0.0, 1.0)
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
        return self._context[2:5]

    def acceleration(self, torque: FloatArray) -> FloatArray:
        """Joint accelerations [n] (rad/s^2) at the current tick under rows of torque [4, n]."""
        hold(torque, self._state, NO_TIMES, 1.0, self._torque)
        program, layout = self.model.program, self.model.layout
        program.limb_rates(
            0.0,
            self._state,
            layout.parameters,
            layout.index,
            self._torque,
            self._context,
            self._rates,
        )
        return self._rates[self.joints :].copy()

    def step(self, torque: FloatArray, period: float) -> None:
        """Advance by `period` (s) under torque and slopes [4, n]. Raises SolveError."""
        hold(torque, self._state, self._predicted, period, self._torque)
        program, layout, n = self.model.program, self.model.layout, self.joints
        limited = self.model.limited
        locked = self._context[program.LOCKED : program.LOCKED + n]
        held = locked.copy()
        self._progress[:3] = 0.0
        self._progress[3] = period
        status = integrate(
            EXPLICIT.addresses,
            limits.addresses() if limited else limits.NO_LIMITS,
            program.limb_rates_c.address,
            0,
            program.reactions_c.address if limited else 0,
            program.strike_c.address if limited else 0,
            0.0,
            period,
            self._state,
            NO_TIMES,
            NO_ROWS,
            self._scale,
            layout.parameters,
            layout.index,
            self._torque,
            self._context,
            n if limited else 0,
            self.model.limit_offset,
            program.LOCKED,
            NO_TIMES,
            TICK_TOLERANCE,
            period,
            self._progress,
        )
        if status != DONE:
            raise SolveError(f"{self.model.limb.file}: the limb cannot be advanced: {FAILURES[status]}")
        # An impact bends the torque at once, which tells nothing about the tick that follows.
        if same(locked, held):
            predict(self._torque, self._state, period, self._expected)
            self._predicted = self._expected
        else:
            self._predicted = NO_TIMES


def interval(last_drive: FloatArray | None, drive: FloatArray, next_drive: FloatArray) -> FloatArray:
    """The input over one tick."""
    if last_drive is None:
        found: FloatArray = straight(drive, next_drive)
    else:
        found = bent(last_drive, drive, next_drive)
    return found
