"""The constants of a limb's chain of segments, as one flat block of numbers."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.levels.limb.chain import first_moment, own_inertia
from limb_nodes.model.limb import Limb


class Chain(NamedTuple):
    """Constants of a chain of n segments, views of one flat block.

    base_angle: rad. gravity_x, gravity_y: m/s^2.
    couplings: [n, n], kg m^2, moments of inertia (3.8, 3.9) and, off the diagonal, the factors of 3.3 to 3.5.
    moments: [n], kg m, first moment of mass about the proximal joint. lengths: [n], m.
    lowest, highest: [n], rad, the joints' ranges; infinite if there is none.
    """

    base_angle: float
    gravity_x: float
    gravity_y: float
    couplings: FloatArray
    moments: FloatArray
    lengths: FloatArray
    lowest: FloatArray
    highest: FloatArray


def chain_of(block: FloatArray, n: int) -> Chain:
    """The parts of a chain's block; compiled code calls it too."""
    at = 3 + n * n
    return Chain(
        block[0],
        block[1],
        block[2],
        block[3:at].reshape((n, n)),
        block[at : at + n],
        block[at + n : at + 2 * n],
        block[at + 2 * n : at + 3 * n],
        block[at + 3 * n : at + 4 * n],
    )


def chain_block(limb: Limb) -> FloatArray:
    """The constants of a limb's `Chain`, one behind the other."""
    segments = limb.segments
    count = len(segments)
    distal = [sum(segment.mass for segment in segments[k + 1 :]) for k in range(count)]
    moments = [first_moment(s.mass, s.com_distance, s.length, mass) for s, mass in zip(segments, distal, strict=True)]
    couplings = [
        own_inertia(
            segments[k].inertia,
            segments[k].mass,
            segments[k].com_distance,
            segments[k].length,
            distal[k],
        )
        if k == p
        else segments[min(k, p)].length * moments[max(k, p)]
        for k in range(count)
        for p in range(count)
    ]
    ranges = np.array([segment.joint_range or (-np.inf, np.inf) for segment in segments]).reshape(count, 2)
    lengths = [segment.length for segment in segments]
    return np.concatenate([[limb.base_angle, *limb.gravity], couplings, moments, lengths, ranges[:, 0], ranges[:, 1]])
