"""The whole-model solve: one system of differential equations, no ROS."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from types import ModuleType

import numpy as np

from limb_nodes.errors import UserError
from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.model.layout import Layout, build_layout
from limb_nodes.model.limb import Limb
from limb_nodes.solve import limits
from limb_nodes.solve.compile import compiled
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

ANGLE_SCALE, VELOCITY_SCALE = 1.0, 10.0
TOLERANCE = 1e-9
LONGEST_STEP = 0.1
# Samples from which a table of the drives costs less than their laws, and from which it does although it has to be
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


class WholeModel:
    """A limb ready to be solved.

    once: whether for one solve only, before which as little as possible is to be compiled.
    limits: offset of the joint limits in the parameters. state_scale: [2 n + internal states].
    """

    def __init__(self, limb: Limb, *, once: bool = False) -> None:
        self.limb = limb
        self.table_pays = TABLE_PAYS_ONCE if once else TABLE_PAYS
        self.layout: Layout = build_layout(limb)
        self.program: ModuleType = compiled(self.layout)
        n = self.layout.joints
        self.limit_offset = 3 + n * n + 2 * n
        self.state_scale: FloatArray = np.concatenate(
            [
                np.full(n, ANGLE_SCALE),
                np.full(n, VELOCITY_SCALE),
                self.layout.state_scales,
            ]
        )

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

    def context(self, start: float, period: float) -> FloatArray:
        """Fresh scratch with the limb's load, for input samples every `period` s from `start`."""
        c = np.zeros(self.program.CONTEXT)
        c[:5] = [start, period, *self.limb.tip_force, self.limb.tip_torque]
        return c

    def slopes(self, state: FloatArray, excitation: FloatArray) -> FloatArray:
        """Slopes of the rates [states, states] (Jacobian) at a state under excitations [muscles]."""
        size = state.size
        out = np.empty(size * (size + 1))
        u = pieces(self.drives(excitation[np.newaxis, :]))
        layout = self.layout
        self.program.jacobian(0.0, state, layout.parameters, layout.index, u, self.context(0.0, 1.0), out)
        return out[: size * size].reshape(size, size)

    def stiffness(self) -> float:
        """Fastest rate (1/s) of the limb at its start with all muscles fully excited.

        By differences: the program of the exact slopes need not be compiled to find that it is not
        needed.
        """
        state, layout = self.initial_state(), self.layout
        slopes = np.empty((state.size, state.size))
        inputs = pieces(self.drives(np.ones((1, layout.muscles))))
        difference_slopes(
            self.program.rates_c.address,
            state,
            layout.parameters,
            layout.index,
            inputs,
            self.context(0.0, 1.0),
            self.state_scale,
            slopes,
        )
        return float(np.abs(np.linalg.eigvals(slopes)).max())

    @cached_property
    def suited_method(self) -> str:
        """The implicit method where stability would hold the explicit one to small steps."""
        return "implicit" if self.stiffness() > STIFF else "explicit"

    @cached_property
    def limited(self) -> bool:
        """Whether a joint has a limit."""
        return any(segment.joint_range is not None for segment in self.limb.segments)

    def drives(self, excitation: FloatArray) -> FloatArray:
        """What the input [T, muscles] does to muscles and motor units [T, drives]."""
        given = np.ascontiguousarray(excitation, dtype=np.float64)
        if len(given) >= self.table_pays:
            found: FloatArray = self.drive_table.look_up(given)
            return found
        out = np.zeros((len(given), self.layout.drives))
        self.program.drives(given, self.layout.parameters, self.layout.index, out)
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
        observe: whether to fill in accelerations and what muscles and motor units show; where not,
            those have no rows.
        Raises SolveError where the equations cannot be solved further.
        """
        period = 1.0 / rate
        times: FloatArray = np.arange(len(excitation), dtype=np.float64) * period
        samples = self.drives(excitation)
        inputs, stops = prepared(samples, period)
        context = self.context(0.0, period)
        states, steps = self.solve(times, inputs, stops, context, tolerance, method)
        n, layout = self.layout.joints, self.layout
        shown = len(times) if observe else 0
        acceleration = np.empty((shown, n))
        muscle = np.zeros((shown, layout.muscles, len(MUSCLE_OUTPUTS)))
        unit = np.zeros((shown, layout.units, len(UNIT_OUTPUTS)))
        if observe:
            self.accelerations(times, states, inputs, context, acceleration)
            self.program.observe_all(
                states,
                np.ascontiguousarray(excitation, dtype=np.float64),
                layout.parameters,
                layout.index,
                context,
                muscle,
                unit,
            )
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

    def solve(
        self,
        times: FloatArray,
        inputs: FloatArray,
        stops: FloatArray,
        context: FloatArray,
        tolerance: float,
        method: str,
    ) -> tuple[FloatArray, tuple[int, int]]:
        """States [T, states] at given times, and the accepted and rejected steps.

        inputs: pieces of the drives. stops: times of corners. method: as for `simulate`.
        Raises SolveError.
        """
        state = self.initial_state()
        out = np.empty((len(times), state.size))
        progress = np.zeros(4)
        chosen = METHODS[self.suited_method if method == "auto" else method]
        layout, program, limited = self.layout, self.program, self.limited
        status = integrate(
            chosen.addresses,
            limits.addresses() if limited else limits.NO_LIMITS,
            program.rates_c.address,
            program.jacobian_c.address if chosen is IMPLICIT else 0,
            program.reactions_c.address if limited else 0,
            program.strike_c.address if limited else 0,
            times[0],
            times[-1],
            state,
            times,
            out,
            self.state_scale,
            layout.parameters,
            layout.index,
            inputs,
            context,
            layout.joints if limited else 0,
            self.limit_offset,
            program.LOCKED,
            stops,
            tolerance,
            LONGEST_STEP,
            progress,
        )
        if status != DONE:
            raise SolveError(f"{self.limb.file}: the solution stops at {progress[2]:.6g} s: {FAILURES[status]}")
        return out, (int(progress[0]), int(progress[1]))

    def accelerations(
        self, times: FloatArray, states: FloatArray, inputs: FloatArray, context: FloatArray, out: FloatArray
    ) -> None:
        """Fill in joint accelerations out [T, n] of solved states."""
        layout, n = self.layout, self.layout.joints
        limits = layout.parameters[self.limit_offset : self.limit_offset + 2 * n]
        self.program.accelerations(
            times, states, layout.parameters, layout.index, inputs, context, limits[:n], limits[n:], out
        )


def prepared(samples: FloatArray, period: float) -> tuple[FloatArray, FloatArray]:
    """Pieces of sampled drives [T, drives], and the times (s) of the samples at which one has a corner.

    A step of high order must not cross such a time: it would not notice.
    """
    sharp = corners(samples)
    rows = np.unique(np.flatnonzero(sharp) // max(1, samples.shape[1]))
    return pieces(samples, sharp), rows.astype(np.float64) * period
