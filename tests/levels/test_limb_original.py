"""The original form of the limb (2.56-2.65), put to a solved movement of three segments with muscles and a load."""

import math
from pathlib import Path

import numpy as np
import pytest

from limb_nodes.levels.limb import chain, original, transformed
from limb_nodes.model import load_limb, with_values
from limb_nodes.solve.whole import WholeModel
from tests.independent.chain import points

LEG = Path(__file__).parents[2] / "params" / "pennate_leg.yaml"
RATE = 2000.0
TIP_FORCE, TIP_TORQUE = (30.0, 80.0), 1.5


@pytest.fixture(scope="module")
def solved():
    """Limb, movement and segment angles with their two derivatives [T, 3]."""
    limb = load_limb(LEG)
    free = {f"segments[{k}].range": None for k in range(3)}
    turning = {f"segments[{k}].velocity": v for k, v in enumerate((1.0, -2.0, 0.5))}
    limb = with_values(limb, {**free, **turning, "tip_force": list(TIP_FORCE), "tip_torque": TIP_TORQUE})
    movement = WholeModel(limb).simulate(np.full((201, len(limb.muscles)), 0.3), RATE, tolerance=1e-10)
    angles = limb.base_angle + np.cumsum(movement.angle, axis=1)
    return limb, movement, angles, np.cumsum(movement.velocity, axis=1), np.cumsum(movement.acceleration, axis=1)


def joint_torques(limb, movement):
    """2.61: torque of every joint [T, 3]."""
    torques = np.zeros_like(movement.angle)
    for j, muscle in enumerate(limb.muscles):
        torques[:, muscle.joints[0]] += movement.muscle["muscle_torque"][:, j]
    return torques


def positions(limb, angles):
    """2.65: centres of mass [T, 3, 2]."""
    found = np.empty((*angles.shape, 2))
    for t, row in enumerate(angles):
        x, y = limb.base_position
        for k, segment in enumerate(limb.segments):
            found[t, k] = chain.point_x(x, segment.com_distance, row[k]), chain.point_y(y, segment.com_distance, row[k])
            x, y = chain.point_x(x, segment.length, row[k]), chain.point_y(y, segment.length, row[k])
    return found


def com_accelerations(limb, angles, velocities, accelerations):
    """2.65 differentiated twice, in closed form [T, 3, 2]."""
    sine, cosine = np.sin(angles), np.cos(angles)
    x = -sine * accelerations - cosine * velocities**2
    y = cosine * accelerations - sine * velocities**2
    length, com = (np.array([getattr(segment, key) for segment in limb.segments]) for key in ("length", "com_distance"))
    return points(length, com, np.stack([x, y], axis=-1))[0]


def joint_forces(limb, accelerations):
    """2.63 and 2.64, from the tip inwards [3, 2], at one instant."""
    forces = np.empty((3, 2))
    for k in reversed(range(3)):
        (ax, ay), mass, (gx, gy) = accelerations[k], limb.segments[k].mass, limb.gravity
        if k == 2:
            forces[k] = (
                original.last_joint_force_x(TIP_FORCE[0], mass, ax, gx),
                original.last_joint_force_y(TIP_FORCE[1], mass, ay, gy),
            )
        else:
            forces[k] = (
                original.joint_force_x(forces[k + 1, 0], mass, ax, gx),
                original.joint_force_y(forces[k + 1, 1], mass, ay, gy),
            )
    return forces


def test_the_movement_satisfies_the_balances_of_free_bodies(solved):
    limb, movement, angles, velocities, accelerations = solved
    torques = joint_torques(limb, movement)
    assert np.abs(torques).max() > 10.0, "the muscles must matter"
    pushes = com_accelerations(limb, angles, velocities, accelerations)
    scale = np.abs(accelerations).max()
    for t in range(0, len(angles), 10):
        forces = joint_forces(limb, pushes[t])
        for k, segment in enumerate(limb.segments):
            proximal = original.proximal_moment(angles[t, k], *forces[k], segment.com_distance)
            end = TIP_FORCE if k == 2 else forces[k + 1]
            distal = original.distal_moment(angles[t, k], *end, segment.com_distance, segment.length)
            moments = (proximal, distal, segment.inertia)
            if k == 2:
                rate = original.last_segment_velocity_rate(torques[t, k], TIP_TORQUE, *moments)
            else:
                rate = original.segment_velocity_rate(torques[t, k], torques[t, k + 1], *moments)
            assert rate == pytest.approx(accelerations[t, k], abs=1e-9 * scale)


def test_forces_in_the_first_joint_carry_the_whole_limb(solved):
    limb, _, angles, velocities, accelerations = solved
    pushes = com_accelerations(limb, angles, velocities, accelerations)
    masses = np.array([segment.mass for segment in limb.segments])
    momentum = (masses[:, None] * pushes[0]).sum(axis=0)
    expected = momentum - masses.sum() * np.array(limb.gravity) - np.array(TIP_FORCE)
    np.testing.assert_allclose(joint_forces(limb, pushes[0])[0], expected, rtol=1e-12)


def test_angles_positions_and_their_derivatives_agree_over_time(solved):
    limb, movement, angles, velocities, accelerations = solved
    # The light foot jumps off at the start, too fast for differences of samples.
    settled = slice(60, None)
    angles, velocities, accelerations = angles[settled], velocities[settled], accelerations[settled]

    def slope(values):
        """Derivative by time, of fourth order, without the two instants at each end."""
        return (values[:-4] - 8 * values[1:-3] + 8 * values[3:-1] - values[4:]) * RATE / 12

    inner = slice(2, -2)
    np.testing.assert_allclose(slope(angles), velocities[inner], atol=1e-6)
    assert original.segment_angle_rate(velocities[5, 1]) == transformed.segment_angle_rate(velocities[5, 1])
    positioned = positions(limb, angles)
    speeds = slope(positioned)
    pushes = slope(speeds)
    exact = com_accelerations(limb, angles, velocities, accelerations)[4:-4]
    np.testing.assert_allclose(pushes, exact, atol=2e-3 * np.abs(exact).max())
    assert original.com_velocity_x(speeds[0, 0, 0]) == speeds[0, 0, 0]
    assert original.com_acceleration_y(pushes[0, 0, 1]) == pushes[0, 0, 1]
    for k, previous in ((0, limb.base_angle), (2, angles[7, 1])):
        assert original.joint_angle(angles[7, k], previous) == pytest.approx(movement.angle[67, k], abs=1e-14)
    assert original.joint_velocity(velocities[7, 2], velocities[7, 1]) == pytest.approx(movement.velocity[67, 2])


def test_the_movement_satisfies_the_transformed_equations(solved):
    limb, movement, angles, velocities, accelerations = solved
    torques = joint_torques(limb, movement)
    segments = limb.segments
    distal = [sum(segment.mass for segment in segments[k + 1 :]) for k in range(3)]
    moments = [
        chain.first_moment(s.mass, s.com_distance, s.length, beyond) for s, beyond in zip(segments, distal, strict=True)
    ]
    for t in range(0, len(angles), 10):
        for k, segment in enumerate(segments):
            cosine, sine = math.cos(angles[t, k]), math.sin(angles[t, k])
            if k == 2:
                net = transformed.last_net_torque(torques[t, k], TIP_TORQUE)
            else:
                net = transformed.net_torque(torques[t, k], torques[t, k + 1])
            centrifugal, inertial = 0.0, 0.0
            for p in range(3):
                if p == k:
                    element = chain.own_inertia(
                        segment.inertia, segment.mass, segment.com_distance, segment.length, distal[k]
                    )
                else:
                    coupling = segments[min(k, p)].length * moments[max(k, p)]
                    between = angles[t, k] - angles[t, p]
                    element = chain.inertia_coupling(coupling, math.cos(between))
                    centrifugal += chain.centrifugal_torque(coupling, math.sin(between), velocities[t, p])
                inertial += transformed.inertial_torque(element, accelerations[t, p])
            residual = transformed.torque_residual(
                net,
                centrifugal,
                chain.tip_force_torque(segment.length, cosine, sine, *TIP_FORCE),
                chain.gravity_torque(moments[k], cosine, sine, *limb.gravity),
                inertial,
            )
            assert abs(residual) < 1e-9 * max(1.0, abs(inertial))
