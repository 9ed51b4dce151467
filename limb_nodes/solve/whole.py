"""The whole-model solve: one system of differential equations, no ROS."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property, partial
from types import ModuleType
from typing import Any

import numpy as np

from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.foundation.records import Record
from limb_nodes.model.chain import LOWEST
from limb_nodes.model.layout import Layout, build_layout
from limb_nodes.model.limb import Limb
from limb_nodes.solve.compile import compiled
from limb_nodes.solve.course import Course, Input, Stretch, stretches
from limb_nodes.solve.data import data_type
from limb_nodes.solve.delay import delayed, delays_of, refuse_long_delays
from limb_nodes.solve.drive_table import DriveTable
from limb_nodes.solve.failure import FAILURES, SolveError, where
from limb_nodes.solve.integrate import NOT_FINITE
from limb_nodes.solve.outputs import CROSSING_OUTPUTS, MUSCLE_OUTPUTS, UNIT_OUTPUTS
from limb_nodes.solve.pieces import pieces
from limb_nodes.solve.problem import new_problem
from limb_nodes.solve.stiffness import STIFF, stiffness_of

ANGLE_SCALE, VELOCITY_SCALE = 1.0, 10.0
TOLERANCE = 1e-9
# Samples from which a table of the drives costs less than their laws, and from which it does so even if it has to be
# compiled for one solve.
TABLE_PAYS = 2_000
TABLE_PAYS_ONCE = 1_000_000
# Numbers of a part of a movement that is solved piece by piece, and most of its instants.
PART, LONGEST_PART = 2**18, 2048


@dataclass(frozen=True)
class Movement:
    """A solved movement of T instants, n joints.

    time: s [T]. angle, velocity, acceleration: rad, rad/s, rad/s^2 [T, n].
    internal: internal states [T, states], named by `state_names`.
    excitation: [T, muscles]. steps: accepted and rejected steps of the integrator.
    muscle: by name of `MUSCLE_OUTPUTS` [T, muscles], and of `CROSSING_OUTPUTS` [T, crossings of muscles and joints], in
        the order of `Limb.crossings`.
    unit: by name of `UNIT_OUTPUTS` [T, units].
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

    def until(self, row: int) -> Movement:
        """Its first rows."""
        cut: dict[str, Any] = {name: value[:row] for name, value in vars(self).items() if isinstance(value, np.ndarray)}
        muscle, unit = ({name: value[:row] for name, value in of.items()} for of in (self.muscle, self.unit))
        return replace(self, **cut, muscle=muscle, unit=unit)


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
        """Fastest rate (1/s) of the limb at its start, as `stiffness_of` looks for it."""
        data = self.new_data(1.0)
        given = self.initial_state(), self.state_scale, self.layout.states, self.equal_drives
        return stiffness_of(self.problem(data), *given)

    def equal_drives(self, excitation: float) -> FloatArray:
        """The drives [1, drives] if all muscles are equally excited."""
        return self.drives(np.full((1, self.layout.muscles), excitation))

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
        return self._drives(excitation, len(excitation))

    def _drives_of(self, excitation: Input, delays: FloatArray, start: int, end: int) -> FloatArray:
        """The drives of a part of an input, as it reaches the muscles."""
        return self._drives(delayed(excitation, delays, start, end), len(excitation))

    def _drives(self, excitation: FloatArray, count: int) -> FloatArray:
        """The drives of a part of an input of `count` samples."""
        given = np.ascontiguousarray(excitation, dtype=np.float64)
        if count >= self.table_pays:
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
        excitation: Input,
        rate: float,
        *,
        tolerance: float = TOLERANCE,
        method: str = "auto",
        observe: bool = True,
    ) -> Movement:
        """Solve over the span of an input.

        excitation: [T, muscles], sampled at `rate` Hz from t = 0, before the muscles' delays; what it does to the
            motor units is smooth between samples, but for corners (`limb_nodes.solve.pieces`).
        tolerance: of the local error, relative to the state or its typical size.
        method: "explicit", "implicit", or "auto", which chooses by `stiffness`.
        observe: whether to fill in accelerations and what muscles and motor units show; if not,
            those have no rows.
        Raises SolveError if the equations cannot be solved further, UserError if a delay is longer than the input.
        """
        (movement,) = self._parts(excitation, rate, len(excitation), tolerance, method, observe)
        return movement

    def simulate_in_parts(
        self,
        excitation: Input,
        rate: float,
        *,
        tolerance: float = TOLERANCE,
        method: str = "auto",
        observe: bool = True,
    ) -> Iterator[Movement]:
        """The movement of `simulate`, the same numbers, in parts one after another, which do not grow with its length.

        Of each part, `steps` are those from the start on. Raises SolveError behind the last instant that was reached.
        """
        layout = self.layout
        shown = layout.muscles * len(MUSCLE_OUTPUTS) + layout.units * len(UNIT_OUTPUTS)
        shown += layout.crossings * len(CROSSING_OUTPUTS)
        numbers = 4 * self.state_scale.size + 4 * layout.drives + (2 * shown if observe else 0)
        return self._parts(excitation, rate, min(LONGEST_PART, PART // numbers + 1), tolerance, method, observe)

    def _parts(
        self, excitation: Input, rate: float, rows: int, tolerance: float, method: str, observe: bool
    ) -> Iterator[Movement]:
        """The movement in parts of so many instants, or somewhat more."""
        period, count = 1.0 / rate, len(excitation)
        refuse_long_delays(self.limb, (count - 1) * period)
        delays = delays_of(self.limb, rate)
        course = Course(self, (count - 1) * period, period, tolerance, method)
        # The search for the fibre force starts at that of the instant before: two records, each for one kind of search.
        seen = self.new_data(period), self.new_data(period)
        drives = partial(self._drives_of, excitation, delays)
        done = 0
        for stretch, pause in stretches(drives, count, period, rows, course):
            states = course.advance(stretch, pause)
            given = excitation[done : done + len(states)]
            reaching = delayed(excitation, delays, done, done + len(states)) if delays.any() else given
            done += len(states)
            if len(states):
                movement = self._movement(stretch, states, given, reaching, seen if observe else (), course.steps)
                # Finite states may have a rate that is not, which no step has met.
                unknown = np.flatnonzero(~np.isfinite(movement.acceleration).all(axis=1))
                if unknown.size:
                    if unknown[0]:
                        yield movement.until(unknown[0])
                    at, data = float(movement.time[unknown[0]]), self.new_data(period)
                    data.first[0] = stretch.first
                    part = where(self, NOT_FINITE, at, states[unknown[0]], stretch.inputs, data)
                    text = f"the solution stops at {at:.6g} s: {FAILURES[NOT_FINITE]}{part}"
                    raise SolveError(f"{self.limb.file}: {text}")
                yield movement
        if course.failure is not None:
            raise course.failure

    def _movement(
        self,
        stretch: Stretch,
        states: FloatArray,
        excitation: FloatArray,
        reaching: FloatArray,
        seen: tuple[Record, ...],
        steps: tuple[int, int],
    ) -> Movement:
        """The states [T, states] from the first time of a stretch on as a movement.

        reaching: the excitation as it reaches the muscles. seen: data to observe them with.
        """
        n, layout, times = self.layout.joints, self.layout, stretch.times[: len(states)]
        shown = len(states) if seen else 0
        acceleration = np.empty((shown, n))
        muscle = np.zeros((shown, layout.muscles, len(MUSCLE_OUTPUTS)))
        crossing = np.zeros((shown, layout.crossings, len(CROSSING_OUTPUTS)))
        unit = np.zeros((shown, layout.units, len(UNIT_OUTPUTS)))
        if seen:
            moving, still = seen
            moving.first[0] = stretch.first
            self.program.accelerations(
                times, states, stretch.inputs, layout.model.address, moving.address, acceleration
            )
            given = np.ascontiguousarray(reaching, dtype=np.float64)
            records = layout.model.address, still.address
            self.program.observe_all(states, given, *records, muscle, crossing, unit)
        return Movement(
            time=times,
            angle=states[:, :n],
            velocity=states[:, n : 2 * n],
            acceleration=acceleration,
            internal=states[:, 2 * n :],
            state_names=layout.state_names,
            excitation=excitation,
            muscle={
                name: table[:, :, i]
                for table, names in ((muscle, MUSCLE_OUTPUTS), (crossing, CROSSING_OUTPUTS))
                for i, name in enumerate(names)
            },
            unit={name: unit[:, :, i] for i, name in enumerate(UNIT_OUTPUTS)},
            steps=steps,
        )

    def solve(
        self, stretch: Stretch, tolerance: float, method: str, may_change: bool
    ) -> tuple[FloatArray, tuple[int, int]]:
        """States [T, states] at the times of a stretch, and the accepted and rejected steps.

        tolerance, method: as for `simulate`. may_change: as for `Course`. Raises SolveError.
        """
        course = Course(self, float(stretch.times[-1]), stretch.period, tolerance, method, may_change)
        states = course.advance(stretch)
        if course.failure is not None:
            raise course.failure
        return states, course.steps
