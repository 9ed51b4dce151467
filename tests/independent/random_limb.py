"""Random limbs and their movement by a second solution: Lagrange's equations in absolute angles, scipy, events by hand.

Numbers of the equations are those of the model's page. Each muscle has one unit of the reference joint, some times as
strong, and an activation above the unit's threshold all the time. SI units.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from tests.independent.reference_joint import fibre_force, frequency_factor

GRAVITY = np.array([0.7, -9.81])
EXACT = {"method": "DOP853", "rtol": 1e-11, "atol": 1e-13}
MOST_EVENTS = 400
# A joint that would leave its limit more slowly (rad/s) stays on it; one so near to its limit (rad) is on it.
REST, TOUCH = 1e-6, 1e-14


@dataclass
class RandomMuscle:
    """One muscle: role, times the strength of the reference unit, geometry, tendon, and what activates it."""

    joint: int
    role: float
    strength: float
    arm: float
    proximal: float
    distal: float
    elastic: bool
    stiffness: float
    damping: float
    slack: float
    phase: float

    def activation(self, time: float) -> float:
        return 0.9 + 0.08 * math.sin(5.0 * time + self.phase)

    def path(self, angle: float) -> tuple[float, float]:
        """Muscle-tendon length and its slope in the angle (2.43-2.48)."""
        length = slope = 0.0
        for distance in (self.proximal, self.distal):
            side = math.sqrt(self.arm**2 + distance**2 - 2.0 * self.role * self.arm * distance * math.sin(0.5 * angle))
            length += side
            slope -= 0.5 * self.role * self.arm * distance * math.cos(0.5 * angle) / side
        return length, slope

    def pull(self, time: float, angle: float, velocity: float, tendon: float) -> tuple[float, float]:
        """Force of the muscle, and the rate of its tendon's length."""
        length, slope = self.path(angle)
        factor = frequency_factor(self.activation(time))
        shortening = -slope * velocity

        def force(lengthening: float) -> float:
            fibres = self.strength * fibre_force(length - tendon, shortening + lengthening, factor)
            return max(0.0, fibres)

        if not self.elastic:
            return force(0.0), 0.0
        passive = self.stiffness * max(0.0, tendon - self.slack)

        def spare(guess: float) -> float:
            return force((guess - passive) / self.damping) - guess

        top = 100.0
        while spare(top) > 0.0:
            top *= 2.0
        found = float(brentq(spare, 0.0, top, xtol=1e-13, rtol=1e-15)) if spare(0.0) > 0.0 else 0.0
        return found, (found - passive) / self.damping


class RandomLimb:
    """A chain of joints with muscles, tissue and ranges, all drawn from a seed.

    impacts: how many the last solution had.
    """

    impacts = 0

    def __init__(self, seed: int, joints: int = 0) -> None:
        """joints: how many; 0 for 1 to 5 by the seed."""
        draw = np.random.default_rng(seed)
        drawn = int(draw.integers(1, 6))
        n = self.joints = joints or drawn
        self.mass, self.length = draw.uniform(0.5, 4.0, n), draw.uniform(0.2, 0.5, n)
        self.com, self.inertia = self.length * draw.uniform(0.3, 0.6, n), draw.uniform(0.01, 0.05, n)
        self.angle, self.velocity = draw.uniform(-0.6, 0.6, n), draw.uniform(-2.0, 2.0, n)
        self.base = -0.5 * math.pi
        self.ranges: list[tuple[float, float] | None] = [
            (a - draw.uniform(0.05, 0.7), a + draw.uniform(0.05, 0.7)) if draw.random() < 0.6 else None
            for a in self.angle.tolist()
        ]
        # Stiffness, damping and rest angle; 1 N m angles and growths towards both ends, and damping.
        self.linear = [
            (draw.uniform(1.0, 8.0), draw.uniform(0.0, 0.5), draw.uniform(-0.3, 0.3)) if draw.random() < 0.5 else None
            for _ in range(n)
        ]
        self.exponential = [
            (draw.uniform(0.3, 0.8), draw.uniform(3.0, 8.0), draw.uniform(-0.8, -0.3), draw.uniform(3.0, 8.0), 0.1)
            if draw.random() < 0.4
            else None
            for _ in range(n)
        ]
        self.muscles = []
        for joint in range(n):
            for role in (1.0, -1.0)[: int(draw.integers(0, 3))]:
                distal = draw.uniform(0.025, 0.04)
                elastic = bool(draw.random() < 0.5)
                self.muscles.append(
                    RandomMuscle(
                        joint, role, draw.uniform(0.2, 1.5), draw.uniform(0.015, 0.02),
                        draw.uniform(0.08, 0.09) + 0.03 * elastic, distal, elastic, draw.uniform(0.5e5, 2e5),
                        draw.uniform(1e3, 1e4), 0.03, draw.uniform(0.0, 6.0),
                    )
                )  # fmt: skip

    def yaml(self) -> str:
        """The same limb for the program."""
        lines = ["name: random", f"gravity: [{GRAVITY[0]}, {GRAVITY[1]}]", f"base_angle: {self.base!r}", "segments:"]
        for k in range(self.joints):
            tissue = []
            if self.linear[k]:
                stiffness, damping, rest = self.linear[k]
                tissue.append(f"{{law: linear, stiffness: {stiffness!r}, damping: {damping!r}, rest_angle: {rest!r}}}")
            if self.exponential[k]:
                names = ("upper_angle", "upper_growth", "lower_angle", "lower_growth", "damping")
                pairs = ", ".join(f"{name}: {value!r}" for name, value in zip(names, self.exponential[k], strict=True))
                tissue.append(f"{{law: exponential, {pairs}}}")
            numbers = {
                "mass": self.mass[k], "length": self.length[k], "com_distance": self.com[k],
                "inertia": self.inertia[k], "angle": self.angle[k], "velocity": self.velocity[k],
            }  # fmt: skip
            given = ", ".join(f"{name}: {float(value)!r}" for name, value in numbers.items())
            span = self.ranges[k]
            given += f", range: [{span[0]!r}, {span[1]!r}]" if span else ""
            given += f", tissue: [{', '.join(tissue)}]" if tissue else ""
            lines.append(f"  - {{name: s{k}, joint: j{k}, {given}}}")
        lines += ["sarcomeres: {rabbit: {law: derenyi_vicsek}}", "muscles:"] if self.muscles else []
        for number, muscle in enumerate(self.muscles):
            tendon = (
                f"{{law: voigt, stiffness: {muscle.stiffness!r}, damping: {muscle.damping!r}, slack_length: "
                f"{muscle.slack!r}}}"
                if muscle.elastic
                else "rigid"
            )
            lines.append(
                f"  - {{name: m{number}, joint: j{muscle.joint}, role: {'flexor' if muscle.role > 0 else 'extensor'}, "
                f"activation_threshold: 0.8, tendon: {tendon}, path: {{law: constant_moment_arm, moment_arm: "
                f"{muscle.arm!r}, proximal_distance: {muscle.proximal!r}, distal_distance: {muscle.distal!r}}}, units: "
                f"[{{name: u, sarcomere: rabbit, series_sarcomeres: 42000, parallel_sarcomeres: "
                f"{1e14 * muscle.strength!r}, minimum_frequency: 5.0, maximum_frequency: 15.0, pcsa: 1.0e-4, "
                f"maximum_passive_force: {30.0 * muscle.strength!r}}}]}}"
            )
        return "\n".join(lines) + "\n"

    def excitation(self, rate: float, duration: float) -> np.ndarray:
        """Activations [T, muscles]."""
        times = np.arange(round(rate * duration) + 1) / rate
        rows = [[muscle.activation(float(time)) for muscle in self.muscles] for time in times]
        return np.array(rows).reshape(len(times), len(self.muscles))

    def matrix(self, angle: np.ndarray) -> np.ndarray:
        """Inertia matrix of the joint angles: that of the absolute angles between unit lower triangles."""
        turned = self.base + np.cumsum(angle)
        inertia = self.couplings() * np.cos(turned[:, None] - turned[None, :]) + np.diag(self.inertia)
        down = np.tril(np.ones((self.joints, self.joints)))
        return down.T @ inertia @ down

    def couplings(self) -> np.ndarray:
        """How each two segments carry the masses beyond them."""
        far = np.tril(np.tile(self.length, (self.joints, 1)), -1) + np.diag(self.com)
        return far.T @ (self.mass[:, None] * far)

    def torques(self, time: float, state: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """About each joint all but its limits, motion and weight included; and the rates of the tendons."""
        n = self.joints
        angle, velocity, tendons = state[:n], state[n : 2 * n], list(state[2 * n :])
        turned, speed = self.base + np.cumsum(angle), np.cumsum(velocity)
        far = np.tril(np.tile(self.length, (n, 1)), -1) + np.diag(self.com)
        carried = self.mass @ far
        across = np.stack([-np.sin(turned), np.cos(turned)], axis=1)
        absolute = carried * (across @ GRAVITY)
        absolute -= (self.couplings() * np.sin(turned[:, None] - turned[None, :])) @ speed**2
        about = np.tril(np.ones((n, n))).T @ absolute
        rates = []
        for muscle in self.muscles:
            tendon = tendons.pop(0) if muscle.elastic else 0.0
            force, rate = muscle.pull(time, angle[muscle.joint], velocity[muscle.joint], tendon)
            about[muscle.joint] += muscle.role * muscle.arm * force
            rates += [rate] if muscle.elastic else []
        for k in range(n):
            if self.linear[k]:
                stiffness, damping, rest = self.linear[k]
                about[k] -= stiffness * (angle[k] - rest) + damping * velocity[k]
            if self.exponential[k]:
                upper, fast, lower, steep, damping = self.exponential[k]
                about[k] += math.exp(steep * (lower - angle[k])) - math.exp(fast * (angle[k] - upper))
                about[k] -= damping * velocity[k]
        return about, np.array(rates)

    def solve(self, times: np.ndarray) -> np.ndarray | None:
        """Joint angles [T, n] at rising times from 0 on; None if there are too many impacts and releases."""
        n = self.joints
        state = np.concatenate([self.angle, self.velocity, [m.slack for m in self.muscles if m.elastic]])
        out, held, now = np.empty((len(times), n)), {}, 0.0
        self.impacts = 0
        for _ in range(MOST_EVENTS):
            events = [*self.meetings(held), *self.releases(held)]
            found = solve_ivp(
                lambda t, y, held=held: self.rates(t, y, held), (now, times[-1]), state,
                events=[event for event, _ in events] or None, dense_output=True, **EXACT,
            )  # fmt: skip
            inside = (times >= now) & (times <= found.t[-1])
            if inside.any():
                out[inside] = found.sol(times[inside])[:n].T
            if found.status == 0:
                return out
            which = next(i for i, happened in enumerate(found.t_events) if len(happened))
            now, state = float(found.t[-1]), found.y[:, -1].copy()
            joint, side = events[which][1]
            if joint in held:
                held = {k: flag for k, flag in held.items() if k != joint}
                continue
            self.impacts += 1
            state[joint] = self.ranges[joint][side > 0]  # type: ignore[index]
            state[n : 2 * n], held = self.impact(state, {**held, joint: side})
            held = self.pressed(now, state, held)
        return None

    def pressed(self, time: float, state: np.ndarray, held: dict[int, float]) -> dict[int, float]:
        """Of the joints that an impact has stopped those that are not pulled away at once."""
        while pulled := [joint for event, (joint, _) in self.releases(held) if event(time, state) > 0.0]:
            held = {joint: side for joint, side in held.items() if joint != pulled[0]}
        return held

    def rates(self, time: float, state: np.ndarray, held: dict[int, float]) -> np.ndarray:
        """Joints that are held stay."""
        n = self.joints
        about, tendons = self.torques(time, state)
        free = [k for k in range(n) if k not in held]
        acceleration = np.zeros(n)
        acceleration[free] = np.linalg.solve(self.matrix(state[:n])[np.ix_(free, free)], about[free])
        velocity = state[n : 2 * n].copy()
        velocity[list(held)] = 0.0
        return np.concatenate([velocity, acceleration, tendons])

    def meetings(self, held: dict[int, float]) -> list[tuple[Callable[..., float], tuple[int, float]]]:
        """Of each free joint with a range, when it meets either end."""
        events = []
        for joint, span in enumerate(self.ranges):
            if span is None or joint in held:
                continue
            for side, limit in ((-1.0, span[0]), (1.0, span[1])):

                def beyond(_: float, state: np.ndarray, joint=joint, side=side, limit=limit) -> float:
                    return side * float(state[joint] - limit) - TOUCH

                events.append((terminal(beyond), (joint, side)))
        return events

    def releases(self, held: dict[int, float]) -> list[tuple[Callable[..., float], tuple[int, float]]]:
        """Of each held joint, when its limit would have to pull."""
        events = []
        for joint, side in held.items():

            def pull(time: float, state: np.ndarray, joint=joint, side=side) -> float:
                about, _ = self.torques(time, state)
                acceleration = self.rates(time, state, held)[self.joints : 2 * self.joints]
                needed = self.matrix(state[: self.joints])[joint] @ acceleration - about[joint]
                return side * float(needed)

            events.append((terminal(pull), (joint, side)))
        return events

    def impact(self, state: np.ndarray, touching: dict[int, float]) -> tuple[np.ndarray, dict[int, float]]:
        """Of all ways to stop some of the touching joints the one in which limits only push."""
        n = self.joints
        matrix, velocity = self.matrix(state[:n]), state[n : 2 * n]
        for number in range(len(touching), -1, -1):
            for stopped in combinations(touching, number):
                free = [k for k in range(n) if k not in stopped]
                after = np.zeros(n)
                after[free] = np.linalg.solve(matrix[np.ix_(free, free)], (matrix @ velocity)[free])
                impulse = matrix @ (after - velocity)
                pushed = all(touching[k] * impulse[k] <= REST * matrix[k, k] for k in stopped)
                if pushed and all(side * after[k] <= 1e-12 for k, side in touching.items()):
                    return after, {k: touching[k] for k in stopped}
        raise AssertionError("an impact has no solution")


def terminal(event: Callable[..., float]) -> Callable[..., float]:
    """An event at which scipy stops as it rises through zero."""
    event.terminal, event.direction = True, 1.0  # type: ignore[attr-defined]
    return event
