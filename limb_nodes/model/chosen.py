"""A law as a limb has chosen it."""

from __future__ import annotations

from dataclasses import dataclass

from limb_nodes.levels import Law


@dataclass(frozen=True)
class ChosenLaw:
    """A law with the values of its parameters (SI units) and the place where it was chosen.

    module: the name of the user's module that the law came from, "" for a registered law.
    """

    law: Law
    values: dict[str, float]
    place: str
    module: str = ""
