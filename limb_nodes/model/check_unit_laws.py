"""Checks of the laws of motor units: sarcomere, force by length and frequency, passive force, recruitment."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from limb_nodes.levels.motor_unit.fibre import fibre_length_norm, frequency_norm
from limb_nodes.levels.sarcomere.lengths import sarcomere_lengths
from limb_nodes.model.chosen import ChosenLaw
from limb_nodes.model.curve_checks import POINTS, curve_fault, grid, kink_fault, number_text, point_text
from limb_nodes.model.probe import Probe, given, states_fault

# Greatest velocity at which a sarcomere law is checked, in its optimal lengths per second, about
# what the fastest limb muscles reach.
FASTEST = 10.0


def some_lengths(probe: Probe, fixed: dict[str, float]) -> Iterator[tuple[dict[str, float], str]]:
    """The optimal length, and for a law that depends on the length further ones; words for messages."""
    depends = probe.uses("sarcomere_length") or probe.uses("fibre_length_norm")
    least, best, most = (fixed[f"{end}_sarcomere_length"] for end in ("minimum", "optimal", "maximum"))
    for length in (best, least, 0.5 * (least + best), 0.5 * (best + most), most) if depends else (best,):
        point = {"sarcomere_length": length, "fibre_length_norm": fibre_length_norm(length, least, best, most)}
        yield point, f" and {point_text('sarcomere_length', length)}" if depends else ""


def sarcomere_fault(chosen: ChosenLaw, context: dict[str, float]) -> str:
    """Falls with the velocity, with equal value and slope on both sides of zero velocity."""
    variable, name = "sarcomere_velocity", "sarcomere_force"
    fixed = sarcomere_lengths(context)
    probe = Probe(chosen, given(chosen), {})
    fastest = FASTEST * fixed["optimal_sarcomere_length"]
    low, high = chosen.law.ranges.get(variable, (-fastest, fastest))
    velocities = grid(low, high)
    frequency = context["maximum_frequency"]
    if chosen.law.states:
        points = (
            (
                {**point, variable: velocity, "sarcomere_frequency": frequency},
                f", {point_text(variable, velocity)}{words}",
            )
            for point, words in some_lengths(probe, fixed)
            for velocity in velocities[::4]
        )
        return states_fault(chosen, probe, points)
    # A slow law hides what it does close to zero.
    near = [velocity * 10.0**power for velocity in (low, high) for power in (-4.0, -3.5, -3.0, -2.5)]
    velocities = sorted({*velocities, *near})
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
    return length_factor_fault(chosen, context, "force_length_factor", 0)


def passive_force_fault(chosen: ChosenLaw, context: dict[str, float]) -> str:
    """Rises with the length, not negative."""
    return length_factor_fault(chosen, context, "passive_force_factor", 1)


def length_factor_fault(chosen: ChosenLaw, context: dict[str, float], name: str, direction: int) -> str:
    """A factor over normalised fibre lengths from 0 to 2, or the declared range."""
    variable = "fibre_length_norm"
    fixed = sarcomere_lengths(context)
    least, best, most = (fixed[f"{end}_sarcomere_length"] for end in ("minimum", "optimal", "maximum"))
    probe = Probe(chosen, given(chosen), fixed)
    norms = grid(*chosen.law.ranges.get(variable, (0.0, 2.0)))
    points = []
    for norm in norms:
        length = least + norm * (best - least) if norm < 1.0 else best + (norm - 1.0) * (most - best)
        points.append({variable: norm, "sarcomere_length": length})
    if chosen.law.states:
        return states_fault(
            chosen, probe, ((point, f" and {point_text(variable, point[variable])}") for point in points)
        )
    values = [probe.at(**point)[name] for point in points]
    return curve_fault(name, variable, norms, values, direction=direction, least=0.0)


def force_frequency_fault(chosen: ChosenLaw, context: dict[str, float]) -> str:
    """Zero at zero frequency, rises from the lowest to the greatest frequency of the unit."""
    variable, name = "stimulation_frequency", "force_frequency_factor"
    low, high = context["minimum_frequency"], context["maximum_frequency"]
    fixed = {**sarcomere_lengths(context), "minimum_frequency": low, "maximum_frequency": high}
    probe = Probe(chosen, given(chosen), fixed)
    frequencies = [0.0, *grid(*chosen.law.ranges.get(variable, (low, high)), POINTS // 2)]
    inputs = [{variable: f, "frequency_norm": frequency_norm(f, low, high)} for f in frequencies]
    if chosen.law.states:
        points = (
            ({**point, **entry}, f" and {point_text(variable, entry[variable])}{words}")
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
            return f"{name} is {number_text(values[0])} at {point_text(variable, 0.0)}{words}; 0 is needed"
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
            points = (({**unit, variable: a}, f" and {point_text(variable, a)}{words}") for a in activations)
            fault = states_fault(chosen, probe, points)
        else:
            values = [probe.at(**unit, activation=a)[name] for a in activations]
            fault = curve_fault(name, variable, activations, values, direction=1, least=0.0, suffix=words)
            if not fault and activations[0] == 0.0 and values[0] != 0.0:
                fault = f"{name} is {number_text(values[0])} at {point_text(variable, 0.0)}{words}; 0 is needed"
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
