"""The constants of a limb's chain of segments, as arrays whose rows have names."""

from __future__ import annotations

import numpy as np

from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.levels.limb.chain import first_moment, own_inertia
from limb_nodes.model.limb import Limb

# What surrounds the chain: the direction of its base (rad) and gravity (m/s^2).
BASE_ANGLE, GRAVITY_X, GRAVITY_Y = 0, 1, 2
# Rows with a number for each of n segments: first moment of mass about the proximal joint (kg m), length (m), lowest
# and highest angle of the joint (rad, infinite if there is none); then n rows of couplings (kg m^2): moments of inertia
# (3.8, 3.9) and, off the diagonal, the factors of 3.3 to 3.5.
MOMENT, LENGTH, LOWEST, HIGHEST, COUPLING = 0, 1, 2, 3, 4


def world_of(limb: Limb) -> FloatArray:
    """What surrounds a limb's chain [3], in the order above."""
    return np.array([limb.base_angle, *limb.gravity])


def segments_of(limb: Limb) -> FloatArray:
    """The constants of a limb's segments [4 + n, n], rows as above."""
    segments = limb.segments
    count = len(segments)
    rows = np.empty((COUPLING + count, count))
    distal = [sum(segment.mass for segment in segments[k + 1 :]) for k in range(count)]
    rows[MOMENT] = [
        first_moment(s.mass, s.com_distance, s.length, mass) for s, mass in zip(segments, distal, strict=True)
    ]
    rows[LENGTH] = [segment.length for segment in segments]
    ranges = [segment.joint_range or (-np.inf, np.inf) for segment in segments]
    rows[LOWEST] = [lowest for lowest, _ in ranges]
    rows[HIGHEST] = [highest for _, highest in ranges]
    for k, s in enumerate(segments):
        for p in range(count):
            near, far = min(k, p), max(k, p)
            rows[COUPLING + k, p] = segments[near].length * rows[MOMENT, far]
        rows[COUPLING + k, k] = own_inertia(s.inertia, s.mass, s.com_distance, s.length, distal[k])
    return rows
