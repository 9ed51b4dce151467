"""Checks of a limb's laws when it is loaded: each keeps what the contract of its process asks for.

Every law is evaluated in plain Python over its declared range (`Law.ranges`, else the range that
its check gives). What is wrong is said with the place at which it is.
"""

from __future__ import annotations

import math
from functools import lru_cache

from limb_nodes.errors import UserError
from limb_nodes.levels import Equation
from limb_nodes.levels.sarcomere.lengths import optimal_sarcomere_length
from limb_nodes.levels.tangent import UnsupportedCode, refuse_unsupported
from limb_nodes.model.check_muscle_laws import MUSCLE_CHECKS
from limb_nodes.model.check_tissue_laws import TISSUE_CHECKS
from limb_nodes.model.check_unit_laws import UNIT_CHECKS
from limb_nodes.model.chosen import ChosenLaw
from limb_nodes.model.limb import Limb, MotorUnit, Muscle
from limb_nodes.model.probe import BrokenLaw
from limb_nodes.model.system import CONSTANTS, crossings_of, given_of, owed_by

# By process.
CHECKS = {**UNIT_CHECKS, **MUSCLE_CHECKS, **TISSUE_CHECKS}


def check_laws(limb: Limb) -> None:
    """Refuse a limb with a law that does not keep its contract. Raises UserError, one line."""
    for segment in limb.segments:
        lowest, highest = segment.joint_range or (-math.pi, math.pi)
        for tissue in segment.tissue:
            check_law(limb.file, tissue, {"lowest_angle": lowest, "highest_angle": highest})
    for muscle in limb.muscles:
        for chosen in muscle.laws.values():
            check_law(limb.file, chosen, muscle_context(chosen, muscle, limb))
        for unit in muscle.units:
            context = unit_context(unit)
            for chosen in unit.laws.values():
                check_law(limb.file, chosen, context)


def check_law(file: str, chosen: ChosenLaw, context: dict[str, float]) -> None:
    """Refuse a law. context: numbers of its muscle or unit that matter to its check."""
    wrong = fault(Same(chosen), tuple(context.items()))
    if wrong:
        name = f"{chosen.module}:{chosen.law.name}" if chosen.module else chosen.law.name
        raise UserError(f"{file}: {chosen.place}.law is {name!r}: {wrong}")


def unit_context(unit: MotorUnit) -> dict[str, float]:
    """What the laws of a unit are checked with."""
    lengths = unit.laws["sarcomere"].values
    return {
        "myosin_length": lengths["myosin_length"],
        "actin_length": lengths["actin_length"],
        "minimum_frequency": unit.values["minimum_frequency"],
        "maximum_frequency": unit.values["maximum_frequency"],
    }


def muscle_context(chosen: ChosenLaw, muscle: Muscle, limb: Limb) -> dict[str, float]:
    """What a law of a muscle is checked with: its joint's range, or its fibres' mean optimal length."""
    if chosen.law.process == "path":
        ranges: dict[str, float] = {}
        for one, joint in zip(crossings_of(chosen.law), muscle.joints, strict=True):
            low, high = limb.segments[joint].joint_range or (-math.pi, math.pi)
            ranges |= {f"lowest_angle{one}": low, f"highest_angle{one}": high}
        return {"role": muscle.role, **ranges}
    if chosen.law.process == "aponeurosis":
        optimal = [
            unit.values["series_sarcomeres"] * optimal_sarcomere_length(unit.laws["sarcomere"].values["actin_length"])
            for unit in muscle.units
        ]
        return {"optimal_length": sum(optimal) / len(optimal)}
    return {}


class Same:
    """A chosen law that equals another of the same law and values, wherever it was chosen."""

    def __init__(self, chosen: ChosenLaw) -> None:
        self.chosen = chosen
        law = chosen.law
        self.key = (law, tuple(law.ranges.items()), chosen.module, tuple(sorted(chosen.values.items())))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Same) and self.key == other.key

    def __hash__(self) -> int:
        return hash(self.key)


@lru_cache(maxsize=4096)
def fault(same: Same, context: tuple[tuple[str, float], ...]) -> str:
    """What is wrong with a law among the numbers of its unit or muscle, "" if nothing."""
    chosen = same.chosen
    # Laws that come with the package fit their contracts.
    if chosen.module:
        wrong = interface_fault(chosen)
        if wrong:
            return wrong
    try:
        return CHECKS[chosen.law.process](chosen, dict(context))
    except BrokenLaw as problem:
        return str(problem)


def interface_fault(chosen: ChosenLaw) -> str:
    """What keeps a law from fitting its contract."""
    law = chosen.law
    states = {state.name for state in law.states}
    defined = {item.defines for item in law.equations} | states
    for variable in owed_by(law):
        if variable not in defined:
            return f"it does not define {variable}, which a law of {law.process} owes"
    given = given_of(law)
    allowed = {*given, *defined, *chosen.values}
    for item in law.equations:
        for symbol in item.uses:
            if symbol not in allowed:
                return f"equation {item.number} uses {symbol}; a law of {law.process} is given {', '.join(given)}"
    for state in law.states:
        if state.rate not in defined:
            return f"it does not define {state.rate}, the rate of its state {state.name}"
        if state.initial not in allowed:
            return f"it does not define {state.initial}, the initial value of its state {state.name}"
    for item in changing_equations(chosen):
        try:
            refuse_unsupported(item.function)
        except UnsupportedCode as problem:
            return f"it cannot be compiled: {problem}"
    return ""


def changing_equations(chosen: ChosenLaw) -> list[Equation]:
    """The equations whose values a movement can change: those that use a variable, through any chain.

    They are compiled; the others, of parameters alone, run once, interpreted.
    """
    law = chosen.law
    variables = {*given_of(law), *(state.name for state in law.states)} - CONSTANTS
    waiting = list(law.equations)
    changing: list[Equation] = []
    while True:
        new = [item for item in waiting if variables.intersection(item.uses) - chosen.values.keys()]
        if not new:
            return changing
        variables.update(item.defines for item in new)
        waiting = [item for item in waiting if item not in new]
        changing += new
