"""Characteristics of the laws of motor units."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.optimize import brentq

from limb_nodes.analysis.curves.characteristic import Axis, Characteristic, Curve
from limb_nodes.analysis.curves.movement import steady_state
from limb_nodes.analysis.curves.uses import Use, law_names, legend, unit_uses, words
from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.levels.motor_unit.fibre import fibre_length_norm, frequency_norm
from limb_nodes.levels.sarcomere.lengths import sarcomere_lengths
from limb_nodes.model import Limb, MotorUnit
from limb_nodes.model.probe import Probe, given

POINTS = 201
# Sarcomere lengths over the optimal one, for laws that depend on it.
LENGTHS = (1.0, 0.8, 1.2)
FIBRE_LENGTH = Axis("fibre length, 0 shortest, 1 optimal, 2 longest", "1")


def unit_lengths(unit: MotorUnit) -> dict[str, float]:
    """Optimal, shortest and longest length (m) of a unit's sarcomeres."""
    return sarcomere_lengths(unit.laws["sarcomere"].values)


def sarcomere_forces(use: Use, velocities: FloatArray) -> FloatArray:
    """Steady force (N) of a sarcomere at its optimal length by shortening velocity (m/s)."""
    best = unit_lengths(use.unit)["optimal_sarcomere_length"]
    probe = Probe(use.chosen, given(use.chosen), {})
    point = {"sarcomere_length": best, "sarcomere_frequency": use.unit.values["maximum_frequency"]}
    points = ({**point, "sarcomere_velocity": float(velocity)} for velocity in velocities)
    return np.array([steady_state(use.chosen, probe, one)["sarcomere_force"] for one in points])


def unloaded_velocity(use: Use) -> float:
    """Shortening velocity (m/s) at which a sarcomere gives 1 % of its isometric force.

    Its optimal length in a second if there is none up to 50 times as fast.
    """
    least = 0.01 * sarcomere_forces(use, np.zeros(1))[0]
    best = unit_lengths(use.unit)["optimal_sarcomere_length"]

    def spare(velocity: float) -> float:
        return float(sarcomere_forces(use, np.array([velocity]))[0] - least)

    fast = 0.05 * best
    while spare(fast) >= 0.0:
        fast *= 1.3
        if fast >= 50.0 * best:
            return best
    return float(brentq(spare, 0.0, fast, xtol=1e-3 * fast))


def force_velocity(limb: Limb) -> Characteristic:
    """Force of a sarcomere by shortening velocity (fig. 2.2)."""
    velocity, force = Axis("shortening velocity of a sarcomere", "m/s"), Axis("force of a sarcomere", "N")
    diagram = Characteristic("force_velocity", "Force by velocity", velocity, force, "fig. 2.2")
    uses = unit_uses(limb, "sarcomere")
    diagram.laws = law_names(use.chosen for use in uses)
    unloaded = [unloaded_velocity(use) for use in uses]
    for use, greatest in zip(uses, unloaded, strict=True):
        count = 41 if use.chosen.law.states else POINTS
        velocities = np.linspace(-0.6 * max(unloaded), 1.02 * greatest, count)
        diagram.add(Curve(legend(use, diagram), velocities, sarcomere_forces(use, velocities), use.labels[0]))
        if use.chosen.law.states:
            diagram.note = f"{use.chosen.law.name} in steady state"
    return diagram


def force_length(limb: Limb) -> Characteristic:
    """Factor of the active force by fibre length (fig. 2.4)."""
    factor = Axis("force-length factor", "1")
    diagram = Characteristic("force_length", "Active force by length", FIBRE_LENGTH, factor, "fig. 2.4")
    return by_length(limb, "force_length_factor", diagram)


def passive_force(limb: Limb) -> Characteristic:
    """Factor of the passive force by fibre length (2.24)."""
    factor = Axis("passive force factor", "1")
    diagram = Characteristic("passive_force", "Passive force by length", FIBRE_LENGTH, factor)
    return by_length(limb, "passive_force_factor", diagram)


def by_length(limb: Limb, variable: str, diagram: Characteristic) -> Characteristic:
    """The diagram, of the name of its process, with a factor by normalised fibre length."""
    uses = unit_uses(limb, diagram.name)
    diagram.laws = law_names(use.chosen for use in uses)
    norms = np.linspace(0.0, 2.0, POINTS)
    for use in uses:
        fixed = unit_lengths(use.unit)
        probe = Probe(use.chosen, given(use.chosen), fixed)
        ends = [fixed[f"{end}_sarcomere_length"] for end in ("minimum", "optimal", "maximum")]
        lengths = np.interp(norms, [0.0, 1.0, 2.0], ends)
        points = (
            {"fibre_length_norm": float(norm), "sarcomere_length": float(length)}
            for norm, length in zip(norms, lengths, strict=True)
        )
        values = np.array([steady_state(use.chosen, probe, point)[variable] for point in points])
        diagram.add(Curve(legend(use, diagram), norms, values, use.labels[0]))
    return diagram


def force_frequency(limb: Limb) -> Characteristic:
    """Factor of the active force by stimulation frequency (fig. 2.5)."""
    frequency, factor = Axis("stimulation frequency", "Hz"), Axis("force-frequency factor", "1")
    diagram = Characteristic("force_frequency", "Active force by frequency", frequency, factor, "fig. 2.5")
    uses = unit_uses(limb, "force_frequency", ("minimum_frequency", "maximum_frequency"))
    diagram.laws = law_names(use.chosen for use in uses)
    for use in uses:
        low, high = use.unit.values["minimum_frequency"], use.unit.values["maximum_frequency"]
        fixed = {**unit_lengths(use.unit), "minimum_frequency": low, "maximum_frequency": high}
        probe = Probe(use.chosen, given(use.chosen), fixed)
        depends = probe.uses("sarcomere_length") or probe.uses("fibre_length_norm")
        frequencies = np.linspace(low, high, POINTS)
        for style, part in enumerate(LENGTHS if depends else LENGTHS[:1]):
            label = "" if style else legend(use, diagram)
            factors = frequency_factors(use, probe, frequencies, length_point(use.unit, part))
            diagram.add(Curve(label, frequencies, factors, use.labels[0], style))
        if depends:
            _, short, long = LENGTHS
            diagram.note = f"dashed: {short:g}, dotted: {long:g} of the optimal length"
    return diagram


def length_point(unit: MotorUnit, part: float) -> dict[str, float]:
    """The length of a unit's sarcomeres at a part of the optimal one, absolute (m) and normalised."""
    lengths = unit_lengths(unit)
    length = part * lengths["optimal_sarcomere_length"]
    ends = (lengths[f"{end}_sarcomere_length"] for end in ("minimum", "optimal", "maximum"))
    return {"sarcomere_length": length, "fibre_length_norm": fibre_length_norm(length, *ends)}


def frequency_factors(use: Use, probe: Probe, frequencies: FloatArray, point: Mapping[str, float]) -> FloatArray:
    """Factor of the active force by stimulation frequency (Hz) at a length."""
    low, high = frequencies[0], frequencies[-1]
    points = (
        {**point, "stimulation_frequency": f, "frequency_norm": frequency_norm(f, low, high)}
        for f in map(float, frequencies)
    )
    return np.array([steady_state(use.chosen, probe, one)["force_frequency_factor"] for one in points])


def recruitment(limb: Limb) -> Characteristic:
    """Stimulation frequency of the motor units by activation (2.36); muscles with equal units share curves."""
    activation, frequency = Axis("activation", "1"), Axis("stimulation frequency", "Hz")
    diagram = Characteristic("recruitment", "Recruitment of the motor units", activation, frequency, owners="muscles")
    diagram.laws = law_names(muscle.units[0].laws["recruitment"] for muscle in limb.muscles)
    activations = np.linspace(0.0, 1.0, 2 * POINTS)
    drawn: list[tuple[FloatArray, list[str]]] = []
    for muscle in limb.muscles:
        rows = np.array([unit_frequencies(unit, activations) for unit in muscle.units])
        same = next((names for old, names in drawn if np.array_equal(old, rows, equal_nan=True)), None)
        if same is not None:
            same.append(muscle.name)
        else:
            drawn.append((rows, [muscle.name]))
    for rows, names in drawn:
        for index, row in enumerate(rows):
            diagram.curves.append(Curve("" if index else words(names), activations, row, names[0]))
    return diagram


def unit_frequencies(unit: MotorUnit, activations: FloatArray) -> FloatArray:
    """Stimulation frequency (Hz) of a unit by activation, NaN while it is silent."""
    chosen = unit.laws["recruitment"]
    names = ("unit_threshold", "unit_rank", "minimum_frequency", "maximum_frequency")
    probe = Probe(chosen, given(chosen), {name: unit.values[name] for name in names})
    values = [steady_state(chosen, probe, {"activation": float(a)})["stimulation_frequency"] for a in activations]
    return np.array([value if value > 0.0 else np.nan for value in values])
