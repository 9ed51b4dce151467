"""Level of the muscle, with its sub-levels tendon and aponeurosis."""

from limb_nodes.levels.muscle import activation_dynamics, aponeurosis, path, tendon
from limb_nodes.levels.muscle.whole import EQUATIONS

__all__ = ["EQUATIONS", "activation_dynamics", "aponeurosis", "path", "tendon"]
