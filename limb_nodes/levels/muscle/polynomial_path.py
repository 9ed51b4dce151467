"""A path whose length is a polynomial in the joint angles: l_MT = sum of c_i prod of alpha_k^(e_ik)."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

from limb_nodes.foundation.parameter import Parameter
from limb_nodes.levels.derivative import written
from limb_nodes.levels.equation import Equation, Law
from limb_nodes.levels.muscle.spanning_path import LENGTH, spanning

SOURCE = "Menegaldo, de Toledo Fleury and Weber, J Biomech 37 (2004) 1447: polynomials in the joint angles"
COEFFICIENT = Parameter("coefficient", "m", "of the product of powers of the angles (rad)", minimum=-10.0, maximum=10.0)
MOST_POWER = 9


@lru_cache(maxsize=256)
def polynomial(powers: tuple[tuple[int, ...], ...]) -> Law:
    """The law of terms, each with the power of every joint's angle; its parameters are coefficient_0, ..."""
    angles = tuple(f"joint_angle_{place}" for place in range(len(powers[0])))
    names = [f"coefficient_{place}" for place in range(len(powers))]
    terms = []
    for name, term in zip(names, powers, strict=True):
        # Products: a power of zero has no logarithm.
        factors = [angle for angle, power in zip(angles, term, strict=True) for _ in range(power)]
        terms.append(" * ".join([name, *factors]))
    text = f"def muscle_tendon_length({', '.join((*angles, *names))}):\n    return {' + '.join(terms)}\n"
    parameters = tuple(replace(COEFFICIENT, name=name) for name in names)
    equation = Equation("polynomial", LENGTH, written("muscle_tendon_length", text))
    return spanning(Law("path", "polynomial", (equation,), parameters, source=SOURCE), angles)
