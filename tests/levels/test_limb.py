"""Level of the limb: the equations of motion against energies that are written down from positions."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from limb_nodes.levels.limb import chain
from tests.independent.chain import points

GRAVITY = np.array([1.5, -9.81])
TIP_FORCE = np.array([20.0, -35.0])


class Chain:
    """A chain in segment angles. Arrays [n]: mass, length, distance of the centre of mass, inertia."""

    def __init__(self, n: int, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.n = n
        self.mass, self.length, self.inertia = (
            rng.uniform(0.2, 5, n),
            rng.uniform(0.1, 0.6, n),
            rng.uniform(1e-3, 0.1, n),
        )
        self.com = self.length * rng.uniform(0.1, 1.0, n)
        self.angle, self.velocity = rng.uniform(-4, 4, n), rng.uniform(-6, 6, n)

    def points(self, angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Centres of mass [n, 2] and the tip [2] at segment angles [n]."""
        return points(self.length, self.com, np.column_stack([np.cos(angle), np.sin(angle)]))

    def jacobians(self) -> tuple[np.ndarray, np.ndarray]:
        """Slopes of the points in the segment angles by complex step: [n, 2, n] and [2, n]."""
        turned = [self.points(self.angle + 1e-30j * np.eye(self.n)[k]) for k in range(self.n)]
        return (
            np.stack([centres.imag / 1e-30 for centres, _ in turned], axis=-1),
            np.stack([tip.imag / 1e-30 for _, tip in turned], axis=-1),
        )

    def distal(self) -> np.ndarray:
        return np.array([self.mass[k + 1 :].sum() for k in range(self.n)])

    def matrix(self) -> np.ndarray:
        """A of 3.10, from the level's equations."""
        distal, a = self.distal(), np.empty((self.n, self.n))
        for k in range(self.n):
            for p in range(self.n):
                i, j = min(k, p), max(k, p)
                first = chain.first_moment(self.mass[j], self.com[j], self.length[j], distal[j])
                a[k, p] = chain.inertia_coupling(self.length[i] * first, math.cos(self.angle[k] - self.angle[p]))
            a[k, k] = chain.own_inertia(self.inertia[k], self.mass[k], self.com[k], self.length[k], distal[k])
        return a


chains = st.builds(Chain, st.integers(1, 6), st.integers(0, 10**6))


@given(chains)
def test_inertia_is_that_of_the_kinetic_energy(made):
    """Twice the kinetic energy: sum of m v^2 + theta omega^2."""
    centres, _ = made.jacobians()
    expected = np.einsum("k,kxi,kxj->ij", made.mass, centres, centres) + np.diag(made.inertia)
    np.testing.assert_allclose(made.matrix(), expected, rtol=1e-9, atol=1e-12)


@given(chains)
def test_inertia_is_symmetric_and_positive_definite(made):
    a = made.matrix()
    assert np.array_equal(a, a.T)
    assert np.linalg.eigvalsh(a).min() > 0


@given(chains)
def test_gravity_and_tip_force_are_the_slopes_of_their_work(made):
    centres, tip = made.jacobians()
    weight = np.einsum("k,kxi,x->i", made.mass, centres, GRAVITY)
    load = TIP_FORCE @ tip
    distal = made.distal()
    for k in range(made.n):
        cosine, sine = math.cos(made.angle[k]), math.sin(made.angle[k])
        first = chain.first_moment(made.mass[k], made.com[k], made.length[k], distal[k])
        assert chain.gravity_torque(first, cosine, sine, *GRAVITY) == pytest.approx(weight[k], abs=1e-9)
        assert chain.tip_force_torque(made.length[k], cosine, sine, *TIP_FORCE) == pytest.approx(load[k], abs=1e-9)


@given(chains)
def test_centrifugal_torque_is_minus_the_curved_path_of_the_centres(made):
    """- J^T m (dJ/dt) omega: the centres' acceleration when no segment turns faster."""
    centres, _ = made.jacobians()
    inwards, _ = points(
        made.length, made.com, -np.column_stack([np.cos(made.angle), np.sin(made.angle)]) * made.velocity[:, None] ** 2
    )
    expected = -np.einsum("k,kxi,kx->i", made.mass, centres, inwards)
    distal = made.distal()
    for k in range(made.n):
        found = 0.0
        for p in range(made.n):
            i, j = min(k, p), max(k, p)
            first = chain.first_moment(made.mass[j], made.com[j], made.length[j], distal[j])
            found += chain.centrifugal_torque(
                made.length[i] * first, math.sin(made.angle[k] - made.angle[p]), made.velocity[p]
            )
        assert found == pytest.approx(expected[k], rel=1e-9, abs=1e-8)


def test_points_along_a_segment():
    assert chain.point_x(1.0, 2.0, math.pi / 3) == pytest.approx(2.0)
    assert chain.point_y(1.0, 2.0, math.pi / 6) == pytest.approx(2.0)
