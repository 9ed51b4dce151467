"""From a limb's YAML to checked parameters and the choice of laws."""

from limb_nodes.model.chosen import ChosenLaw
from limb_nodes.model.limb import Limb, MotorUnit, Muscle, Segment
from limb_nodes.model.load import load_limb, outline, parse_limb, with_values

__all__ = [
    "ChosenLaw",
    "Limb",
    "MotorUnit",
    "Muscle",
    "Segment",
    "load_limb",
    "outline",
    "parse_limb",
    "with_values",
]
