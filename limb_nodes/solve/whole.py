"""The whole-model solve: one system of differential equations, no ROS."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np

from limb_nodes.errors import UserError
from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.foundation.records import Record
from limb_nodes.model.chain import LOWEST
from limb_nodes.model.layout import Layout, build_layout
from limb_nodes.model.limb import Limb
from limb_nodes.solve.compile import compiled
from limb_nodes.solve.data import data_type
from limb_nodes.solve.drive_table import DriveTable
from limb_nodes.solve.explicit import EXPLICIT
from limb_nodes.solve.implicit import IMPLICIT
from limb_nodes.solve.integrate import (
    DONE,
    NOT_FINITE,
    STEP_TOO_SMALL,
    TOO_MANY_STEPS,
    difference_slopes,
    integrate,
)
from limb_nodes.solve.outputs import MUSCLE_OUTPUTS, UNIT_OUTPUTS
from limb_nodes.solve.pieces import corners, pieces
from limb_nodes.solve.problem import CONTROL, give_inputs, new_problem

ANGLE_SCALE, VELOCITY_SCALE = 1.0, 10.0
TOLERANCE = 1e-9
LONGEST_STEP = 0.1
# Samples from which a table of the drives costs less than their laws, and from which it does so even if it has to be
# compiled for one solve.
TABLE_PAYS = 2_000
TABLE_PAYS_ONCE = 1_000_000
METHODS = {"explicit": EXPLICIT, "implicit": IMPLICIT}
# Rate (1/s) from which steps that accuracy allows would be unstable with the explicit method.
STIFF = 2000.0
FAILURES = {
    TOO_MANY_STEPS: "it needs too many steps",
    STEP_TOO_SMALL: "the step became too small",
    NOT_FINITE: "a rate is not a finite number",
}


class SolveError(UserError):
    """The equations could not be solved further; says when and why."""


@dataclass(frozen=True)
class Movement:
    """A solved movement of T instants, n joints.

    time: s [T]. angle, velocity, acceleration: rad, rad/s, rad/s^2 [T, n].
    internal: internal states [T, states], named by `state_names`.
    excitation: [T, muscles]. steps: accepted and rejected steps of the integrator.
    muscle: by name of `MUSCLE_OUTPUTS` [T, muscles]. unit: by name of `UNIT_OUTPUTS` [T, units].
    """

    time: FloatArray
    angle: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    internal: FloatArray
    state_names: tuple[str, ...]
    excitation: FloatArray
    muscle: dict[str, FloatArray]
    unit: dict[str, FloatArray]
    steps: tuple[int, int]


class Stretch(NamedTuple):
    """A part of a movement that is to be solved.

    times: s [T], rising, at which the states are wanted. inputs: pieces of the drives [rows, 4 drives], the first
    from 0 s on. stops: times (s) of their corners. period: of a piece (s).
    """

    times: FloatArray
    inputs: FloatArray
    stops: FloatArray
    period: float


class WholeModel:
    """A limb ready to be solved.

    once: whether for one solve only, before which as little as possible is to be compiled.
    layout: the limb as arrays. program: the compiled functions for it. state_scale: [2 n + internal states].
    """

    def __init__(self, limb: Limb, *, once: bool = False) -> None:
        layout = build_layout(limb)
        self._adopt(layout, compiled(layout), TABLE_PAYS_ONCE if once else TABLE_PAYS)

    def _adopt(self, layout: Layout, program: ModuleType, table_pays: int) -> None:
        self.limb, self.layout, self.program, self.table_pays = layout.limb, layout, program, table_pays
        n = layout.joints
        self.state_scale: FloatArray = np.concatenate(
            [np.full(n, ANGLE_SCALE), np.full(n, VELOCITY_SCALE), layout.state_scales]
        )

    def sibling(self, layout: Layout) -> WholeModel:
        """The model of another limb of the same structure, with this one's program."""
        other = WholeModel.__new__(WholeModel)
        other._adopt(layout, self.program, self.table_pays)
        return other

    def initial_state(self) -> FloatArray:
        """Joint angles, joint velocities and internal states at the start."""
        segments = self.limb.segments
        return np.concatenate(
            [
                [segment.angle for segment in segments],
                [segment.velocity for segment in segments],
                self.layout.initial_states,
            ]
        )

    @cached_property
    def data_type(self) -> np.dtype[Any]:
        """The type of the limb's data."""
        return data_type(self.layout)

    def new_data(self, period: float) -> Record:
        """Fresh data with the limb's load, for input samples every `period` s."""
        data = Record(self.data_type)
        data.period[0] = period
        data.load[:] = [*self.limb.tip_force, self.limb.tip_torque]
        return data

    def problem(self, data: Record, *, jacobian: bool = False) -> Record:
        """The whole limb as a problem of the integrators; `give_inputs` must follow.

        jacobian: whether the slopes of the rates are needed too. The caller keeps `data` alive.
        """
        program = self.program
        problem = new_problem(self.state_scale.size, program.rates_c.address, self.layout.model, data)
        problem.jacobian[0] = program.jacobian_c.address if jacobian else 0
        self.limit(problem, data)
        return problem

    def limit(self, problem: Record, data: Record) -> None:
        """Let the joints of a problem have their limits, if the limb has some."""
        if self.limited:
            lowest = self.layout.model.segments[LOWEST]
            problem.joints[0] = self.layout.joints
            problem.limits[0], problem.locked[0] = lowest.ctypes.data, data.locked.ctypes.data
            problem.reactions[0], problem.strike[0] = self.program.reactions_c.address, self.program.strike_c.address

    def right_hand_side(self, inputs: FloatArray, period: float) -> Callable[[float, FloatArray], FloatArray]:
        """The rates [states] as a function of time (s) and state [states].

        inputs: pieces of the drives [rows, 4 drives], each as long as `period` (s).
        """
        data, model, program = self.new_data(period), self.layout.model, self.program

        def rates(t: float, y: FloatArray) -> FloatArray:
            out = np.empty(y.size)
            program.rates(t, np.ascontiguousarray(y), inputs, model.address, data.address, out)
            return out

        return rates

    def slopes(self, state: FloatArray, excitation: FloatArray) -> FloatArray:
        """Slopes of the rates [states, states] (Jacobian) at a state under excitations [muscles]."""
        out = np.empty((state.size + 1, state.size))
        inputs = pieces(self.drives(excitation[np.newaxis, :]))
        data = self.new_data(1.0)
        self.program.jacobian(0.0, state, inputs, self.layout.model.address, data.address, out)
        return out[:-1].T

    def stiffness(self) -> float:
        """Fastest rate (1/s) of the limb at its start with all muscles fully excited.

        By differences: the program of the exact slopes need not be compiled to find that it is not
        needed.
        """
        state = self.initial_state()
        slopes = np.empty((state.size, state.size))
        inputs = pieces(self.drives(np.ones((1, self.layout.muscles))))
        data = self.new_data(1.0)
        problem = self.problem(data)
        give_inputs(problem, inputs)
        difference_slopes(problem.address, state, self.state_scale, slopes)
        return float(np.abs(np.linalg.eigvals(slopes)).max())

    @cached_property
    def suited_method(self) -> str:
        """The implicit method if stability would hold the explicit one to small steps."""
        return "implicit" if self.stiffness() > STIFF else "explicit"

    @cached_property
    def limited(self) -> bool:
        """Whether a joint has a limit."""
        return any(segment.joint_range is not None for segment in self.limb.segments)

    def drives(self, excitation: FloatArray) -> FloatArray:
        """What the input [T, muscles] does to muscles and motor units [T, drives]."""
        given = np.ascontiguousarray(excitation, dtype=np.float64)
        if len(given) >= self.table_pays:
            return self.drive_table.look_up(given)
        out = np.zeros((len(given), self.layout.drives))
        self.program.drives(given, self.layout.model.address, out)
        return out

    @cached_property
    def drive_table(self) -> DriveTable:
        """The drives over the excitation, for long inputs."""
        program = self.program
        return DriveTable(self.layout, program.unit_drive_c, program.muscle_drive_c)

    def simulate(
        self,
        excitation: FloatArray,
        rate: float,
        *,
        tolerance: float = TOLERANCE,
        method: str = "auto",
        observe: bool = True,
    ) -> Movement:
        """Solve over the span of an input.

        excitation: [T, muscles], sampled at `rate` Hz from t = 0; what it does to the motor units
            is smooth between samples, but for corners (`limb_nodes.solve.pieces`).
        tolerance: of the local error, relative to the state or its typical size.
        method: "explicit", "implicit", or "auto", which chooses by `stiffness`.
        observe: whether to fill in accelerations and what muscles and motor units show; if not,
            those have no rows.
        Raises SolveError if the equations cannot be solved further.
        """
        period = 1.0 / rate
        times: FloatArray = np.arange(len(excitation), dtype=np.float64) * period
        stretch = Stretch(times, *prepared(self.drives(excitation), period), period)
        states, steps = self.solve(stretch, tolerance, method)
        n, layout = self.layout.joints, self.layout
        shown = len(times) if observe else 0
        acceleration = np.empty((shown, n))
        muscle = np.zeros((shown, layout.muscles, len(MUSCLE_OUTPUTS)))
        unit = np.zeros((shown, layout.units, len(UNIT_OUTPUTS)))
        if observe:
            data = self.new_data(period)
            records = layout.model.address, data.address
            self.program.accelerations(times, states, stretch.inputs, *records, acceleration)
            given = np.ascontiguousarray(excitation, dtype=np.float64)
            self.program.observe_all(states, given, *records, muscle, unit)
        return Movement(
            time=times,
            angle=states[:, :n],
            velocity=states[:, n : 2 * n],
            acceleration=acceleration,
            internal=states[:, 2 * n :],
            state_names=layout.state_names,
            excitation=excitation,
            muscle={name: muscle[:, :, i] for i, name in enumerate(MUSCLE_OUTPUTS)},
            unit={name: unit[:, :, i] for i, name in enumerate(UNIT_OUTPUTS)},
            steps=steps,
        )

    def solve(self, stretch: Stretch, tolerance: float, method: str) -> tuple[FloatArray, tuple[int, int]]:
        """States [T, states] at the times of a stretch, and the accepted and rejected steps.

        tolerance, method: as for `simulate`. Raises SolveError.
        """
        state = self.initial_state()
        out = np.empty((len(stretch.times), state.size))
        chosen = METHODS[self.suited_method if method == "auto" else method]
        data = self.new_data(stretch.period)
        problem = self.problem(data, jacobian=chosen.implicit)
        give_inputs(problem, stretch.inputs)
        control = Record(CONTROL)
        control.start[0], control.end[0] = stretch.times[0], stretch.times[-1]
        control.tolerance[0], control.longest[0] = tolerance, LONGEST_STEP
        how = chosen.limited if self.limited else chosen.free
        status = integrate(
            how.address, problem.address, control.address, stretch.stops, self.state_scale, state, stretch.times, out
        )
        if status != DONE:
            raise SolveError(f"{self.limb.file}: the solution stops at {control.time[0]:.6g} s: {FAILURES[status]}")
        return out, (int(control.steps[0]), int(control.rejected[0]))


def prepared(samples: FloatArray, period: float) -> tuple[FloatArray, FloatArray]:
    """Pieces of sampled drives [T, drives], and the times (s) of the samples at which one has a corner.

    A step of high order must not cross such a time: it would not notice.
    """
    sharp = corners(samples)
    rows = np.unique(np.flatnonzero(sharp) // max(1, samples.shape[1]))
    return pieces(samples, sharp), rows.astype(np.float64) * period
