"""The verification of the report's section 3.3 as data: limbs, what drives them, and what they must show.

The expected numbers never come from the solvers that are verified: the period of a pendulum is an elliptic integral,
equilibria balance torques, a pendulum turns where its energy says, and the other movements are solved by scipy with
equations that the test of this module writes down again.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from limb_nodes.analysis.trajectory import Trajectory, trajectory_of_movement
from limb_nodes.errors import UserError
from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.model import load_limb
from limb_nodes.model.limb import Limb
from limb_nodes.model.load import with_values
from limb_nodes.model.shipped import shipped
from limb_nodes.signals.activation import load_activation
from limb_nodes.solve.whole import WholeModel

IndexArray = npt.NDArray[np.intp]

RATE = 1000.0
EQUILIBRIUM = 1e-4
FREQUENCY = 0.005
LIMIT = 1.5
FLEXOR, EXTENSOR = 0, 1
JOINT, TENDON = "reference_joint.yaml", "reference_joint_tendon.yaml"


@dataclass(frozen=True)
class Quantity:
    """A number that a case must show.

    name: with its unit. tolerance: greatest distance from what is expected. find: measures it in a trajectory.
    """

    name: str
    expected: float
    tolerance: float
    find: Callable[[Trajectory], float]


@dataclass(frozen=True)
class Case:
    """A case of the report.

    figure: of the report. set_up: in words. limb: shipped file; values: what is changed in it, as for `with_values`.
    activation: constants, a shipped file, or nothing without muscles. duration: s.
    states: whether figure or quantities need the states of muscles and motor units.
    """

    name: str
    figure: str
    set_up: str
    limb: str
    activation: str
    duration: float
    quantities: tuple[Quantity, ...]
    values: Mapping[str, Any] = field(default_factory=dict)
    states: bool = False

    def build(self, folder: Path | None = None, allow_laws: bool = False) -> Limb:
        """The limb of this case, from the shipped one or the one in another folder, as `load_limb` takes it.

        Raises UserError.
        """
        limb = load_limb(shipped(self.limb, folder), allow_laws)
        units = [len(muscle.units) for muscle in limb.muscles]
        if len(limb.segments) != 1 or limb.muscle_names != ["flexor", "extensor"] or units != [1, 1]:
            raise UserError(
                f"{limb.file}: {len(limb.segments)} segments, muscles {', '.join(limb.muscle_names) or 'none'}; "
                "one segment and the muscles flexor, extensor of one motor unit each are needed"
            )
        return with_values(limb, self.values)

    def drive(self, limb: Limb) -> FloatArray:
        """The activations of the muscles at every tick [T, muscles]. Raises UserError."""
        if not limb.muscles:
            return np.empty((round(self.duration * RATE) + 1, 0))
        source = self.activation if "=" in self.activation else str(shipped(self.activation))
        return load_activation(source, limb.muscle_names, RATE, self.duration).values


@dataclass(frozen=True)
class Finding:
    """What one way of running shows of a quantity. value: not a number if there is none."""

    case: Case
    quantity: Quantity
    solver: str
    value: float

    @property
    def passed(self) -> bool:
        """Whether it is as expected."""
        return abs(self.value - self.quantity.expected) <= self.quantity.tolerance

    def plain(self) -> dict[str, Any]:
        """The same as data for JSON."""
        return {
            "case": self.case.name,
            "quantity": self.quantity.name,
            "expected": self.quantity.expected,
            "found": self.value if math.isfinite(self.value) else None,
            "tolerance": self.quantity.tolerance,
            "passed": self.passed,
            "solver": self.solver,
        }


def solve_whole(case: Case, limb: Limb) -> Trajectory:
    """Run a case by the whole-model solve. Raises SolveError."""
    movement = WholeModel(limb).simulate(case.drive(limb), RATE)
    return trajectory_of_movement(limb, movement)


def measure(case: Case, solver: str, trajectory: Trajectory | None) -> list[Finding]:
    """Measure every quantity of a case; not numbers without a trajectory."""
    return [
        Finding(case, quantity, solver, float("nan") if trajectory is None else quantity.find(trajectory))
        for quantity in case.quantities
    ]


def crossings(time: FloatArray, signal: FloatArray, rising: bool | None = None) -> tuple[FloatArray, IndexArray]:
    """Where a signal passes zero: interpolated times, and samples before them; only rising or falling if asked."""
    above = signal > 0.0
    changed = above[1:] != above[:-1]
    if rising is not None:
        changed &= above[1:] == rising
    k = np.flatnonzero(changed)
    share = signal[k] / (signal[k] - signal[k + 1])
    return time[k] + share * (time[k + 1] - time[k]), k


def frequency(trajectory: Trajectory) -> float:
    """Frequency (Hz) of the joint angle about its mean, over whole periods."""
    angle = trajectory.angle[:, 0]
    times, _ = crossings(trajectory.time, angle - angle.mean(), rising=True)
    return (len(times) - 1) / float(times[-1] - times[0]) if len(times) > 1 else float("nan")


def turning_angles(trajectory: Trajectory) -> FloatArray:
    """Joint angles (rad) at which the velocity changes its sign."""
    times, k = crossings(trajectory.time, trajectory.velocity[:, 0])
    # From a sample to the turn the velocity goes straight to zero.
    turns: FloatArray = trajectory.angle[k, 0] + 0.5 * trajectory.velocity[k, 0] * (times - trajectory.time[k])
    return turns


def lowest_turn(trajectory: Trajectory) -> float:
    """Lowest angle (rad) at which the joint turns."""
    return float(turning_angles(trajectory).min(initial=np.inf))


def highest_turn(trajectory: Trajectory) -> float:
    """Highest angle (rad) at which the joint turns."""
    return float(turning_angles(trajectory).max(initial=-np.inf))


def balanced_angle(trajectory: Trajectory) -> float:
    """Angle (rad) at which the swinging joint is not accelerated, the mean over all passages."""
    times, k = crossings(trajectory.time, trajectory.acceleration[:, 0])
    if not len(times):
        return float("nan")
    return float(np.mean(trajectory.angle[k, 0] + trajectory.velocity[k, 0] * (times - trajectory.time[k])))


def last_angle(trajectory: Trajectory) -> float:
    """Joint angle (rad) at the end."""
    return float(trajectory.angle[-1, 0])


def last_velocity(trajectory: Trajectory) -> float:
    """Joint velocity (rad/s) at the end."""
    return float(trajectory.velocity[-1, 0])


def last_torque(trajectory: Trajectory) -> float:
    """Torque of all muscles on the joint (N m) at the end."""
    return float(trajectory.torque[-1, 0])


def tendon_length(muscle: int, instant: int) -> Callable[[Trajectory], float]:
    """Measures the tendon length (m) of a muscle at an instant."""
    return lambda trajectory: float(trajectory.muscle["tendon_length"][instant, muscle])


def slowing_share(direction: float) -> Callable[[Trajectory], float]:
    """Measures the share of instants at which the joint does not speed up in a direction."""
    return lambda trajectory: float(np.mean(direction * np.diff(trajectory.velocity[:, 0]) <= 0.0))


def arrival(limit: float) -> Callable[[Trajectory], float]:
    """Measures the time (s) of the first instant at which the joint is at a limit."""

    def measured(trajectory: Trajectory) -> float:
        there = np.abs(trajectory.angle[:, 0] - limit) < 1e-9
        return float(trajectory.time[int(there.argmax())]) if there.any() else float("nan")

    return measured


def straying(limit: float) -> Callable[[Trajectory], float]:
    """Measures how far (rad) the joint leaves a limit again, or passes it."""

    def measured(trajectory: Trajectory) -> float:
        away = np.abs(trajectory.angle[:, 0] - limit)
        there = away < 1e-9
        return float(away[int(there.argmax()) :].max()) if there.any() else float("nan")

    return measured


def wrongly_firing(trajectory: Trajectory) -> float:
    """Instants at which a motor unit fires below the threshold or is silent at or above it."""
    return float(np.sum((trajectory.unit["stimulation_frequency"] > 0.0) != (trajectory.activation >= 0.8)))


def firing_share(muscle: int) -> Callable[[Trajectory], float]:
    """Measures the share of the time in which the unit of a muscle fires; the last instant begins another period."""
    return lambda trajectory: float(np.mean(trajectory.unit["stimulation_frequency"][:-1, muscle] > 0.0))


def lowest_firing(trajectory: Trajectory) -> float:
    """Lowest frequency (Hz) at which a motor unit fires."""
    rates = trajectory.unit["stimulation_frequency"]
    return float(rates[rates > 0.0].min(initial=np.inf))


def highest_firing(trajectory: Trajectory) -> float:
    """Highest frequency (Hz) at which a motor unit fires."""
    return float(trajectory.unit["stimulation_frequency"].max())


def near(name: str, expected: float, find: Callable[[Trajectory], float], tolerance: float = EQUILIBRIUM) -> Quantity:
    """A quantity with an absolute tolerance."""
    return Quantity(name, expected, tolerance, find)


def swing(expected: float, low: float) -> tuple[Quantity, ...]:
    """Frequency and turning points of a joint that starts at rest at 30 degrees."""
    return (
        near("frequency (Hz)", expected, frequency, FREQUENCY * expected),
        near("lowest angle (rad)", low, lowest_turn),
        near("highest angle (rad)", math.pi / 6, highest_turn),
    )


def constant_force(force: float, gravity: float = 9.81, limit: float | None = None) -> dict[str, Any]:
    """Changes that give every muscle, while fully activated, a constant force (N)."""
    values: dict[str, Any] = {
        "gravity": [0.0, -gravity],
        # The fibre has 1e14 sarcomeres in parallel.
        "unit_kinds.slow.sarcomere": {"law": "constant", "force": force * 1e-14},
        "unit_kinds.slow.force_length": {"law": "constant"},
        "unit_kinds.slow.maximum_passive_force": 0.0,
    }
    if limit is not None:
        values["segments[0].range"] = [-limit, limit]
    return values


def runaway(direction: float, angle: float, velocity: float) -> tuple[Quantity, ...]:
    """A joint that turns faster and faster."""
    return (
        near("angle after 2 s (rad)", angle, last_angle),
        near("velocity after 2 s (rad/s)", velocity, last_velocity),
        near("share of time not speeding up (1)", 0.0, slowing_share(direction), 0.0),
    )


def held(limit: float, time: float) -> tuple[Quantity, ...]:
    """A joint that runs into a limit and stays."""
    return (
        near("first instant at the limit (s)", time, arrival(limit), 1.0 / RATE),
        near("angle after 2 s (rad)", limit, last_angle, 1e-9),
        near("velocity after 2 s (rad/s)", 0.0, last_velocity, 1e-9),
        near("leaves the limit by (rad)", 0.0, straying(limit), 1e-9),
    )


NO_MUSCLES: dict[str, Any] = {"muscles": []}
ONLY_FLEXOR, ONLY_EXTENSOR = "flexor=1,extensor=0", "flexor=0,extensor=1"
FALLING = {"segments[0].velocity": -2.0}
STRETCHED = {"muscles[0].tendon.length": 0.05, "muscles[1].tendon.length": 0.05}

CASES: tuple[Case, ...] = (
    Case(
        "3.2",
        "3.2",
        "no muscle force, g = 1.1 m/s^2",
        JOINT,
        "",
        10.0,
        swing(0.3396508, -math.pi / 6),
        {**NO_MUSCLES, "gravity": [0.0, -1.1]},
    ),
    Case(
        "3.3",
        "3.3",
        "no muscle force, g = 9.81 m/s^2",
        JOINT,
        "",
        5.0,
        swing(1.0143103, -math.pi / 6),
        NO_MUSCLES,
    ),
    Case(
        "3.4",
        "3.4",
        "no muscle force, 200 N down at the tip",
        JOINT,
        "",
        2.0,
        swing(5.8812309, -math.pi / 6),
        {**NO_MUSCLES, "tip_force": [0.0, -200.0]},
    ),
    Case(
        "3.5",
        "3.5",
        "constant 10 N in the flexor",
        JOINT,
        ONLY_FLEXOR,
        5.0,
        (near("equilibrium (rad)", 0.1003577, balanced_angle), *swing(1.0178199, -0.3168311)),
        constant_force(10.0),
    ),
    Case(
        "3.6",
        "3.6",
        "constant 50 N in the flexor, g = 1.1 m/s^2",
        JOINT,
        ONLY_FLEXOR,
        2.0,
        runaway(1.0, 40.1288448, 40.6566881),
        constant_force(50.0, 1.1),
    ),
    Case(
        "3.6-range",
        "3.6",
        "constant 50 N in the flexor, g = 1.1 m/s^2, joint range +-1.5 rad",
        JOINT,
        ONLY_FLEXOR,
        2.0,
        held(LIMIT, 0.3282338),
        constant_force(50.0, 1.1, LIMIT),
    ),
    Case(
        "3.7",
        "3.7",
        "constant 10 N in the extensor",
        JOINT,
        ONLY_EXTENSOR,
        5.0,
        (near("equilibrium (rad)", -0.1003577, balanced_angle), *swing(1.0033383, -0.7383299)),
        constant_force(10.0),
    ),
    Case(
        "3.8",
        "3.8",
        "constant 50 N in the extensor, g = 1.1 m/s^2",
        JOINT,
        ONLY_EXTENSOR,
        2.0,
        runaway(-1.0, -41.0385854, -41.6328186),
        constant_force(50.0, 1.1),
    ),
    Case(
        "3.8-range",
        "3.8",
        "constant 50 N in the extensor, g = 1.1 m/s^2, joint range +-1.5 rad",
        JOINT,
        ONLY_EXTENSOR,
        2.0,
        held(-LIMIT, 0.4301083),
        constant_force(50.0, 1.1, LIMIT),
    ),
    Case(
        "3.9",
        "3.9",
        "activation of the flexor a sine, of the extensor a cosine, 1 Hz",
        JOINT,
        "activation_sine_cosine.yaml",
        4.0,
        (
            near("instants of wrong firing (1)", 0.0, wrongly_firing, 0.0),
            near("share of time flexor fires (1)", 0.2048328, firing_share(FLEXOR), 0.001),
            near("share of time extensor fires (1)", 0.2048328, firing_share(EXTENSOR), 0.001),
            # The first instant above the threshold comes up to a tick late.
            near("lowest frequency of firing (Hz)", 5.0, lowest_firing, 0.2),
            near("highest frequency of firing (Hz)", 15.0, highest_firing, 1e-6),
        ),
        states=True,
    ),
    Case(
        "3.10",
        "3.10",
        "activation of the flexor 0.9, start at -2 rad/s",
        JOINT,
        "flexor=0.9,extensor=0",
        5.0,
        (
            near("angle where it turns first (rad)", -0.0821391, lowest_turn),
            near("angle at the end (rad)", 0.2261696, last_angle),
            near("velocity at the end (rad/s)", 0.0, last_velocity),
            near("torque at the end (N m)", 0.4812185, last_torque),
        ),
        FALLING,
        True,
    ),
    Case(
        "3.11",
        "3.11",
        "activation of the flexor 0.9, start at -2 rad/s, tendons at 0.05 m",
        TENDON,
        "flexor=0.9,extensor=0",
        5.0,
        (
            near("flexor tendon at the start (m)", 0.05, tendon_length(FLEXOR, 0)),
            near("extensor tendon at the start (m)", 0.05, tendon_length(EXTENSOR, 0)),
            near("flexor tendon at the end (m)", 0.0303851, tendon_length(FLEXOR, -1)),
            near("extensor tendon at the end (m)", 0.03, tendon_length(EXTENSOR, -1)),
            near("angle where it turns first (rad)", 0.1290939, lowest_turn),
            near("angle at the end (rad)", 0.3961578, last_angle),
            near("velocity at the end (rad/s)", 0.0, last_velocity),
            near("torque at the end (N m)", 0.8280670, last_torque),
        ),
        {**FALLING, **STRETCHED},
        True,
    ),
)
