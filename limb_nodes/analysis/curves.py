"""The characteristics of a limb's laws as curves, in SI units: what `limb curves` draws.

Laws that are the same with the same values share a curve, whose label names where they are.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.levels.motor_unit.fibre import fibre_length_norm, frequency_norm
from limb_nodes.levels.sarcomere.lengths import (
    maximum_sarcomere_length,
    minimum_sarcomere_length,
    optimal_sarcomere_length,
)
from limb_nodes.model.chosen import ChosenLaw
from limb_nodes.model.limb import Limb, MotorUnit, Muscle
from limb_nodes.model.probe import Probe, given, initial_states

POINTS = 201
# A limb without limits on its joints turns once around.
FREE = (-math.pi, math.pi)
# Sarcomere lengths over the optimal one, for laws that depend on it.
LENGTHS = (1.0, 0.8, 1.2)
# How long (s) a law with states is held at a velocity until its force is called steady.
SETTLING = 5.0


@dataclass(frozen=True)
class Curve:
    """x, y: SI units. key: what it belongs to, for its colour.

    label: in the legend, "" for a further curve of the same. style: 0 for a law's own curve, 1 and
    more for its variants.
    """

    label: str
    x: FloatArray
    y: FloatArray
    key: str
    style: int = 0


@dataclass
class Panel:
    """One characteristic. x_unit, y_unit: SI; laws: names of the laws drawn; figure: the report's.

    owners: what the curves belong to, "units" or "muscles". zero: whether the y axis starts at zero.
    """

    name: str
    title: str
    x_label: str
    x_unit: str
    y_label: str
    y_unit: str
    figure: str = ""
    curves: list[Curve] = field(default_factory=list)
    laws: list[str] = field(default_factory=list)
    note: str = ""
    owners: str = "units"
    zero: bool = True

    def add(self, curve: Curve) -> None:
        """Append a curve; one that cannot be told from an earlier one joins it in the legend."""
        for index, old in enumerate(self.curves):
            if old.label and curve.label and same_curve(old, curve):
                self.curves[index] = replace(old, label=f"{old.label}, {curve.label}")
                return
        self.curves.append(curve)


def same_curve(one: Curve, other: Curve) -> bool:
    """Whether two curves cannot be told apart."""
    return (
        one.x.shape == other.x.shape
        and np.allclose(one.x, other.x, rtol=1e-4)
        and np.allclose(one.y, other.y, rtol=1e-4, equal_nan=True)
    )


def characteristics(limb: Limb) -> list[Panel]:
    """Every characteristic of a limb's laws; those without a curve are left out."""
    panels = [
        force_velocity(limb),
        force_length(limb),
        force_frequency(limb),
        passive_force(limb),
        recruitment(limb),
        activation_dynamics(limb),
        tendon(limb),
        *paths(limb),
        pennation(limb),
    ]
    return [panel for panel in panels if panel.curves]


# Which laws share a curve


@dataclass
class Use:
    """A law with those who use it. context: what the curve depends on beside the law's values."""

    chosen: ChosenLaw
    unit: MotorUnit
    muscle: Muscle
    labels: list[str]


def unit_uses(limb: Limb, process: str, context: tuple[str, ...] = ()) -> list[Use]:
    """The different laws of a process in the motor units, with the names of what they belong to."""
    found: dict[object, Use] = {}
    for muscle in limb.muscles:
        for unit in muscle.units:
            chosen = unit.laws[process]
            key = (chosen.law, tuple(sorted(chosen.values.items())), *(unit.values[name] for name in context))
            use = found.setdefault(key, Use(chosen, unit, muscle, []))
            label = owner(chosen.place) or (unit.name if len(limb.muscles) == 1 else f"{muscle.name} {unit.name}")
            if label not in use.labels:
                use.labels.append(label)
    return merge_places(list(found.values()))


def muscle_uses(limb: Limb, process: str) -> list[Use]:
    """Each muscle with its law of a process."""
    return [Use(muscle.laws[process], muscle.units[0], muscle, [muscle.name]) for muscle in limb.muscles]


def owner(place: str) -> str:
    """The name under `sarcomeres` or `unit_kinds` where a law was chosen, "" elsewhere."""
    steps = place.split(".")
    return steps[1] if steps[0] in ("sarcomeres", "unit_kinds") and len(steps) > 1 else ""


def merge_places(uses: list[Use]) -> list[Use]:
    """A single use needs no more than "all units"."""
    if len(uses) == 1 and len(uses[0].labels) > 2:
        uses[0].labels = ["all units"]
    return uses


def words(labels: Iterable[str]) -> str:
    """Some names in a legend, at most three."""
    names = list(labels)
    return ", ".join(names if len(names) <= 3 else [*names[:2], f"{len(names) - 2} more"])


def legend(use: Use, panel: Panel) -> str:
    """The names of who uses a law, with the law's where a panel has several."""
    return words(use.labels) + (f" ({use.chosen.law.name})" if len(panel.laws) > 1 else "")


def law_names(uses: Iterable[Use]) -> list[str]:
    """The names of the laws, each once."""
    return list(dict.fromkeys(use.chosen.law.name for use in uses))


# Motor units


def unit_lengths(unit: MotorUnit) -> dict[str, float]:
    """Optimal, shortest and longest length (m) of a unit's sarcomeres."""
    values = unit.laws["sarcomere"].values
    return {
        "optimal_sarcomere_length": optimal_sarcomere_length(values["actin_length"]),
        "minimum_sarcomere_length": minimum_sarcomere_length(values["myosin_length"]),
        "maximum_sarcomere_length": maximum_sarcomere_length(values["myosin_length"], values["actin_length"]),
    }


def steady_state(chosen: ChosenLaw, probe: Probe, point: dict[str, float]) -> dict[str, float]:
    """All variables of a law whose states have settled at a point."""
    start = initial_states(chosen, probe)
    if not start:
        return probe.at(**point)
    names = list(start)
    rates = [state.rate for state in chosen.law.states]

    def slope(_: float, states: FloatArray) -> list[float]:
        found = probe.at(**point, **dict(zip(names, map(float, states), strict=True)))
        return [found[rate] for rate in rates]

    solved = solve_ivp(slope, (0.0, SETTLING), list(start.values()), method="LSODA", rtol=1e-6, atol=1e-9)
    return probe.at(**point, **dict(zip(names, map(float, solved.y[:, -1]), strict=True)))


def sarcomere_forces(use: Use, velocities: FloatArray) -> FloatArray:
    """Steady force (N) of a sarcomere at its optimal length by shortening velocity (m/s)."""
    best = unit_lengths(use.unit)["optimal_sarcomere_length"]
    probe = Probe(use.chosen, given(use.chosen), {})
    point = {"sarcomere_length": best, "sarcomere_frequency": use.unit.values["maximum_frequency"]}
    return np.array(
        [
            steady_state(use.chosen, probe, {**point, "sarcomere_velocity": float(velocity)})["sarcomere_force"]
            for velocity in velocities
        ]
    )


def unloaded_velocity(use: Use) -> float:
    """Shortening velocity (m/s) at which a sarcomere gives 1 % of its isometric force, or none."""
    isometric = sarcomere_forces(use, np.zeros(1))[0]
    best = unit_lengths(use.unit)["optimal_sarcomere_length"]
    fast = 0.05 * best
    while fast < 50.0 * best:
        if sarcomere_forces(use, np.array([fast]))[0] < 0.01 * isometric:
            break
        fast *= 1.3
    else:
        return best
    return float(
        brentq(lambda v: sarcomere_forces(use, np.array([v]))[0] - 0.01 * isometric, 0.0, fast, xtol=1e-3 * fast)
    )


def force_velocity(limb: Limb) -> Panel:
    """Force of a sarcomere by shortening velocity (fig. 2.2)."""
    panel = Panel(
        "force_velocity",
        "Force by velocity",
        "shortening velocity of a sarcomere",
        "m/s",
        "force of a sarcomere",
        "N",
        "fig. 2.2",
    )
    uses = unit_uses(limb, "sarcomere")
    panel.laws = law_names(uses)
    unloaded = [unloaded_velocity(use) for use in uses]
    for use, greatest in zip(uses, unloaded, strict=True):
        count = 41 if use.chosen.law.states else POINTS
        velocities = np.linspace(-0.6 * max(unloaded), 1.02 * greatest, count)
        panel.add(Curve(legend(use, panel), velocities, sarcomere_forces(use, velocities), use.labels[0]))
        if use.chosen.law.states:
            panel.note = f"{use.chosen.law.name} in steady state"
    return panel


def by_norm(limb: Limb, process: str, variable: str, panel: Panel) -> Panel:
    """A factor by normalised fibre length."""
    uses = unit_uses(limb, process)
    panel.laws = law_names(uses)
    norms = np.linspace(0.0, 2.0, POINTS)
    for use in uses:
        fixed = unit_lengths(use.unit)
        least, best, most = (fixed[f"{end}_sarcomere_length"] for end in ("minimum", "optimal", "maximum"))
        probe = Probe(use.chosen, given(use.chosen), fixed)
        lengths = np.interp(norms, [0.0, 1.0, 2.0], [least, best, most])
        values = [
            steady_state(use.chosen, probe, {"fibre_length_norm": float(norm), "sarcomere_length": float(length)})[
                variable
            ]
            for norm, length in zip(norms, lengths, strict=True)
        ]
        panel.add(Curve(legend(use, panel), norms, np.array(values), use.labels[0]))
    return panel


def force_length(limb: Limb) -> Panel:
    """Factor of the active force by fibre length (fig. 2.4)."""
    panel = Panel(
        "force_length",
        "Active force by length",
        "fibre length, 0 shortest, 1 optimal, 2 longest",
        "1",
        "force-length factor",
        "1",
        "fig. 2.4",
    )
    return by_norm(limb, "force_length", "force_length_factor", panel)


def passive_force(limb: Limb) -> Panel:
    """Factor of the passive force by fibre length (2.24)."""
    panel = Panel(
        "passive_force",
        "Passive force by length",
        "fibre length, 0 shortest, 1 optimal, 2 longest",
        "1",
        "passive force factor",
        "1",
    )
    return by_norm(limb, "passive_force", "passive_force_factor", panel)


def force_frequency(limb: Limb) -> Panel:
    """Factor of the active force by stimulation frequency (fig. 2.5)."""
    panel = Panel(
        "force_frequency",
        "Active force by frequency",
        "stimulation frequency",
        "Hz",
        "force-frequency factor",
        "1",
        "fig. 2.5",
    )
    uses = unit_uses(limb, "force_frequency", ("minimum_frequency", "maximum_frequency"))
    panel.laws = law_names(uses)
    for use in uses:
        low, high = use.unit.values["minimum_frequency"], use.unit.values["maximum_frequency"]
        lengths = unit_lengths(use.unit)
        fixed = {**lengths, "minimum_frequency": low, "maximum_frequency": high}
        probe = Probe(use.chosen, given(use.chosen), fixed)
        depends = probe.uses("sarcomere_length") or probe.uses("fibre_length_norm")
        frequencies = np.linspace(low, high, POINTS)
        for style, part in enumerate(LENGTHS if depends else LENGTHS[:1]):
            length = part * lengths["optimal_sarcomere_length"]
            point = {
                "sarcomere_length": length,
                "fibre_length_norm": fibre_length_norm(
                    length,
                    lengths["minimum_sarcomere_length"],
                    lengths["optimal_sarcomere_length"],
                    lengths["maximum_sarcomere_length"],
                ),
            }
            values = [
                steady_state(
                    use.chosen,
                    probe,
                    {**point, "stimulation_frequency": float(f), "frequency_norm": frequency_norm(float(f), low, high)},
                )["force_frequency_factor"]
                for f in frequencies
            ]
            label = "" if style else legend(use, panel)
            panel.add(Curve(label, frequencies, np.array(values), use.labels[0], style))
        if depends:
            _, short, long = LENGTHS
            panel.note = f"dashed: {short:g}, dotted: {long:g} of the optimal length"
    return panel


def recruitment(limb: Limb) -> Panel:
    """Stimulation frequency of the motor units by activation (2.36); muscles with equal units share curves."""
    panel = Panel(
        "recruitment",
        "Recruitment of the motor units",
        "activation",
        "1",
        "stimulation frequency",
        "Hz",
        owners="muscles",
    )
    panel.laws = law_names(
        Use(muscle.units[0].laws["recruitment"], muscle.units[0], muscle, []) for muscle in limb.muscles
    )
    activations = np.linspace(0.0, 1.0, 2 * POINTS)
    drawn: list[tuple[FloatArray, list[str]]] = []
    for muscle in limb.muscles:
        rows = np.array([unit_frequencies(unit, activations) for unit in muscle.units])
        twin = next((names for old, names in drawn if np.array_equal(old, rows, equal_nan=True)), None)
        if twin is not None:
            twin.append(muscle.name)
        else:
            drawn.append((rows, [muscle.name]))
    for rows, names in drawn:
        for index, row in enumerate(rows):
            panel.curves.append(Curve("" if index else words(names), activations, row, names[0]))
    return panel


def unit_frequencies(unit: MotorUnit, activations: FloatArray) -> FloatArray:
    """Stimulation frequency (Hz) of a unit by activation, NaN where it is silent."""
    chosen = unit.laws["recruitment"]
    names = ("unit_threshold", "unit_rank", "minimum_frequency", "maximum_frequency")
    probe = Probe(chosen, given(chosen), {name: unit.values[name] for name in names})
    values = [steady_state(chosen, probe, {"activation": float(a)})["stimulation_frequency"] for a in activations]
    return np.array([value if value > 0.0 else np.nan for value in values])


# Muscles


def activation_dynamics(limb: Limb) -> Panel:
    """Activation after the excitation goes from 0 to 1 and, later, back to 0."""
    panel = Panel("activation_dynamics", "Activation", "time", "s", "activation", "1", owners="muscles")
    uses = [use for use in muscle_uses(limb, "activation_dynamics") if use.chosen.law.states]
    panel.laws = law_names(uses)
    panel.note = "excitation 1 for 0.2 s, then 0"
    times = np.linspace(0.0, 0.5, POINTS)
    for use in shared(uses):
        probe = Probe(use.chosen, given(use.chosen), {})
        names = [state.name for state in use.chosen.law.states]
        rates = [state.rate for state in use.chosen.law.states]
        states = [0.0 if name == "activation" else value for name, value in initial_states(use.chosen, probe).items()]
        pieces = []
        for excitation, span in ((1.0, times[times <= 0.2]), (0.0, times[times > 0.2])):

            def slope(_: float, y: FloatArray, excitation: float = excitation, probe: Probe = probe) -> list[float]:
                found = probe.at(excitation=excitation, **dict(zip(names, map(float, y), strict=True)))  # noqa: B023
                return [found[rate] for rate in rates]  # noqa: B023

            start = 0.0 if excitation else 0.2
            solved = solve_ivp(slope, (start, span[-1]), states, t_eval=span, max_step=0.01, rtol=1e-8, atol=1e-10)
            states = list(solved.y[:, -1])
            pieces += [
                probe.at(excitation=excitation, **dict(zip(names, map(float, y), strict=True)))["activation"]
                for y in solved.y.T
            ]
        panel.add(Curve(words(use.labels), times, np.array(pieces), use.labels[0]))
    return panel


def shared(uses: list[Use]) -> list[Use]:
    """Muscles with the same law and values in one."""
    found: dict[object, Use] = {}
    for use in uses:
        key = (use.chosen.law, tuple(sorted(use.chosen.values.items())))
        if key in found:
            found[key].labels += use.labels
        else:
            found[key] = Use(use.chosen, use.unit, use.muscle, list(use.labels))
    return list(found.values())


def greatest_force(muscle: Muscle) -> float:
    """Isometric force (N) of all motor units at their optimal length."""
    total = 0.0
    for unit in muscle.units:
        chosen = unit.laws["sarcomere"]
        best = unit_lengths(unit)["optimal_sarcomere_length"]
        point = {"sarcomere_velocity": 0.0, "sarcomere_length": best, "sarcomere_frequency": 0.0}
        probe = Probe(chosen, given(chosen), {})
        found = probe.at(**point, **initial_states(chosen, probe))
        total += unit.values["parallel_sarcomeres"] * found["maximum_sarcomere_force"]
    return total


def tendon(limb: Limb) -> Panel:
    """Force of a tendon at rest by its stretch, up to the muscle's greatest isometric force."""
    panel = Panel("tendon", "Tendon", "stretch of the tendon", "m", "force", "N", owners="muscles")
    uses = [use for use in muscle_uses(limb, "tendon") if "tendon_length" in initial_names(use.chosen)]
    panel.laws = law_names(uses)
    rigid = [use.muscle.name for use in muscle_uses(limb, "tendon") if "tendon_length" not in initial_names(use.chosen)]
    if rigid:
        panel.note = f"rigid: {words(rigid)}"
    for use in uses:
        probe = Probe(use.chosen, given(use.chosen), {})
        states = initial_states(use.chosen, probe)
        slack = use.chosen.values.get("slack_length", states["tendon_length"])
        forces = np.linspace(0.0, greatest_force(use.muscle), 101)[1:]
        lengths = [resting_length(probe, states, float(force), slack) for force in forces]
        stretch = np.array([0.0, *(length - slack for length in lengths)])
        panel.add(Curve(legend(use, panel), stretch, np.array([0.0, *forces]), use.muscle.name))
    return panel


def initial_names(chosen: ChosenLaw) -> set[str]:
    """Names of a law's states."""
    return {state.name for state in chosen.law.states}


def resting_length(probe: Probe, states: dict[str, float], force: float, slack: float) -> float:
    """Length (m) at which a tendon under a force neither lengthens nor shortens."""

    def velocity(length: float) -> float:
        return probe.at(**{**states, "tendon_force": -force, "tendon_length": length})["tendon_velocity"]

    longest = 1.05 * slack + 1e-3
    while velocity(longest) > 0.0 and longest < 1e3:
        longest += longest - slack
    return float(brentq(velocity, slack, longest, xtol=1e-12)) if velocity(slack) > 0.0 else slack


def joint_angles(limb: Limb, muscle: Muscle) -> FloatArray:
    """Joint angles (rad) over the range of a muscle's joint."""
    low, high = limb.segments[muscle.joint].joint_range or FREE
    return np.linspace(low, high, POINTS)


def path_values(use: Use, angles: FloatArray, variable: str) -> FloatArray:
    """A variable of a muscle's path by joint angle."""
    probe = Probe(use.chosen, given(use.chosen), {"role": use.muscle.role})
    return np.array([probe.at(joint_angle=float(angle), joint_velocity=0.0)[variable] for angle in angles])


def paths(limb: Limb) -> list[Panel]:
    """Muscle-tendon length and moment arm by joint angle (2.43-2.48)."""
    uses = muscle_uses(limb, "path")
    panels = []
    for name, title, label, variable in (
        ("path", "Path", "muscle-tendon length", "muscle_tendon_length"),
        ("moment_arm", "Moment arm", "moment arm", "moment_arm"),
    ):
        panel = Panel(
            name,
            title,
            "joint angle",
            "rad",
            label,
            "m",
            laws=law_names(uses),
            owners="muscles",
            zero=name == "moment_arm",
        )
        for use in uses:
            angles = joint_angles(limb, use.muscle)
            panel.add(Curve(use.muscle.name, angles, path_values(use, angles, variable), use.muscle.name))
        panels.append(panel)
    return panels


def pennation(limb: Limb) -> Panel:
    """Pennation angle by muscle length over the joint's range, for pennate muscles."""
    panel = Panel(
        "pennation", "Pennation", "muscle length", "m", "pennation angle", "rad", owners="muscles", zero=False
    )
    uses = []
    for use in muscle_uses(limb, "aponeurosis"):
        paths_use = Use(use.muscle.laws["path"], use.unit, use.muscle, [])
        slack = use.muscle.laws["tendon"].values.get("slack_length", 0.0)
        lengths = path_values(paths_use, joint_angles(limb, use.muscle), "muscle_tendon_length") - slack
        probe = Probe(use.chosen, given(use.chosen), {"muscle_velocity": 0.0, "total_fibre_force": 0.0})
        states = initial_states(use.chosen, probe)
        span = np.linspace(max(1e-4, float(lengths.min())), float(lengths.max()), POINTS)
        angles = np.array([probe.at(**states, muscle_length=float(length))["pennation_angle"] for length in span])
        if np.nanmax(np.abs(angles), initial=0.0) > 0.0:
            uses.append(use)
            panel.add(Curve(use.muscle.name, span, angles, use.muscle.name))
            if states:
                panel.note = "aponeurosis at its length at the start"
    panel.laws = law_names(uses)
    return panel
