"""A limb as checked data: segments, muscles and motor units with their laws."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from limb_nodes.model.chosen import ChosenLaw
from limb_nodes.model.user_code import UserCode


@dataclass(frozen=True)
class Segment:
    """A segment and the joint at its proximal end. SI units, radians.

    joint_range: lowest and highest joint angle, or None if the joint turns freely.
    angle, velocity: of the joint at the start. tissue: laws whose moments on the joint add up.
    """

    name: str
    joint: str
    mass: float
    length: float
    com_distance: float
    inertia: float
    angle: float
    velocity: float
    joint_range: tuple[float, float] | None
    tissue: tuple[ChosenLaw, ...] = ()


@dataclass(frozen=True)
class MotorUnit:
    """A motor unit: the parameters of `levels.motor_unit.PARAMETERS`, its threshold and laws.

    values: includes `unit_threshold` (activation at which it fires) and `unit_rank` (its place in
        the recruitment order over the number of units, i/n: 1 for the last).
    laws: by process: sarcomere, force_length, force_frequency, passive_force, recruitment.
    """

    name: str
    values: dict[str, float]
    laws: dict[str, ChosenLaw]


@dataclass(frozen=True)
class Muscle:
    """A muscle over one joint or several, its units in the order of recruitment.

    joints: those that it crosses, from proximal to distal.
    role: +1 for a flexor (pulls the joint angle up), -1 for an extensor, 0 if the signs of moment arms tell it.
    laws: by process: path, tendon, aponeurosis, activation_dynamics. delay: from the excitation to the muscle (s).
    """

    name: str
    joints: tuple[int, ...]
    role: float
    activation_threshold: float
    laws: dict[str, ChosenLaw]
    units: tuple[MotorUnit, ...]
    place: str
    delay: float = 0.0


@dataclass(frozen=True)
class Person:
    """Whose limb it is. mass: kg. height: m."""

    mass: float
    height: float


@dataclass(frozen=True)
class Limb:
    """A limb. Angles in rad, lengths in m, forces in N, in the plane x right, y up.

    text, file: the YAML that it was read from; content: the same as plain data. code: the user's own that it names.
    """

    name: str
    gravity: tuple[float, float]
    base_angle: float
    base_position: tuple[float, float]
    tip_force: tuple[float, float]
    tip_torque: float
    segments: tuple[Segment, ...]
    muscles: tuple[Muscle, ...]
    file: str = field(compare=False)
    text: str = field(compare=False)
    content: dict[str, Any] = field(compare=False)
    code: UserCode = field(compare=False)
    person: Person | None = None

    @property
    def joint_names(self) -> list[str]:
        """Names of the joints from proximal to distal."""
        return [segment.joint for segment in self.segments]

    @property
    def muscle_names(self) -> list[str]:
        """Names of the muscles in the order of the file."""
        return [muscle.name for muscle in self.muscles]

    @property
    def crossings(self) -> list[tuple[int, int]]:
        """Each muscle, by its place in `muscles`, with each of the joints that it crosses."""
        return [(number, joint) for number, muscle in enumerate(self.muscles) for joint in muscle.joints]

    @property
    def crossing_names(self) -> tuple[list[str], list[str]]:
        """Of all crossings, the names of their muscles, and those of their joints."""
        muscles, joints = self.muscle_names, self.joint_names
        return [muscles[muscle] for muscle, _ in self.crossings], [joints[joint] for _, joint in self.crossings]
