"""Which laws of a limb share a curve, and what its legend says."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from limb_nodes.analysis.curves.characteristic import Characteristic
from limb_nodes.model import ChosenLaw, Limb, MotorUnit, Muscle


@dataclass
class Use:
    """A law with one motor unit and one muscle that use it, and the names of all that do."""

    chosen: ChosenLaw
    unit: MotorUnit
    muscle: Muscle
    labels: list[str]


def unit_uses(limb: Limb, process: str, context: tuple[str, ...] = ()) -> list[Use]:
    """The different laws of a process in the motor units, with the names of what they belong to.

    context: parameters of the units on which the curve depends beside the law's.
    """
    uses: dict[object, Use] = {}
    for muscle in limb.muscles:
        for unit in muscle.units:
            chosen = unit.laws[process]
            key = (*law_key(chosen), *(unit.values[name] for name in context))
            use = uses.setdefault(key, Use(chosen, unit, muscle, []))
            label = section_name(chosen) or (unit.name if len(limb.muscles) == 1 else f"{muscle.name} {unit.name}")
            if label not in use.labels:
                use.labels.append(label)
    if len(uses) == 1:
        (only,) = uses.values()
        only.labels = only.labels if len(only.labels) <= 2 else ["all units"]
    return list(uses.values())


def muscle_uses(limb: Limb, process: str) -> list[Use]:
    """Each muscle with its law of a process."""
    return [Use(muscle.laws[process], muscle.units[0], muscle, [muscle.name]) for muscle in limb.muscles]


def shared(uses: list[Use]) -> list[Use]:
    """Muscles with the same law and values in one."""
    together: dict[object, Use] = {}
    for use in uses:
        key = law_key(use.chosen)
        if key in together:
            together[key].labels += use.labels
        else:
            together[key] = Use(use.chosen, use.unit, use.muscle, list(use.labels))
    return list(together.values())


def law_key(chosen: ChosenLaw) -> tuple[object, ...]:
    """Equal for the same law with the same values."""
    return (chosen.law, tuple(sorted(chosen.values.items())))


def section_name(chosen: ChosenLaw) -> str:
    """The name under `sarcomeres` or `unit_kinds` where a law was chosen, "" elsewhere."""
    steps = chosen.place.split(".")
    return steps[1] if steps[0] in ("sarcomeres", "unit_kinds") and len(steps) > 1 else ""


def words(labels: Iterable[str]) -> str:
    """Some names in a legend, at most three."""
    names = list(labels)
    return ", ".join(names if len(names) <= 3 else [*names[:2], f"{len(names) - 2} more"])


def legend(use: Use, diagram: Characteristic) -> str:
    """The names of who uses a law, with the law's if a diagram has several."""
    return words(use.labels) + (f" ({use.chosen.law.name})" if len(diagram.laws) > 1 else "")


def law_names(laws: Iterable[ChosenLaw]) -> list[str]:
    """The names of the laws, each once."""
    return list(dict.fromkeys(chosen.law.name for chosen in laws))
