"""Level of the muscle: path, tendon, the pennate triangle, torque."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from limb_nodes.levels.muscle import aponeurosis as penn
from limb_nodes.levels.muscle import path, tendon, whole

angles = st.floats(-3.0, 3.0)
roles = st.sampled_from([1.0, -1.0])
arms = st.tuples(st.floats(0.005, 0.06), st.floats(0.07, 0.5), st.floats(0.07, 0.3))


def slope(function, at: float, step: float) -> float:
    """Central difference of fourth order."""
    near = function(at + step) - function(at - step)
    far = function(at + 2 * step) - function(at - 2 * step)
    return (8 * near - far) / (12 * step)


def path_by_points(angle: float, role: float, r: float, proximal: float, distal: float) -> float:
    """The length over a pulley point at distance r from the joint, from coordinates.

    The bisector of the two bones at the flexed side stands at 90 degrees minus half of the angle
    from each of them.
    """
    pulley = r * np.array([np.cos(np.pi / 2 - role * angle / 2), np.sin(np.pi / 2 - role * angle / 2)])
    # Each bone lies along the x axis of its own frame, in which the pulley has the same place.
    return sum(float(np.hypot(*(pulley - [bone, 0.0]))) for bone in (proximal, distal))


@given(angles, roles, arms)
def test_path_is_the_way_over_the_pulley(angle, role, arm):
    assert path.muscle_tendon_length(angle, role, *arm) == pytest.approx(path_by_points(angle, role, *arm), rel=1e-12)


def test_path_at_zero_angle():
    """Two right-angled triangles: sqrt(0.0215^2 + 0.1^2) + sqrt(0.0215^2 + 0.03^2)."""
    for role in (1.0, -1.0):
        assert path.muscle_tendon_length(0.0, role, 0.0215, 0.1, 0.03) == pytest.approx(0.1391938, abs=1e-7)


@given(angles, st.floats(-10, 10), roles, arms)
def test_path_velocity_is_minus_the_rate_of_length(angle, velocity, role, arm):
    given_slope = path.path_slope(angle, role, *arm)
    rate = slope(lambda a: path.muscle_tendon_length(a, role, *arm), angle, 1e-3)
    assert given_slope == pytest.approx(-rate, abs=1e-9)
    assert path.muscle_tendon_velocity(given_slope, velocity) == pytest.approx(-rate * velocity, abs=1e-8)
    # Flexors shorten when the angle grows, extensors lengthen.
    assert math.copysign(1.0, given_slope) == role


def test_tendon():
    # 1e5 N/m stretched by 2 mm hold 200 N; 1e4 N s/m.
    assert tendon.voigt_velocity(-200.0, 0.032, 1e5, 1e4, 0.03) == pytest.approx(0.0, abs=1e-12)
    assert tendon.voigt_velocity(-300.0, 0.032, 1e5, 1e4, 0.03) == pytest.approx(0.01)
    assert tendon.voigt_velocity(0.0, 0.032, 1e5, 1e4, 0.03) == pytest.approx(-0.02)
    # Slack: nothing but the force moves it, so that it can be stretched again.
    assert tendon.voigt_velocity(0.0, 0.02, 1e5, 1e4, 0.03) == 0.0
    assert tendon.voigt_velocity(-100.0, 0.02, 1e5, 1e4, 0.03) == pytest.approx(0.01)
    assert tendon.rigid_length(0.03) == 0.03
    assert tendon.rigid_velocity() == 0.0


def test_aponeurosis_spring():
    # 4e7 N/m^2 stretched by 1 mm hold 40 N; 1e4 N s/m.
    assert penn.aponeurosis_velocity(-40.0, 0.021, 4e7, 1e4, 0.02) == pytest.approx(0.0, abs=1e-12)
    assert penn.aponeurosis_velocity(-90.0, 0.021, 4e7, 1e4, 0.02) == pytest.approx(0.005)
    assert penn.aponeurosis_velocity(-90.0, 0.019, 4e7, 1e4, 0.02) == pytest.approx(0.009)
    assert penn.aponeurosis_force(100.0, math.pi / 3) == pytest.approx(-50.0)


def test_muscle_between_tendon_and_joint():
    assert whole.muscle_length(0.139, 0.03) == pytest.approx(0.109)
    assert whole.muscle_velocity(0.1, 0.02) == pytest.approx(0.12)
    assert whole.tendon_force(50.0) == -50.0
    assert whole.muscle_torque(-50.0, 0.02, 1.0) == pytest.approx(1.0)
    assert whole.muscle_torque(-50.0, 0.02, -1.0) == pytest.approx(-1.0)


class Triangle:
    """The pennate triangle from coordinates: the aponeurosis from the origin along x, its far end
    joined by the fibres to the end of the line of pull.
    """

    def __init__(self, aponeurosis: float, fibre: float, pennation: float) -> None:
        self.aponeurosis = aponeurosis
        self.end = np.array([aponeurosis + fibre * math.cos(pennation), fibre * math.sin(pennation)])
        self.muscle = float(np.hypot(*self.end))
        self.area = aponeurosis * self.end[1]
        self.beta = math.atan2(self.end[1], self.end[0])


triangles = st.tuples(st.floats(0.01, 0.3), st.floats(0.02, 0.2), st.floats(0.02, 2.6)).map(lambda t: (Triangle(*t), t))


def well_shaped(made) -> None:
    """Beyond a right angle between aponeurosis and line of pull, the same lengths fit a second triangle; near it they
    tell little of the angles.
    """
    triangle, _ = made
    assume(triangle.beta < 1.3)


@given(triangles)
def test_pennation_angle_and_fibre_length_of_the_triangle(made):
    triangle, (aponeurosis, fibre, pennation) = made
    well_shaped(made)
    theta = penn.pennation_angle(triangle.muscle, aponeurosis, triangle.area)
    assert theta == pytest.approx(pennation, rel=1e-6)
    length = penn.fibre_length(triangle.muscle, aponeurosis, triangle.area)
    assert length == pytest.approx(fibre, rel=1e-6)
    assert penn.aponeurosis_angle(length, triangle.muscle, theta) == pytest.approx(triangle.beta, rel=1e-6)
    assert penn.fibre_angle(theta, triangle.beta) == pytest.approx(pennation - triangle.beta, abs=1e-6)


@given(triangles)
def test_the_area_is_constant(made):
    """A = l_A l_F sin theta (2.52), also where the angle is obtuse."""
    triangle, (aponeurosis, _, _) = made
    well_shaped(made)
    for stretched in (0.97, 1.0, 1.02, 1.1):
        muscle = stretched * triangle.muscle
        theta = penn.pennation_angle(muscle, aponeurosis, triangle.area)
        length = penn.fibre_length(muscle, aponeurosis, triangle.area)
        assert aponeurosis * length * math.sin(theta) == pytest.approx(triangle.area, rel=1e-9)


def test_obtuse_triangle():
    """An angle of 115 degrees, which the sine alone would take for 65."""
    triangle = Triangle(0.03, 0.05, 2.0)
    theta = penn.pennation_angle(triangle.muscle, 0.03, triangle.area)
    assert theta == pytest.approx(2.0)
    assert penn.fibre_length(triangle.muscle, 0.03, triangle.area) == pytest.approx(0.05)


def test_a_muscle_that_is_shorter_than_its_aponeurosis():
    """The lengths and the angle of 130 degrees fit fibres of 0.0245 and 0.0526 m; only the former span the area."""
    triangle = Triangle(0.06, 0.0245, math.radians(130.0))
    assert triangle.muscle < 0.06
    theta = penn.pennation_angle(triangle.muscle, 0.06, triangle.area)
    assert theta == pytest.approx(math.radians(130.0))
    assert penn.fibre_length(triangle.muscle, 0.06, triangle.area) == pytest.approx(0.0245)


def test_no_triangle():
    with pytest.raises(ValueError):
        penn.pennation_angle(0.1, 0.1, 0.011)
    with pytest.raises(ValueError):
        penn.fibre_length(0.1, 0.1, 0.011)


def velocities(made, muscle_velocity: float, aponeurosis_velocity: float) -> tuple[float, Triangle, float]:
    triangle, (aponeurosis, _, _) = made
    theta = penn.pennation_angle(triangle.muscle, aponeurosis, triangle.area)
    length = penn.fibre_length(triangle.muscle, aponeurosis, triangle.area)
    beta = penn.aponeurosis_angle(length, triangle.muscle, theta)
    fibre_angle = penn.fibre_angle(theta, beta)
    return penn.fibre_velocity(muscle_velocity, aponeurosis_velocity, theta, beta, fibre_angle), triangle, theta


@given(triangles, st.floats(-1, 1), st.floats(-1, 1))
def test_fibre_velocity_is_minus_the_rate_of_length(made, muscle_velocity, aponeurosis_velocity):
    well_shaped(made)
    velocity, triangle, _ = velocities(made, muscle_velocity, aponeurosis_velocity)

    def fibre(time: float) -> float:
        muscle = triangle.muscle - muscle_velocity * time
        aponeurosis = triangle.aponeurosis + aponeurosis_velocity * time
        angle = math.asin(triangle.area / (muscle * aponeurosis))
        end = muscle * np.array([math.cos(angle), math.sin(angle)])
        return float(np.hypot(*(end - [aponeurosis, 0.0])))

    assert velocity == pytest.approx(-slope(fibre, 0.0, 5e-6), abs=2e-6)


@given(triangles, st.floats(-1, 1), st.floats(0.1, 1e3))
def test_virtual_work(made, muscle_velocity, force):
    """F_M v_M = F_F v_F while the aponeurosis keeps its length."""
    well_shaped(made)
    assume(made[1][2] < 1.5)
    velocity, triangle, theta = velocities(made, muscle_velocity, 0.0)
    pull = penn.muscle_force(force, theta, triangle.beta)
    assert pull * muscle_velocity == pytest.approx(force * velocity, rel=1e-6, abs=1e-9)


def test_a_muscle_cannot_push():
    assert penn.muscle_force(-5.0, 0.3, 0.1) == 0.0
    assert penn.parallel_muscle_force(-5.0) == 0.0
    assert penn.parallel_muscle_force(5.0) == 5.0
    # A force that is not a number is not taken for none.
    assert math.isnan(penn.muscle_force(math.nan, 0.3, 0.1))
    assert math.isnan(penn.parallel_muscle_force(math.nan))


def test_without_pennation_fibres_are_the_muscle():
    assert penn.parallel_pennation_angle() == 0.0
    assert penn.parallel_fibre_length(0.1) == 0.1
    assert penn.parallel_fibre_velocity(0.3) == 0.3
