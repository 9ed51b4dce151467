"""Points of a chain of segments in the plane."""

from __future__ import annotations

import numpy as np


def points(length: np.ndarray, com_distance: np.ndarray, along: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Centres of mass [..., n, 2] and tip [..., 2], from the base, of segments along unit vectors [..., n, 2].

    With the vectors' derivatives in place of the vectors: the derivatives of the points.
    """
    ends = np.cumsum(length[:, np.newaxis] * along, axis=-2)
    return ends - (length - com_distance)[:, np.newaxis] * along, ends[..., -1, :]
