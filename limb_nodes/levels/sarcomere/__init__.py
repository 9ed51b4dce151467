"""Level of the sarcomere: force by shortening velocity."""

from limb_nodes.levels.sarcomere import constant, derenyi_vicsek, hill, huxley, huxley_distribution
from limb_nodes.levels.sarcomere.lengths import EQUATIONS, PARAMETERS

__all__ = ["EQUATIONS", "PARAMETERS", "constant", "derenyi_vicsek", "hill", "huxley", "huxley_distribution"]
