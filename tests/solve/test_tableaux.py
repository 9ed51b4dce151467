"""The tableaux of the integrators against the order conditions of their theory.

Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, II.2: a sum over the stages for each rooted
tree. Hairer and Wanner, II, IV.7: the same for Rosenbrock methods, whose coefficients are given for transformed
increments.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from limb_nodes.solve import explicit, implicit
from limb_nodes.solve.explicit import DORMAND_PRINCE
from limb_nodes.solve.implicit import RODAS

# A rooted tree is the tuple of the trees that hang from its root.
Tree = tuple


def trees(order: int) -> set[Tree]:
    """All rooted trees with so many nodes."""
    if order == 1:
        return {()}
    return {tuple(sorted(forest)) for forest in forests(order - 1, order - 1)}


def forests(nodes: int, largest: int) -> list[Tree]:
    """All ways to share nodes among trees of at most so many nodes each."""
    if nodes == 0:
        return [()]
    found = []
    for size in range(1, min(nodes, largest) + 1):
        for tree in trees(size):
            found += [(tree, *rest) for rest in forests(nodes - size, size)]
    return found


def size(tree: Tree) -> int:
    return 1 + sum(size(branch) for branch in tree)


def density(tree: Tree) -> int:
    """The product of the sizes of all subtrees."""
    return size(tree) * math.prod(density(branch) for branch in tree)


def grown(tree: Tree, single: np.ndarray, several: np.ndarray) -> np.ndarray:
    """The stages' sums of a tree [s]: `single` [s, s] leads to an only branch, `several` to one of several."""
    matrix = single if len(tree) == 1 else several
    value = np.ones(len(single))
    for branch in tree:
        value = value * (matrix @ grown(branch, single, several))
    return value


def defect(weights: np.ndarray, order: int, single: np.ndarray, several: np.ndarray) -> float:
    """The largest defect of the conditions of one order."""
    return max(abs(weights @ grown(tree, single, several) - 1.0 / density(tree)) for tree in trees(order))


def test_the_number_of_trees():
    assert [len(trees(order)) for order in range(1, 6)] == [1, 1, 2, 4, 9]
    assert density(((), ())) == 3
    assert density((((),),)) == 6


class TestDormandPrince:
    nodes, error, bend = (DORMAND_PRINCE[row] for row in (explicit.NODES, explicit.ERROR, explicit.BEND))
    stages = DORMAND_PRINCE[explicit.WEIGHTS :]

    @pytest.mark.parametrize("order", [1, 2, 3, 4, 5])
    def test_the_step_is_of_fifth_order(self, order):
        assert defect(self.stages[-1], order, self.stages, self.stages) < 1e-14

    def test_and_of_no_higher_one(self):
        assert defect(self.stages[-1], 6, self.stages, self.stages) > 1e-4

    @pytest.mark.parametrize("order", [1, 2, 3, 4])
    def test_the_error_is_that_of_a_step_of_fourth_order(self, order):
        assert defect(self.stages[-1] - self.error, order, self.stages, self.stages) < 1e-14

    def test_which_is_of_no_higher_one(self):
        assert defect(self.stages[-1] - self.error, 5, self.stages, self.stages) > 1e-4

    def test_each_stage_stands_at_its_node(self):
        np.testing.assert_allclose(self.stages.sum(axis=1), self.nodes, rtol=0, atol=1e-14)
        assert not np.triu(self.stages).any()

    @pytest.mark.parametrize("order", [1, 2, 3, 4])
    @pytest.mark.parametrize("part", [0.1, 0.5, 0.8])
    def test_between_its_ends_the_solution_is_of_fourth_order(self, part, order):
        """Weights of the continuous extension, from its formula with each stage alone."""
        step, count = self.stages[-1], len(self.nodes)
        first, last = np.eye(count)[0], np.eye(count)[-1]
        rest = 1.0 - part
        bend, twist = first - step, 2.0 * step - last - first
        weights = part * (step + rest * (bend + part * (twist + rest * self.bend)))
        worst = max(
            abs(weights @ grown(tree, self.stages, self.stages) - part**order / density(tree)) for tree in trees(order)
        )
        assert worst < 1e-14


class TestRodas:
    """alpha, gamma, b of IV.7 from the transformed coefficients: C = I / gamma - inverse of Gamma."""

    stages = RODAS[implicit.WEIGHTS :][:6]
    couplings = RODAS[implicit.WEIGHTS :][6:]
    diagonal = couplings[0, 0]
    gamma = np.linalg.inv(2.0 * np.diag(np.diag(couplings)) - couplings)
    alpha = stages @ gamma
    weights = (stages[-1] + np.eye(6)[-1]) @ gamma
    embedded = stages[-1] @ gamma

    def test_gamma(self):
        np.testing.assert_allclose(np.diag(self.gamma), 1.0 / self.diagonal, rtol=1e-14)
        np.testing.assert_allclose(np.diag(self.couplings), self.diagonal, rtol=0)

    @pytest.mark.parametrize("order", [1, 2, 3, 4])
    def test_the_step_is_of_fourth_order(self, order):
        """An only branch goes through alpha + gamma, several through alpha."""
        assert defect(self.weights, order, self.alpha + self.gamma, self.alpha) < 1e-11

    def test_and_of_no_higher_one(self):
        assert defect(self.weights, 5, self.alpha + self.gamma, self.alpha) > 1e-5

    @pytest.mark.parametrize("order", [1, 2, 3])
    def test_the_error_is_that_of_a_step_of_third_order(self, order):
        assert defect(self.embedded, order, self.alpha + self.gamma, self.alpha) < 1e-11

    def test_times_are_those_of_an_autonomous_system(self):
        np.testing.assert_allclose(self.alpha.sum(axis=1), RODAS[implicit.NODES], rtol=0, atol=1e-12)
        np.testing.assert_allclose(self.gamma.sum(axis=1), RODAS[implicit.TIMES], rtol=0, atol=1e-12)

    @pytest.mark.parametrize("method", ["weights", "embedded"])
    def test_it_forgets_what_decays_at_once(self, method):
        """The stability function 1 + z b (I - z beta)^-1 1 vanishes at minus infinity: both are stiffly accurate."""
        beta = self.alpha + self.gamma
        weights = getattr(self, method)
        if method == "embedded":
            beta, weights = beta[:-1, :-1], weights[:-1]
        z = -1e9
        value = 1.0 + z * weights @ np.linalg.solve(np.eye(len(beta)) - z * beta, np.ones(len(beta)))
        assert abs(value) < 1e-6

    @pytest.mark.parametrize("order", [1, 2, 3])
    @pytest.mark.parametrize("part", [0.2, 0.5, 0.9])
    def test_between_its_ends_the_solution_is_of_third_order(self, part, order):
        increments = self.stages[-1] + np.eye(6)[-1]
        rest = 1.0 - part
        weights = part * (increments + rest * (RODAS[implicit.BEND] + part * RODAS[implicit.TWIST])) @ self.gamma
        worst = max(
            abs(weights @ grown(tree, self.alpha + self.gamma, self.alpha) - part**order / density(tree))
            for tree in trees(order)
        )
        assert worst < 1e-11
