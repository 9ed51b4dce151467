"""Level of the motor unit: fibre quantities, characteristics, recruitment, force."""

import math
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from limb_nodes.levels.motor_unit import fibre
from limb_nodes.levels.motor_unit.force_frequency import sigmoid
from limb_nodes.levels.motor_unit.force_length import cheng
from limb_nodes.levels.motor_unit.passive_force import quadratic
from limb_nodes.levels.motor_unit.recruitment import linear, unit_thresholds

SLOW, FAST = (1.12, 2.3, 1.61), (0.75, 1.55, 2.21)


def test_one_fibre_is_many_sarcomeres():
    assert fibre.sarcomere_length(0.1134, 42000.0) == pytest.approx(2.7e-6)
    assert fibre.sarcomere_velocity(0.042, 42000.0) == pytest.approx(1e-6)
    assert fibre.sarcomere_frequency(12.0) == 12.0
    # 27 mm per 1e4 sarcomeres.
    assert fibre.optimal_fibre_length(1e4, 2.7e-6) == pytest.approx(0.027)
    assert fibre.maximum_fibre_length(1e4, 4.3e-6) == pytest.approx(0.043)
    assert fibre.minimum_fibre_length(1e4, 1.44e-6) == pytest.approx(0.0144)
    assert fibre.maximum_fibre_force(1e14, 9.7778e-13) == pytest.approx(97.778)


@pytest.mark.parametrize(
    ("length", "norm"),
    [(0.5, 0.0), (1.0, 0.0), (1.25, 0.5), (1.5, 1.0), (2.5, 1.5), (3.5, 2.0), (4.5, 2.5)],
)
def test_normalised_length(length, norm):
    assert fibre.fibre_length_norm(length, 1.0, 1.5, 3.5) == pytest.approx(norm)


def test_normalised_frequency():
    assert fibre.frequency_norm(5.0, 5.0, 15.0) == 0.0
    assert fibre.frequency_norm(15.0, 5.0, 15.0) == 1.0
    assert fibre.frequency_norm(0.0, 5.0, 15.0) == 0.0


@given(st.floats(0.05, 10.0), st.floats(0.1, 10.0), st.floats(1.0, 10.0), st.floats(0.0, 2.0))
def test_force_length_has_its_top_at_the_optimum(omega, beta, rho, length):
    assert cheng(1.0, omega, beta, rho) == 1.0
    assert 0.0 <= cheng(length, omega, beta, rho) <= 1.0


@pytest.mark.parametrize("kind", [SLOW, FAST])
def test_force_length_at_the_shortest_length(kind):
    omega, _, rho = kind
    assert cheng(0.0, *kind) == pytest.approx(math.exp(-(omega**-rho)))


@pytest.mark.parametrize(("kind", "expected"), [(SLOW, 0.560927), (FAST, 0.472328)])
def test_force_length_half_way_to_the_shortest(kind, expected):
    """At 0.5: slow exp(-(0.796937/1.12)^1.61), fast exp(-(0.658490/0.75)^2.21), by hand."""
    assert cheng(0.5, *kind) == pytest.approx(expected, abs=1e-5)


@given(st.floats(-2.0, 3.0), st.floats(0.01, 100.0))
def test_force_frequency_runs_from_0_to_1(threshold, width):
    try:
        assert sigmoid(0.0, threshold, width) == 0.0
        assert sigmoid(1.0, threshold, width) == 1.0
    except ZeroDivisionError:
        # The whole sigmoid lies outside [0, 1] and is flat there to the last digit.
        assert min(abs(threshold), abs(1 - threshold)) / width > 30


@given(st.floats(0.0, 1.0), st.floats(0.01, 1.0), st.floats(0.0, 0.99), st.floats(0.05, 10.0))
def test_force_frequency_rises(frequency, more, threshold, width):
    assert sigmoid(frequency, threshold, width) <= sigmoid(frequency + more, threshold, width)


def test_force_frequency_is_half_at_a_centred_threshold():
    assert sigmoid(0.5, 0.5, 0.15) == pytest.approx(0.5)
    # 1/(1+e^-2) = 0.880797, 1/(1+e^(10/3)) = 0.034445.
    assert sigmoid(0.8, 0.5, 0.15) == pytest.approx((0.880797 - 0.034445) / (1 - 2 * 0.034445), abs=2e-6)


@given(st.floats(0.0, 1.99), st.floats(0.0, 2.0))
def test_passive_force(slack, length):
    assert quadratic(2.0, slack) == 1.0
    assert quadratic(slack, slack) == 0.0
    if length <= slack:
        assert quadratic(length, slack) == 0.0
    else:
        assert quadratic(length, slack) == pytest.approx(((length - slack) / (2 - slack)) ** 2)


def test_force_of_a_unit_is_active_plus_passive():
    assert fibre.fibre_force(2e-12, 1e12, 0.5, 0.25, 0.3, 10.0) == pytest.approx(2 * 0.125 + 3.0)


def test_thresholds_follow_the_areas():
    assert unit_thresholds([1e-4, 3e-4, 4e-4], 0.8) == pytest.approx([0.1, 0.4, 0.8])


@given(st.lists(st.floats(1e-8, 1e-2), min_size=1, max_size=50), st.floats(0.0, 0.99))
def test_the_last_unit_joins_at_the_muscles_threshold(areas, threshold):
    found = unit_thresholds(areas, threshold)
    assert found[-1] == pytest.approx(threshold)
    assert all(a <= b for a, b in pairwise(found))


@given(st.floats(0.0, 0.99), st.floats(0.0, 1.0))
def test_a_unit_fires_from_its_threshold_on(threshold, activation):
    frequency = linear(activation, threshold, 5.0, 15.0)
    if activation < threshold or activation == 0.0:
        assert frequency == 0.0
    else:
        assert 5.0 <= frequency <= 15.0 + 1e-9
        assert frequency == pytest.approx(5 + 10 * (activation - threshold) / (1 - threshold))


@pytest.mark.parametrize(("activation", "frequency"), [(0.79999, 0.0), (0.8, 5.0), (0.9, 10.0), (1.0, 15.0)])
def test_frequencies_of_the_reference_unit(activation, frequency):
    assert linear(activation, 0.8, 5.0, 15.0) == pytest.approx(frequency)
