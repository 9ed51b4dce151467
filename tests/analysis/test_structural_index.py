"""Pantelides' algorithm, the Dulmage-Mendelsohn parts and the blocks on textbook systems."""

import itertools
import random

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

from limb_nodes.analysis.structure.blocks import strong_components
from limb_nodes.analysis.structure.matching import dulmage_mendelsohn
from limb_nodes.analysis.structure.pantelides import pantelides

# Each system: equations as variable -> highest derivative; index; how often each equation is differentiated.
SYSTEMS = {
    "oscillator, an ordinary differential equation": ([{"x": 1, "v": 0}, {"v": 1, "x": 0}], 0, (0, 0)),
    "Robertson kinetics, semi-explicit": (
        [{"a": 1, "b": 0, "c": 0}, {"b": 1, "a": 0, "c": 0}, {"a": 0, "b": 0, "c": 0}],
        1,
        (0, 0, 0),
    ),
    "algebraic equations": ([{"x": 0, "y": 0}, {"y": 0}], 1, (0, 0)),
    "differentiation of an input": ([{"x": 0}, {"y": 0, "x": 1}], 2, (1, 0)),
    # Chain of d integrators driven backwards: Brenan, Campbell and Petzold, section 2.2.
    "chain of three": ([{"x": 0}, {"x": 1, "y": 0}, {"y": 1, "z": 0}], 3, (2, 1, 0)),
    # x'' = -T x, y'' = -T y - g, x^2 + y^2 = L^2: Pantelides' own example, second order and first order.
    "pendulum of second order": ([{"x": 2, "T": 0}, {"y": 2, "T": 0}, {"x": 0, "y": 0}], 3, (0, 0, 2)),
    "pendulum of first order": (
        [{"x": 1, "u": 0}, {"y": 1, "v": 0}, {"u": 1, "T": 0, "x": 0}, {"v": 1, "T": 0, "y": 0}, {"x": 0, "y": 0}],
        3,
        (1, 1, 0, 0, 2),
    ),
    "pendulum with the velocity prescribed": (
        [{"x": 2, "T": 0}, {"y": 2, "T": 0}, {"x": 1, "y": 1}],
        2,
        (0, 0, 1),
    ),
    # Hessenberg form of index 2: x' = f(x, z), 0 = g(x).
    "Hessenberg index 2": ([{"x": 1, "z": 0}, {"x": 0}], 2, (0, 1)),
    # Trajectory of the space shuttle, Brenan (1983) in simplified form: control through three derivatives.
    "control through two integrators": ([{"h": 1, "v": 0}, {"v": 1, "u": 0}, {"h": 0}], 3, (1, 0, 2)),
    # Two rotating masses on one shaft: J1 w1' = T1 + F, J2 w2' = T2 - F, w1 = w2.
    "coupled masses": ([{"w1": 1, "F": 0}, {"w2": 1, "F": 0}, {"w1": 0, "w2": 0}], 2, (0, 0, 1)),
}


@pytest.mark.parametrize("name", SYSTEMS)
def test_textbook_systems(name):
    equations, index, times = SYSTEMS[name]
    found = pantelides(equations)
    assert found.index == index
    assert found.times == times
    for node, equation in found.solved.items():
        assert equations[equation][node] + found.times[equation] == found.highest[node]


def test_the_pendulum_has_two_free_initial_values_and_names_its_constraint():
    found = pantelides(SYSTEMS["pendulum of second order"][0])
    assert found.free_initial_values == 2
    assert found.constraints[0] == (((2, 0),), ())


@pytest.mark.parametrize("name", SYSTEMS)
def test_the_order_of_the_equations_does_not_matter(name):
    equations, index, times = SYSTEMS[name]
    for order in itertools.permutations(range(len(equations))):
        found = pantelides([equations[i] for i in order])
        assert found.index == index
        assert found.times == tuple(times[i] for i in order)


def offsets_by_assignment(equations):
    """Pryce's canonical offsets, by an assignment of greatest value and a fixed point."""
    nodes = sorted({node for equation in equations for node in equation})
    sigma = np.full((len(equations), len(nodes)), -np.inf)
    for i, equation in enumerate(equations):
        for node, order in equation.items():
            sigma[i, nodes.index(node)] = order
    rows, columns = linear_sum_assignment(np.where(np.isinf(sigma), -1e6, sigma), maximize=True)
    if np.isinf(sigma[rows, columns]).any():
        return None
    times = np.zeros(len(equations))
    while True:
        highest = (sigma + times[:, None]).max(axis=0)
        new = highest[columns] - sigma[rows, columns]
        if (new == times).all():
            return tuple(int(n) for n in times), dict(zip(nodes, (int(d) for d in highest), strict=True))
        times = new


def test_random_systems_have_the_offsets_of_the_assignment_problem():
    random.seed(7)
    solvable = 0
    for _ in range(400):
        size = random.randint(1, 9)
        equations = [
            {node: random.choice((0, 0, 1, 2)) for node in random.sample(range(size), random.randint(1, min(3, size)))}
            for _ in range(size)
        ]
        nodes = sorted({node for equation in equations for node in equation})
        singular = dulmage_mendelsohn([list(equation) for equation in equations], range(size)).singular
        expected = offsets_by_assignment(equations) if len(nodes) == size else None
        assert singular == (expected is None)
        if expected is not None:
            solvable += 1
            found = pantelides(equations)
            assert (found.times, dict(found.highest)) == expected
    assert solvable > 100


def test_equations_that_outnumber_their_unknowns_are_refused():
    with pytest.raises(ValueError, match="2 equations for 1 unknowns"):
        pantelides([{"x": 0}, {"x": 1}])
    with pytest.raises(ValueError, match="singular"):
        pantelides([{"x": 0}, {"x": 0}, {"x": 0, "y": 0, "z": 0}])


def test_over_and_under_determined_parts():
    # x is fixed twice; y alone is determined; u and v share one equation.
    equations = [["x"], ["x"], ["y", "x"], ["u", "v", "y"]]
    parts = dulmage_mendelsohn(equations, ["x", "y", "u", "v"])
    assert parts.over == ((0, 1), ("x",))
    assert parts.under == ((3,), ("u", "v"))
    assert parts.singular


def test_a_determined_system_has_no_parts_to_blame():
    parts = dulmage_mendelsohn([["x", "y"], ["y"]], ["x", "y"])
    assert not parts.singular
    assert dulmage_mendelsohn([], []).singular is False
    assert dulmage_mendelsohn([], ["x"]).under == ((), ("x",))


def test_strong_components_come_behind_what_they_need():
    # 0 -> 1 -> 2 -> 0 is a cycle that needs 3; 4 needs the cycle.
    edges = [[1], [2], [0, 3], [], [0]]
    components = strong_components(edges)
    assert [sorted(component) for component in components] == [[3], [0, 1, 2], [4]]
    assert strong_components([[0]]) == [[0]]


def test_a_long_chain_is_no_problem():
    size = 20_000
    edges = [[i + 1] for i in range(size - 1)] + [[]]
    assert strong_components(edges) == [[i] for i in reversed(range(size))]
    equations = [{i: 0, i + 1: 0} for i in range(size - 1)] + [{size - 1: 0}]
    assert pantelides(equations).index == 1
