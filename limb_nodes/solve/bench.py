"""A muscle on a bench: the muscle level alone, its length and excitation prescribed.

The program is the one that runs in the whole limb; only the path is replaced, by one whose length
is given.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.optimize import root

from limb_nodes.errors import UserError
from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.levels.muscle.prescribed_path import prescribed
from limb_nodes.levels.sarcomere.lengths import optimal_sarcomere_length
from limb_nodes.model.chosen import ChosenLaw
from limb_nodes.model.layout import build_layout, same_structure
from limb_nodes.model.limb import Limb, Muscle, Segment
from limb_nodes.solve.failure import SolveError
from limb_nodes.solve.outputs import CROSSING_OUTPUTS, MUSCLE_OUTPUTS, UNIT_OUTPUTS
from limb_nodes.solve.pieces import straight
from limb_nodes.solve.ranges import Ranges
from limb_nodes.solve.stepping import MuscleStepper
from limb_nodes.solve.whole import WholeModel

# Nothing moves it and it moves nothing: the program wants a joint for the muscle to cross.
SUPPORT = Segment("bench", "bench", 1.0, 1.0, 0.5, 1.0, 0.0, 0.0, None)

Start = Literal["rest", "steady", "file"]
# A state is steady if it changes by less than this part of its typical size in a second.
STEADY = 1e-9
LONGEST_SETTLING = 1000.0


@dataclass(frozen=True)
class Course:
    """A muscle-tendon length over time, given at some times.

    time: s [knots], rising. length: m [knots]. smooth: a curve without corners and without new
    extremes (piecewise cubic after Fritsch and Carlson) through them instead of straight lines.
    Before the first and after the last knot the length stays.
    """

    time: FloatArray
    length: FloatArray
    smooth: bool = False

    def at(self, time: FloatArray) -> tuple[FloatArray, FloatArray | None]:
        """Length (m) at some times, and its rate of change (m/s) if the course is smooth."""
        if not self.smooth or len(self.time) < 2:
            return np.interp(time, self.time, self.length), None
        curve = PchipInterpolator(self.time, self.length)
        inside = np.clip(time, self.time[0], self.time[-1])
        return curve(inside), np.where(inside == time, curve.derivative()(inside), 0.0)

    def times(self, rate: float, duration: float) -> FloatArray:
        """Times (s) of `rate` samples per second up to `duration`, and of the knots among them."""
        regular = np.arange(round(duration * rate) + 1) / rate
        knots = self.time[(self.time > 0.0) & (self.time < regular[-1])]
        # Two times that differ by rounding are one.
        apart = np.abs(knots - np.round(knots * rate) / rate) > 1e-9 / rate
        return np.union1d(regular, knots[apart])


def isometric(length: float) -> Course:
    """A length (m) that stays."""
    return Course(np.array([0.0]), np.array([length]))


def ramp(first: float, last: float, start: float, end: float) -> Course:
    """From the length `first` (m) to `last` between the times `start` and `end` (s)."""
    return Course(np.array([start, end]), np.array([first, last]))


def isokinetic(first: float, last: float, speed: float, start: float = 0.0) -> Course:
    """From the length `first` (m) to `last` at a constant `speed` > 0 (m/s) from `start` (s) on."""
    return ramp(first, last, start, start + abs(last - first) / speed)


@dataclass(frozen=True)
class BenchRecord:
    """What a muscle showed on the bench at T times.

    time: s [T]. excitation: [T].
    muscle: by name of `MUSCLE_OUTPUTS` [T]. unit: by name of `UNIT_OUTPUTS` [T, units], named by
        `unit_names`, in the order of recruitment.
    internal: internal states [T, states], named by `state_names`. ranges: has looked at all instants.
    """

    time: FloatArray
    excitation: FloatArray
    muscle: dict[str, FloatArray]
    unit: dict[str, FloatArray]
    unit_names: tuple[str, ...]
    internal: FloatArray
    state_names: tuple[str, ...]
    ranges: Ranges

    @property
    def force(self) -> FloatArray:
        """Force (N) along the line of pull [T]."""
        return self.muscle["muscle_force"]

    @property
    def muscle_tendon_length(self) -> FloatArray:
        """Length (m) from origin to insertion [T]."""
        return self.muscle["muscle_tendon_length"]

    @property
    def fibre_length(self) -> FloatArray:
        """Fibre length (m) [T]."""
        return self.muscle["fibre_length"]

    @property
    def tendon_length(self) -> FloatArray:
        """Tendon length (m) [T]; 0 without a tendon."""
        return self.muscle["tendon_length"]

    @property
    def pennation_angle(self) -> FloatArray:
        """Angle (rad) between fibres and aponeurosis [T]; 0 without pennation."""
        return self.muscle["pennation_angle"]

    @property
    def frequency(self) -> FloatArray:
        """Stimulation frequency (Hz) of the motor units [T, units]."""
        return self.unit["stimulation_frequency"]

    @property
    def work(self) -> float:
        """Work (J) that the muscle has done by shortening; negative if it was stretched."""
        shortening = -np.diff(self.muscle_tendon_length)
        return float(np.sum(0.5 * (self.force[1:] + self.force[:-1]) * shortening))


def on_bench(limb: Limb, name: str) -> tuple[Limb, Muscle]:
    """A limb of this muscle alone, its path replaced; the muscle. Raises UserError if there is none."""
    if name not in limb.muscle_names:
        names = ", ".join(limb.muscle_names)
        raise UserError(f"{limb.file}: has no muscle {name!r}; allowed: {names or 'none, it has no muscles'}")
    chosen = limb.muscles[limb.muscle_names.index(name)]
    path = ChosenLaw(prescribed, {}, f"{chosen.place}.path")
    muscle = replace(chosen, joints=(0,), laws={**chosen.laws, "path": path})
    return replace(limb, segments=(SUPPORT,), muscles=(muscle,)), muscle


class MuscleBench:
    """One muscle of a limb, taken off its joint.

    state_names: internal states, such as ``tendon_length`` or ``unit.bonds``. Raises UserError if
    the limb has no such muscle.
    """

    def __init__(self, limb: Limb, muscle: str) -> None:
        self.limb, self.muscle = on_bench(limb, muscle)
        self.stepper = MuscleStepper(self.limb)
        self.state_names = tuple(name.removeprefix(f"{muscle}.") for name in self.model.layout.state_names)
        self.unit_names = tuple(unit.name for unit in self.muscle.units)

    def adopt(self, limb: Limb) -> None:
        """Take over the numbers of the same muscle of a limb that differs in nothing but numbers.

        Far quicker than a new bench, for fits and scans. Raises ValueError if its laws or units differ.
        """
        changed, muscle = on_bench(limb, self.muscle.name)
        new = build_layout(changed)
        if not same_structure(self.model.layout, new):
            raise ValueError(f"{muscle.name} has other laws or units than the muscle on the bench")
        self.limb, self.muscle = changed, muscle
        self.stepper.adopt(self.model.sibling(new))

    @property
    def model(self) -> WholeModel:
        """The muscle as a limb of its own."""
        return self.stepper.model

    def optimal_length(self) -> float:
        """Length (m) from origin to insertion at which fibres of mean optimal length hang on a slack tendon.

        Raises UserError if no length gives it, as an aponeurosis may have it.
        """
        optimal = [
            unit.values["series_sarcomeres"] * optimal_sarcomere_length(unit.laws["sarcomere"].values["actin_length"])
            for unit in self.muscle.units
        ]
        wanted = sum(optimal) / len(optimal)
        aponeurosis = self.muscle.laws["aponeurosis"].values.get("length", 0.0)
        muscle_length = np.linspace(0.0, 2.0 * wanted + aponeurosis, 20001)[1:]
        states = np.tile(self.model.layout.initial_states, (len(muscle_length), 1))
        tendon = self.muscle.laws["tendon"].values
        at_start = tendon.get("length", tendon.get("slack_length", 0.0))
        still = np.zeros(len(muscle_length))
        fibre = self._record(still, muscle_length + at_start, still, still, states).fibre_length
        crossing = np.flatnonzero((fibre[:-1] < wanted) & (fibre[1:] >= wanted))
        if not crossing.size:
            raise UserError(f"{self.limb.file}: no length of {self.muscle.name} gives its fibres {wanted:g} m")
        row = slice(crossing[-1], crossing[-1] + 2)
        return float(np.interp(wanted, fibre[row], muscle_length[row])) + tendon.get("slack_length", 0.0)

    def run(
        self,
        time: FloatArray,
        length: FloatArray,
        excitation: FloatArray | float,
        rate: FloatArray | None = None,
        *,
        initial: Start | Mapping[str, float] = "rest",
    ) -> BenchRecord:
        """Move the muscle along a length and record what it shows.

        time: s [T], rising, at least two; every corner of the length must be among them.
        length: muscle-tendon length (m) [T]. excitation: [T], or one for all; what it does to the
            motor units is linear between the times.
        rate: rate of change of the length (m/s) [T], for cubic pieces between the times; without it
            the pieces are straight, and a corner shows the velocity that follows it.
        initial: states at the first time. "rest": those in which the muscle, held at the first
            length, settles without excitation; "steady": the same with the first excitation;
            "file": those of the limb's file; or states by name, the others as in the file.
        Raises UserError for times, lengths or excitations that make no sense, SolveError if the
        equations cannot be solved further.
        """
        time, length = np.asarray(time, dtype=np.float64), np.asarray(length, dtype=np.float64)
        excitation = np.broadcast_to(np.asarray(excitation, dtype=np.float64), time.shape)
        self._refuse(time, length, excitation, rate)
        velocity = np.diff(length) / np.diff(time)
        before, after = (velocity, velocity) if rate is None else (rate[:-1], rate[1:])
        shown = np.append(velocity, velocity[-1]) if rate is None else rate
        (muscle,) = self.model.limb.muscles
        excitation = np.interp(time - muscle.delay, time, excitation)
        drives = self.model.drives(excitation[:, np.newaxis])
        stepper = self.stepper
        stepper.internal = self._initial(initial, float(length[0]), float(excitation[0]))
        internal = np.empty((len(time), stepper.internal.size))
        internal[0] = stepper.internal
        for row in range(len(time) - 1 if stepper.internal.size else 0):
            start = length[row : row + 1], before[row : row + 1]
            end = length[row + 1 : row + 2], after[row : row + 1]
            try:
                stepper.advance(start, end, drives[row], drives[row + 1], time[row + 1] - time[row])
            except SolveError as problem:
                raise SolveError(f"{problem} (on the bench, after {time[row]:.6g} s)") from None
            internal[row + 1] = stepper.internal
        return self._record(time, length, np.asarray(shown), excitation, internal)

    def settled(self, length: float, excitation: float, start: FloatArray | None = None) -> FloatArray:
        """Internal states (SI units, as `state_names`) at which the held muscle rests.

        length: m. start: states to start from, those of the file by default: tendon and aponeurosis
        stay slack if nothing pulls them. Raises SolveError if the muscle finds no rest.
        """
        layout, program, stepper = self.model.layout, self.model.program, self.stepper
        state = layout.initial_states.copy() if start is None else start.copy()
        if not state.size:
            return state
        drive = self.model.drives(np.array([[excitation]]))
        held_drive = straight(drive[0], drive[0])
        scale = layout.state_scales
        data = self.model.new_data(1.0)
        data.angles_before[:] = data.angles_after[:] = length

        def rates(x: FloatArray) -> FloatArray:
            out = np.zeros_like(x)
            program.muscle_rates(0.0, x, held_drive, layout.model.address, data.address, out)
            return out / scale

        held = np.array([length]), np.zeros(1)
        span, total = 0.01, 0.0
        while total < LONGEST_SETTLING:
            change = np.abs(rates(state)).max()
            if change <= STEADY:
                return state
            if change < 1e-2:
                # Close enough for Newton's method to find the same rest.
                rest = root(lambda scaled: rates(scaled * scale), state / scale, tol=1e-14).x * scale
                near = np.abs(rest - state).max() <= 0.1 * np.abs(state).max()
                if near and np.abs(rates(rest)).max() <= STEADY:
                    return np.asarray(rest, dtype=np.float64)
            stepper.internal = state
            stepper.advance(held, held, drive[0], drive[0], span)
            state = stepper.internal
            total += span
            span *= 2.0
        raise SolveError(f"{self.limb.file}: {self.muscle.name} held at {length:g} m finds no rest")

    def _initial(self, initial: Start | Mapping[str, float], length: float, excitation: float) -> FloatArray:
        """Internal states at the start."""
        if initial == "rest":
            return self.settled(length, 0.0)
        if initial == "steady":
            return self.settled(length, excitation)
        state = self.model.layout.initial_states.copy()
        if isinstance(initial, str):
            if initial != "file":
                raise UserError(f"initial is {initial!r}; allowed: rest, steady, file, or states by name")
            return state
        for name, value in initial.items():
            if name not in self.state_names:
                names = ", ".join(self.state_names)
                raise UserError(f"{self.muscle.name} has no state {name!r}; allowed: {names or 'none'}")
            state[self.state_names.index(name)] = value
        return state

    def _refuse(self, time: FloatArray, length: FloatArray, excitation: FloatArray, rate: FloatArray | None) -> None:
        """Refuse a course that cannot be followed."""
        name = self.muscle.name
        if (
            time.ndim != 1
            or len(time) < 2
            or length.shape != time.shape
            or (rate is not None and len(rate) != len(time))
        ):
            raise UserError(f"{name}: at least two times are needed, with one length and rate for each")
        if not (np.isfinite(time).all() and (np.diff(time) > 0.0).all()):
            raise UserError(f"{name}: its times must rise")
        wrong = np.flatnonzero(~(np.isfinite(length) & (length > 0.0)))
        if wrong.size:
            row = wrong[0]
            raise UserError(f"{name}: muscle-tendon length is {length[row]:g} at {time[row]:g} s; a number > 0 in m")
        wrong = np.flatnonzero(~((excitation >= 0.0) & (excitation <= 1.0)))
        if wrong.size:
            row = wrong[0]
            raise UserError(f"{name}: excitation is {excitation[row]:g} at {time[row]:g} s; a number in [0, 1]")

    def _record(
        self,
        time: FloatArray,
        length: FloatArray,
        rate: FloatArray,
        excitation: FloatArray,
        internal: FloatArray,
    ) -> BenchRecord:
        """What the muscle shows at every time."""
        layout = self.model.layout
        muscle = np.zeros((len(time), 1, len(MUSCLE_OUTPUTS)))
        crossing = np.zeros((len(time), 1, len(CROSSING_OUTPUTS)))
        unit = np.zeros((len(time), layout.units, len(UNIT_OUTPUTS)))
        data, ranges = self.model.new_data(1.0), Ranges(self.model)
        states = np.ascontiguousarray(np.column_stack([length, rate, internal]))
        ranges.look(states)
        self.model.program.observe_all(
            states,
            np.ascontiguousarray(excitation[:, np.newaxis]),
            layout.model.address,
            data.address,
            muscle,
            crossing,
            unit,
        )
        return BenchRecord(
            time=time,
            excitation=np.array(excitation),
            muscle={name: muscle[:, 0, i] for i, name in enumerate(MUSCLE_OUTPUTS)},
            unit={name: unit[:, :, i] for i, name in enumerate(UNIT_OUTPUTS)},
            unit_names=self.unit_names,
            internal=internal,
            state_names=self.state_names,
            ranges=ranges,
        )
