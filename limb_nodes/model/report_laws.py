"""Which laws are the report's, and which of a limb's are not."""

from __future__ import annotations

from limb_nodes.levels import CONTRACTS, Law
from limb_nodes.model.chosen import ChosenLaw
from limb_nodes.model.limb import Limb


def is_of_report(law: Law, module: str = "") -> bool:
    """Whether a law is the report's; module: of the user's, if it is from there."""
    contract = CONTRACTS[law.process]
    if module or contract.owner == "joint":
        return False
    return law.name in (contract.default, contract.absent) or law.source.startswith("report")


def other_laws(limb: Limb) -> list[str]:
    """The laws of a limb that are not the report's, each with whose they are."""
    owners: dict[str, list[str]] = {}

    def note(chosen: ChosenLaw, owner: str) -> None:
        if not is_of_report(chosen.law, chosen.module):
            name = f"{chosen.module}:{chosen.law.name}" if chosen.module else chosen.law.name
            owners.setdefault(f"{chosen.law.process} {name}", []).append(owner)

    for segment in limb.segments:
        for tissue in segment.tissue:
            note(tissue, segment.joint)
    for muscle in limb.muscles:
        for chosen in (*muscle.laws.values(), *(law for unit in muscle.units for law in unit.laws.values())):
            note(chosen, muscle.name)
    return [f"{law} ({', '.join(dict.fromkeys(names))})" for law, names in owners.items()]
