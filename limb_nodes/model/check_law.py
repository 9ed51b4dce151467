"""Checks of the laws of a limb when it is loaded: each keeps what its process's contract asks for.

Every law is evaluated over its declared range (`Law.ranges`, else the range given here). What is
found wrong is said with the place where it breaks.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import lru_cache
from itertools import pairwise

from limb_nodes.errors import UserError
from limb_nodes.levels import CONTRACTS
from limb_nodes.levels.motor_unit.fibre import fibre_length_norm, frequency_norm
from limb_nodes.levels.sarcomere.lengths import (
    maximum_sarcomere_length,
    minimum_sarcomere_length,
    optimal_sarcomere_length,
)
from limb_nodes.levels.tangent import UnsupportedCode, refuse_unsupported
from limb_nodes.model.choice import ChosenLaw
from limb_nodes.model.limb import Limb, MotorUnit, Muscle
from limb_nodes.model.probe import BrokenLaw, Probe

Range = tuple[float, float]
Frozen = tuple[tuple[str, float], ...]

UNITS = {
    "sarcomere_velocity": "m/s",
    "sarcomere_length": "m",
    "stimulation_frequency": "Hz",
    "joint_angle": "rad",
    "tendon_length": "m",
    "tendon_force": "N",
    "muscle_length": "m",
    "total_fibre_force": "N",
}
# Greatest velocity at which a sarcomere law is checked, in its optimal lengths per second: what the
# fastest vertebrate muscles reach is about twenty.
FASTEST = 10.0
POINTS = 120
# Share of the greatest value by which a curve may go the wrong way: round-off.
ROUND_OFF = 1e-11
# One-sided slopes that differ by this share are a kink.
KINK = 1e-3


def check_laws(limb: Limb) -> None:
    """Refuse a limb with a law that does not keep its contract. Raises UserError, one line."""
    for muscle in limb.muscles:
        for process, check in MUSCLE_CHECKS.items():
            chosen = muscle.laws[process]
            report(limb.file, chosen, check(chosen, muscle, limb))
        for unit in muscle.units:
            for chosen in unit.laws.values():
                report(limb.file, chosen, unit_fault(chosen, unit))


def report(file: str, chosen: ChosenLaw, fault: str) -> None:
    """Raise the UserError for a fault, if there is one."""
    if fault:
        name = f"{chosen.module}:{chosen.law.name}" if chosen.module else chosen.law.name
        raise UserError(f"{file}: {chosen.place}.law is {name!r}: {fault}")


def unit_fault(chosen: ChosenLaw, unit: MotorUnit) -> str:
    """What is wrong with a law of a motor unit, "" if nothing."""
    lengths = unit.laws["sarcomere"].values
    context = {
        "myosin_length": lengths["myosin_length"],
        "actin_length": lengths["actin_length"],
        "minimum_frequency": unit.values["minimum_frequency"],
        "maximum_frequency": unit.values["maximum_frequency"],
    }
    return cached_unit_fault(Same(chosen), tuple(context.items()))


class Same:
    """A chosen law that equals another of the same law and values, wherever it was chosen."""

    def __init__(self, chosen: ChosenLaw) -> None:
        self.chosen = chosen
        self.key = (chosen.law, tuple(sorted(chosen.values.items())))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Same) and self.key == other.key

    def __hash__(self) -> int:
        return hash(self.key)


@lru_cache(maxsize=1024)
def cached_unit_fault(same: Same, context: Frozen) -> str:
    """`unit_fault` of a law among the numbers of its unit that concern it."""
    chosen = same.chosen
    return first(interface_fault(chosen), lambda: UNIT_CHECKS[chosen.law.process](chosen, dict(context)))


def first(fault: str, then: Callable[[], str]) -> str:
    """A fault, else what a further check finds; a law that cannot be evaluated is a fault."""
    if fault:
        return fault
    try:
        return then()
    except BrokenLaw as problem:
        return str(problem)


def interface_fault(chosen: ChosenLaw) -> str:
    """What keeps a law from fitting its contract. Laws that come with the package do."""
    law, contract = chosen.law, CONTRACTS[chosen.law.process]
    if not chosen.module:
        return ""
    states = {state.name for state in law.states}
    defined = {item.defines for item in law.equations} | states
    for variable in contract.defines:
        if variable not in defined:
            return f"it does not define {variable}, which a law of {contract.process} owes"
    allowed = {*contract.given, *defined, *chosen.values}
    for item in law.equations:
        for symbol in item.uses:
            if symbol not in allowed:
                given = ", ".join(contract.given)
                return f"equation {item.number} uses {symbol}; a law of {contract.process} is given {given}"
    for state in law.states:
        if state.rate not in defined:
            return f"it does not define {state.rate}, the rate of its state {state.name}"
        if state.initial not in allowed:
            return f"it does not define {state.initial}, the initial value of its state {state.name}"
    for item in law.equations:
        try:
            refuse_unsupported(item.function)
        except UnsupportedCode as problem:
            return f"it cannot be compiled: {problem}"
    return ""


# Curves


def grid(low: float, high: float, count: int = POINTS) -> list[float]:
    """Evenly spaced points, both ends among them."""
    return [low + (high - low) * index / count for index in range(count)] + [high]


def number(value: float) -> str:
    """A number in a message."""
    return "not a number" if math.isnan(value) else f"{value:.4g}"


def place(variable: str, value: float) -> str:
    """A point in a message."""
    unit = UNITS.get(variable, "")
    return f"{variable} {value:.6g}{' ' + unit if unit else ''}"


def curve_fault(
    name: str,
    variable: str,
    xs: list[float],
    ys: list[float],
    *,
    direction: int = 0,
    least: float = -math.inf,
    suffix: str = "",
) -> str:
    """Where a curve is not finite, goes below `least`, or against `direction` (-1 falls, 1 rises)."""
    for x, y in zip(xs, ys, strict=True):
        if not math.isfinite(y):
            return f"{name} is {number(y)} at {place(variable, x)}{suffix}; it must be finite"
        if y < least:
            return f"{name} is {number(y)} at {place(variable, x)}{suffix}; it must be at least {least:g}"
    if direction:
        slack = ROUND_OFF * max(abs(y) for y in ys)
        for (x0, y0), (x1, y1) in pairwise(zip(xs, ys, strict=True)):
            if direction * (y1 - y0) < -slack:
                wrong, right = ("rises", "fall") if direction < 0 else ("falls", "rise")
                return f"{name} {wrong} between {variable} {x0:.6g} and {place(variable, x1)}{suffix}; it must {right}"
    return ""


def kink_fault(name: str, variable: str, curve: Callable[[float], float], scale: float, suffix: str) -> str:
    """Whether value or slope differ on the two sides of zero.

    Both are carried to zero from two distances, so that the curvature does not pass for a kink.
    """
    near, far = 1e-6 * scale, 2e-6 * scale
    value = curve(0.0)
    sides = []
    for sign in (-1.0, 1.0):
        at_near, at_far = curve(sign * near), curve(sign * far)
        sides.append((2.0 * at_near - at_far, sign * (at_far - at_near) / (far - near)))
        second = (curve(sign * 2.0 * far) - at_far) / (2.0 * far - far) * sign
        sides[-1] = (sides[-1][0], sides[-1][1] + 0.75 * (sides[-1][1] - second))
    (below, slope_below), (above, slope_above) = sides
    steepest = max(abs(slope_below), abs(slope_above))
    step = max(abs(value - below), abs(above - value))
    if step > KINK * near * steepest + 1e-9 * abs(value):
        return f"{name} jumps from {below:.4g} over {value:.4g} to {above:.4g} at {place(variable, 0.0)}{suffix}"
    if abs(slope_above - slope_below) > KINK * steepest:
        return (
            f"{name} has a kink at {place(variable, 0.0)}{suffix}: its slope is {slope_below:.4g} below "
            f"and {slope_above:.4g} above"
        )
    return ""


# Laws of motor units


def lengths(context: dict[str, float]) -> dict[str, float]:
    """Optimal, shortest and longest length (m) of the unit's sarcomeres."""
    return {
        "optimal_sarcomere_length": optimal_sarcomere_length(context["actin_length"]),
        "minimum_sarcomere_length": minimum_sarcomere_length(context["myosin_length"]),
        "maximum_sarcomere_length": maximum_sarcomere_length(context["myosin_length"], context["actin_length"]),
    }


def some_lengths(probe: Probe, fixed: dict[str, float]) -> Iterator[tuple[dict[str, float], str]]:
    """The optimal length, and for a law that depends on the length further ones; words for messages."""
    depends = probe.uses("sarcomere_length") or probe.uses("fibre_length_norm")
    least, best, most = (fixed[f"{end}_sarcomere_length"] for end in ("minimum", "optimal", "maximum"))
    for length in (best, least, 0.5 * (least + best), 0.5 * (best + most), most) if depends else (best,):
        point = {"sarcomere_length": length, "fibre_length_norm": fibre_length_norm(length, least, best, most)}
        yield point, f" and {place('sarcomere_length', length)}" if depends else ""


def states_fault(chosen: ChosenLaw, probe: Probe, points: Iterator[tuple[dict[str, float], str]]) -> str:
    """Whether the rates of a law's states are finite, at the start and over the declared ranges."""
    law = chosen.law
    starts = {s.name: chosen.values.get(s.initial, probe.start.get(s.initial, 0.0)) for s in law.states}
    tried = [starts]
    for state in law.states:
        low, high = law.ranges.get(state.name, (0.5 * starts[state.name], 1.5 * starts[state.name]))
        tried += [{**starts, state.name: low}, {**starts, state.name: high}]
    for point, words in points:
        for values in tried:
            found = probe.at(**{**values, **point})
            for state in law.states:
                if not math.isfinite(found[state.rate]):
                    at = ", ".join(f"{name} {value:.4g}" for name, value in values.items())
                    return f"{state.rate} is {number(found[state.rate])} at {at}{words}; it must be finite"
    return ""


def given(chosen: ChosenLaw) -> list[str]:
    """The variables that a law of its process is given, and its states."""
    return [*CONTRACTS[chosen.law.process].given, *(state.name for state in chosen.law.states)]


def sarcomere_fault(chosen: ChosenLaw, context: dict[str, float]) -> str:
    """Falls with the velocity, with equal value and slope on both sides of zero velocity."""
    variable, name = "sarcomere_velocity", "sarcomere_force"
    fixed = lengths(context)
    names = [n for n in given(chosen) if n not in fixed]
    probe = Probe(chosen, names, {})
    fastest = FASTEST * fixed["optimal_sarcomere_length"]
    low, high = chosen.law.ranges.get(variable, (-fastest, fastest))
    velocities = grid(low, high)
    frequency = context["maximum_frequency"]
    if chosen.law.states:
        points = (
            (
                {**point, variable: velocity, "sarcomere_frequency": frequency},
                f", {place(variable, velocity)}{words}",
            )
            for point, words in some_lengths(probe, fixed)
            for velocity in velocities[::4]
        )
        return states_fault(chosen, probe, points)
    # Close to zero, where a fast law hides what it does.
    small = [high * 10.0**power for power in (-4.0, -3.5, -3.0, -2.5)]
    velocities = sorted({*velocities, *small, *(-v for v in small)} & set(filter(lambda v: low <= v <= high, [*velocities, *small, *(-v for v in small)])))
    for point, words in some_lengths(probe, fixed):

        def curve(velocity: float, point: dict[str, float] = point) -> float:
            return probe.at(**point, sarcomere_velocity=velocity, sarcomere_frequency=frequency)[name]

        forces = [curve(velocity) for velocity in velocities]
        fault = curve_fault(name, variable, velocities, forces, direction=-1, suffix=words)
        fault = fault or kink_fault(name, variable, curve, min(high, -low), words)
        if fault:
            return fault
    return ""


def force_length_fault(chosen: ChosenLaw, context: dict[str, float]) -> str:
    """Finite and not negative."""
    return by_length(chosen, context, "force_length_factor", 0)


def passive_force_fault(chosen: ChosenLaw, context: dict[str, float]) -> str:
    """Rises with the length, not negative."""
    return by_length(chosen, context, "passive_force_factor", 1)


def by_length(chosen: ChosenLaw, context: dict[str, float], name: str, direction: int) -> str:
    """A factor over normalised fibre lengths from 0 to 2, or the declared range."""
    variable = "fibre_length_norm"
    fixed = lengths(context)
    least, best, most = (fixed[f"{end}_sarcomere_length"] for end in ("minimum", "optimal", "maximum"))
    probe = Probe(chosen, given(chosen), fixed)
    norms = grid(*chosen.law.ranges.get(variable, (0.0, 2.0)))
    points = [
        {variable: norm, "sarcomere_length": least + norm * (best - least) if norm < 1.0 else best + (norm - 1.0) * (most - best)}
        for norm in norms
    ]
    if chosen.law.states:
        return states_fault(chosen, probe, ((point, f" and {place(variable, point[variable])}") for point in points))
    values = [probe.at(**point)[name] for point in points]
    return curve_fault(name, variable, norms, values, direction=direction, least=0.0)


def force_frequency_fault(chosen: ChosenLaw, context: dict[str, float]) -> str:
    """Zero at zero frequency, rises from the lowest to the greatest frequency of the unit."""
    variable, name = "stimulation_frequency", "force_frequency_factor"
    low, high = context["minimum_frequency"], context["maximum_frequency"]
    fixed = {**lengths(context), "minimum_frequency": low, "maximum_frequency": high}
    probe = Probe(chosen, given(chosen), fixed)
    frequencies = [0.0, *grid(*chosen.law.ranges.get(variable, (low, high)), POINTS // 2)]
    inputs = [{variable: f, "frequency_norm": frequency_norm(f, low, high)} for f in frequencies]
    if chosen.law.states:
        points = (
            ({**point, **entry}, f" and {place(variable, entry[variable])}{words}")
            for point, words in some_lengths(probe, fixed)
            for entry in inputs
        )
        return states_fault(chosen, probe, points)
    for point, words in some_lengths(probe, fixed):
        values = [probe.at(**point, **entry)[name] for entry in inputs]
        fault = curve_fault(name, variable, frequencies, values, direction=1, suffix=words)
        if fault:
            return fault
        if abs(values[0]) > 1e-9:
            return f"{name} is {number(values[0])} at {place(variable, 0.0)}{words}; it must be 0"
    return ""


def recruitment_fault(chosen: ChosenLaw, context: dict[str, float]) -> str:
    """Zero at zero activation, rises, for early and late units."""
    variable, name = "activation", "stimulation_frequency"
    fixed = {key: context[key] for key in ("minimum_frequency", "maximum_frequency")}
    probe = Probe(chosen, given(chosen), fixed)
    activations = grid(*chosen.law.ranges.get(variable, (0.0, 1.0)), POINTS // 2)
    for rank, threshold in ((0.0, 0.0), (0.0, 0.3), (1.0, 0.8)):
        words = f" for unit_rank {rank:g} and unit_threshold {threshold:g}"
        unit = {"unit_rank": rank, "unit_threshold": threshold}
        if chosen.law.states:
            points = (({**unit, variable: a}, f" and {place(variable, a)}{words}") for a in activations)
            fault = states_fault(chosen, probe, points)
        else:
            values = [probe.at(**unit, activation=a)[name] for a in activations]
            fault = curve_fault(name, variable, activations, values, direction=1, least=0.0, suffix=words)
            if not fault and activations[0] == 0.0 and values[0] != 0.0:
                fault = f"{name} is {number(values[0])} at {place(variable, 0.0)}{words}; it must be 0"
        if fault:
            return fault
    return ""


UNIT_CHECKS: dict[str, Callable[[ChosenLaw, dict[str, float]], str]] = {
    "sarcomere": sarcomere_fault,
    "force_length": force_length_fault,
    "force_frequency": force_frequency_fault,
    "passive_force": passive_force_fault,
    "recruitment": recruitment_fault,
}


# Laws of muscles


def activation_fault(chosen: ChosenLaw, muscle: Muscle, limb: Limb) -> str:
    """Finite for excitations from 0 to 1; rises with the excitation where it has no states."""
    return cached_activation_fault(Same(chosen))


@lru_cache(maxsize=1024)
def cached_activation_fault(same: Same) -> str:
    """`activation_fault` of a law, whose muscle does not matter."""
    chosen = same.chosen

    def check() -> str:
        excitations = grid(0.0, 1.0, 20)
        probe = Probe(chosen, given(chosen), {})
        if chosen.law.states:
            points = (
                ({"excitation": u, **({"activation": a} if "activation" in given(chosen) else {})}, f" and {place('excitation', u)}")
                for u in excitations
                for a in (0.0, 0.5, 1.0)
            )
            return states_fault(chosen, probe, points)
        values = [probe.at(excitation=u)["activation"] for u in excitations]
        return curve_fault("activation", "excitation", excitations, values, direction=1, least=0.0)

    return first(interface_fault(chosen), check)


def path_fault(chosen: ChosenLaw, muscle: Muscle, limb: Limb) -> str:
    """Length positive, velocity its rate, moment arm finite over the joint's range."""
    low, high = limb.segments[muscle.joint].joint_range or (-math.pi, math.pi)
    return cached_path_fault(Same(chosen), muscle.role, low, high)


@lru_cache(maxsize=1024)
def cached_path_fault(same: Same, role: float, low: float, high: float) -> str:
    """`path_fault` of a law over a range of joint angles."""
    chosen = same.chosen

    def check() -> str:
        variable = "joint_angle"
        probe = Probe(chosen, given(chosen), {"role": role})
        least, most = chosen.law.ranges.get(variable, (low, high))
        angles = grid(least, most, 40)[1:-1]
        points = [probe.at(joint_angle=angle, joint_velocity=1.0) for angle in angles]
        for name, bound in (("muscle_tendon_length", 0.0), ("muscle_tendon_velocity", -math.inf), ("moment_arm", -math.inf)):
            fault = curve_fault(name, variable, angles, [point[name] for point in points], least=bound)
            if fault:
                return fault
        small = 1e-5 * (most - least)
        for angle, point in zip(angles, points, strict=True):
            ends = [
                probe.at(joint_angle=angle + side, joint_velocity=1.0)["muscle_tendon_length"] for side in (-small, small)
            ]
            shortening = (ends[0] - ends[1]) / (2.0 * small)
            velocity = point["muscle_tendon_velocity"]
            if abs(shortening - velocity) > 1e-5 * (abs(shortening) + abs(velocity)) + 1e-9:
                return (
                    f"muscle_tendon_velocity is {velocity:.6g} at {place(variable, angle)} and joint_velocity 1 rad/s; "
                    f"the length shortens by {shortening:.6g}"
                )
        return ""

    return first(interface_fault(chosen), check)


def tendon_fault(chosen: ChosenLaw, muscle: Muscle, limb: Limb) -> str:
    """Lengthens the faster, the more it is pulled and the shorter it is."""
    return cached_tendon_fault(Same(chosen))


@lru_cache(maxsize=1024)
def cached_tendon_fault(same: Same) -> str:
    """`tendon_fault` of a law, whose muscle does not matter."""
    chosen = same.chosen

    def check() -> str:
        name, variable = "tendon_velocity", "tendon_length"
        probe = Probe(chosen, given(chosen), {})
        if variable not in given(chosen) or not chosen.law.states:
            found = probe.at(tendon_force=-1.0, tendon_length=chosen.values.get("slack_length", 0.0))
            return curve_fault(name, "tendon_force", [-1.0], [found[name]])
        slack = chosen.values.get("slack_length", 0.1) or 0.1
        low, high = chosen.law.ranges.get(variable, (0.8 * slack, 1.2 * slack))
        states = {s.name: chosen.values.get(s.initial, probe.start.get(s.initial, 0.0)) for s in chosen.law.states}
        for force in (0.0, -10.0, -1000.0):
            xs = grid(low, high, 60)
            ys = [probe.at(**{**states, "tendon_force": force, variable: x})[name] for x in xs]
            fault = curve_fault(name, variable, xs, ys, direction=-1, suffix=f" and {place('tendon_force', force)}")
            if fault:
                return fault
        xs = grid(-1000.0, 0.0, 20)
        for length in (low, 0.5 * (low + high), high):
            ys = [probe.at(**{**states, "tendon_force": x, variable: length})[name] for x in xs]
            fault = curve_fault(name, "tendon_force", xs, ys, direction=-1, suffix=f" and {place(variable, length)}")
            if fault:
                return fault
        return ""

    return first(interface_fault(chosen), check)


def aponeurosis_fault(chosen: ChosenLaw, muscle: Muscle, limb: Limb) -> str:
    """The force of the muscle and the velocity of the fibres rise with the force of the fibres."""
    rest = sum(unit.values["series_sarcomeres"] for unit in muscle.units) / len(muscle.units)
    values = muscle.units[0].laws["sarcomere"].values
    return cached_aponeurosis_fault(Same(chosen), rest * optimal_sarcomere_length(values["actin_length"]))


@lru_cache(maxsize=1024)
def cached_aponeurosis_fault(same: Same, rest: float) -> str:
    """`aponeurosis_fault` of a law around a muscle length (m)."""
    chosen = same.chosen

    def check() -> str:
        probe = Probe(chosen, given(chosen), {"muscle_velocity": 0.0})
        states = {s.name: chosen.values.get(s.initial, probe.start.get(s.initial, 0.0)) for s in chosen.law.states}
        # States of an aponeurosis bound the lengths that there are; `check_geometry` looks after those.
        stretch = max([rest, *(2.0 * value for value in states.values())]) if states else rest
        for length in (stretch,) if states else grid(0.5 * rest, 1.5 * rest, 10):
            points = [probe.at(**states, muscle_length=length, total_fibre_force=force) for force in (0.0, 1.0, 10.0, 100.0)]
            words = f" and {place('muscle_length', length)}"
            for name, direction in (("muscle_force", 1), ("fibre_velocity", 1), ("fibre_length", 0), ("pennation_angle", 0)):
                fault = curve_fault(
                    name,
                    "total_fibre_force",
                    [0.0, 1.0, 10.0, 100.0],
                    [point[name] for point in points],
                    direction=direction,
                    least=0.0 if name in ("muscle_force", "fibre_length") else -math.inf,
                    suffix=words,
                )
                if fault:
                    return fault
        return ""

    return first(interface_fault(chosen), check)


MUSCLE_CHECKS: dict[str, Callable[[ChosenLaw, Muscle, Limb], str]] = {
    "path": path_fault,
    "tendon": tendon_fault,
    "aponeurosis": aponeurosis_fault,
    "activation_dynamics": activation_fault,
}
