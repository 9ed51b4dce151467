"""The compiled chain against MuJoCo, its energy, and impacts on joint limits."""

from itertools import combinations

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from limb_nodes.model import parse_limb
from limb_nodes.model.chain import segments_of, world_of
from limb_nodes.solve import chain
from limb_nodes.solve.whole import WholeModel
from tests.independent.chain import points

GRAVITY = (1.5, -9.81)
TIP = (7.0, -12.0, 0.4)
BASE_ANGLE = -1.2


def yaml_of(n: int, seed: int = 0, limited: tuple[int, ...] = (), tip=(0.0, 0.0, 0.0)) -> str:
    """A chain; `limited` joints have a range around their first angle."""
    rng = np.random.default_rng(seed)
    lines = [
        f"name: chain{n}",
        f"gravity: [{GRAVITY[0]}, {GRAVITY[1]}]",
        f"base_angle: {BASE_ANGLE}",
        f"tip_force: [{tip[0]}, {tip[1]}]",
        f"tip_torque: {tip[2]}",
        "segments:",
    ]
    for k in range(n):
        length = rng.uniform(0.15, 0.5)
        numbers = {
            "mass": rng.uniform(0.3, 4.0),
            "length": length,
            "com_distance": length * rng.uniform(0.2, 0.9),
            "inertia": rng.uniform(0.005, 0.1),
            "angle": rng.uniform(-1, 1),
            "velocity": rng.uniform(-3, 3),
        }
        if k in limited:
            numbers["range"] = [numbers["angle"] - 0.25, numbers["angle"] + 0.4]
        lines.append(f"  - {{name: s{k}, " + ", ".join(f"{key}: {value}" for key, value in numbers.items()) + "}")
    return "\n".join(lines)


def limb_of(n: int, **options):
    return parse_limb(yaml_of(n, **options), "chain.yaml")


class Mujoco:
    """The same chain there: hinges about z, bodies whose x axis runs along the segment."""

    def __init__(self, limb, step: float = 1e-4) -> None:
        body = ""
        for k, s in enumerate(limb.segments):
            place = f"{limb.segments[k - 1].length} 0 0" if k else "0 0 0"
            turned = 0.0 if k else limb.base_angle
            body += (
                f'<body name="b{k}" pos="{place}" euler="0 0 {turned}"><joint type="hinge" axis="0 0 1"/>'
                f'<inertial pos="{s.com_distance} 0 0" mass="{s.mass}" diaginertia="{" ".join(3 * [str(s.inertia)])}"/>'
            )
        last = limb.segments[-1]
        body += f'<site name="tip" pos="{last.length} 0 0"/>' + "</body>" * len(limb.segments)
        self.model = mujoco.MjModel.from_xml_string(
            f'<mujoco><compiler angle="radian" autolimits="true"/>'
            f'<option timestep="{step}" gravity="{limb.gravity[0]} {limb.gravity[1]} 0" integrator="RK4"/>'
            f"<worldbody>{body}</worldbody></mujoco>"
        )
        self.data = mujoco.MjData(self.model)
        self.limb = limb
        self.set([s.angle for s in limb.segments], [s.velocity for s in limb.segments])

    def set(self, angle, velocity) -> None:
        self.data.qpos[:], self.data.qvel[:] = angle, velocity
        mujoco.mj_forward(self.model, self.data)

    def acceleration(self, torque) -> np.ndarray:
        force = np.zeros(self.model.nv)
        body = self.model.nbody - 1
        mujoco.mj_applyFT(
            self.model,
            self.data,
            np.array([*self.limb.tip_force, 0.0]),
            np.array([0.0, 0.0, self.limb.tip_torque]),
            self.data.site("tip").xpos.copy(),
            body,
            force,
        )
        self.data.qfrc_applied[:] = force + torque
        mujoco.mj_forward(self.model, self.data)
        return self.data.qacc.copy()

    def matrix(self) -> np.ndarray:
        full = np.zeros((self.model.nv, self.model.nv))
        try:
            mujoco.mj_fullM(self.model, self.data, full)
        except TypeError:
            mujoco.mj_fullM(self.model, full, self.data.qM)
        return full


def joint_matrix(limb, angle: np.ndarray) -> np.ndarray:
    n = len(angle)
    scratch = np.zeros((chain.INERTIA + n, n))
    chain.joint_equations(world_of(limb), segments_of(limb), np.zeros(3), np.append(angle, np.zeros(n)), scratch)
    return scratch[chain.INERTIA :].copy()


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5])
def test_accelerations_are_those_of_mujoco(n):
    rng = np.random.default_rng(n)
    limb = limb_of(n, seed=n, tip=TIP)
    other = Mujoco(limb)
    world, segments, load, scratch = world_of(limb), segments_of(limb), np.array(TIP), np.zeros((chain.INERTIA + n, n))
    for _ in range(20):
        angle, velocity, torque = rng.uniform(-3, 3, n), rng.uniform(-8, 8, n), rng.uniform(-20, 20, n)
        found = np.empty(n)
        chain.acceleration(world, segments, load, np.append(angle, velocity), torque, np.zeros(n), found, scratch)
        other.set(angle, velocity)
        np.testing.assert_allclose(found, other.acceleration(torque), rtol=1e-8, atol=1e-7)
        np.testing.assert_allclose(joint_matrix(limb, angle), other.matrix(), rtol=1e-9, atol=1e-12)


@pytest.fixture(scope="session")
def five():
    """The structure of a chain of five segments without muscles, compiled once."""
    return WholeModel(limb_of(5, seed=3))


def simulate(limb, duration: float, rate: float = 1000.0, **options):
    return WholeModel(limb).simulate(np.zeros((round(duration * rate) + 1, 0)), rate, **options)


def energy(limb, angle: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    """Kinetic and potential energy [T], from positions and velocities of the centres of mass."""
    turned, speed = limb.base_angle + np.cumsum(angle, axis=1), np.cumsum(velocity, axis=1)
    mass, inertia, length, com = (
        np.array([getattr(segment, key) for segment in limb.segments])
        for key in ("mass", "inertia", "length", "com_distance")
    )
    centres, _ = points(length, com, np.stack([np.cos(turned), np.sin(turned)], axis=-1))
    moving, _ = points(length, com, speed[..., None] * np.stack([-np.sin(turned), np.cos(turned)], axis=-1))
    return (0.5 * mass * (moving**2).sum(axis=-1) + 0.5 * inertia * speed**2 - mass * (centres @ limb.gravity)).sum(
        axis=1
    )


def test_energy_of_five_free_segments_is_conserved(five):
    found = five.simulate(np.zeros((5001, 0)), 1000.0)
    total = energy(five.limb, found.angle, found.velocity)
    exchanged = np.ptp(total - energy(five.limb, found.angle, 0 * found.velocity))
    assert exchanged > 10.0
    assert np.abs(total - total[0]).max() < 1e-6 * exchanged


def test_trajectory_of_five_segments_is_that_of_mujoco(five):
    other, limb = Mujoco(five.limb, step=5e-5), five.limb
    found = simulate(limb, 0.5, 100.0)
    for row in range(1, 51):
        for _ in range(200):
            mujoco.mj_step(other.model, other.data)
        np.testing.assert_allclose(found.angle[row], other.data.qpos, atol=1e-6)
        np.testing.assert_allclose(found.velocity[row], other.data.qvel, atol=1e-5)


def strike(limb, y: np.ndarray, locked: np.ndarray) -> None:
    """An impact without muscles and load."""
    n = locked.size
    given = np.zeros(3), y, np.zeros(n), locked, np.empty(n), np.empty(2 * n), np.zeros((chain.INERTIA + n, n))
    chain.impact(world_of(limb), segments_of(limb), *given)


def after_impact(matrix, velocity, side) -> tuple[np.ndarray, list[bool]]:
    """Velocities and stopped joints, of all ways to stop some on a limit the one in which limits only push."""
    on = [joint for joint, flag in enumerate(side) if flag]
    found = []
    for number in range(len(on) + 1):
        for stopped in combinations(on, number):
            free = [joint for joint in range(len(side)) if joint not in stopped]
            after = np.zeros(len(side))
            after[free] = np.linalg.solve(matrix[np.ix_(free, free)], (matrix @ velocity)[free])
            impulse = matrix @ (after - velocity)
            if all(side[j] * impulse[j] <= 0 for j in stopped) and all(side[j] * after[j] <= 0 for j in on):
                found.append((after, [joint in stopped for joint in range(len(side))]))
    (only,) = found
    return only


@settings(max_examples=100)
@given(st.integers(1, 5), st.integers(0, 10**6), st.data())
def test_limits_only_push_in_an_impact(n, seed, data):
    limb = limb_of(n, seed=seed)
    rng = np.random.default_rng(seed)
    angle, velocity = rng.uniform(-3, 3, n), rng.uniform(-8, 8, n)
    side = np.array(data.draw(st.lists(st.sampled_from([-1.0, 0.0, 1.0]), min_size=n, max_size=n)))
    other = Mujoco(limb)
    other.set(angle, velocity)
    matrix = other.matrix()
    expected, stopped = after_impact(matrix, velocity, side)
    y, locked = np.append(angle, velocity), side.copy()
    strike(limb, y, locked)
    np.testing.assert_allclose(y[n:], expected, rtol=1e-8, atol=1e-9)
    # Locked are those that have been stopped.
    np.testing.assert_array_equal(locked != 0.0, stopped)
    np.testing.assert_array_equal(locked[locked != 0.0], side[locked != 0.0])
    np.testing.assert_array_equal(y[n:][locked != 0.0], 0.0)
    # No impulse adds energy.
    assert y[n:] @ matrix @ y[n:] <= velocity @ matrix @ velocity * (1 + 1e-12)


def test_a_resting_joint_is_thrown_off_its_limit():
    """Two links in a line, the proximal joint on its highest angle; the distal one meets its lowest at -v.

    By hand: the momentum about the proximal joint is kept, M_11 w' = -M_12 v, and its limit cannot hold it.
    """
    limb = limb_of(2)
    matrix = Mujoco(limb)
    matrix.set(np.zeros(2), np.zeros(2))
    inertia = matrix.matrix()
    y, locked = np.array([0.0, 0.0, 0.0, -3.0]), np.array([1.0, -1.0])
    strike(limb, y, locked)
    assert locked.tolist() == [0.0, -1.0]
    assert y[2:] == pytest.approx([-3.0 * inertia[0, 1] / inertia[0, 0], 0.0])
    # At its lowest angle the limit would push.
    y, locked = np.array([0.0, 0.0, 0.0, -3.0]), np.array([-1.0, -1.0])
    strike(limb, y, locked)
    assert (locked.tolist(), y[2:].tolist()) == ([-1.0, -1.0], [0.0, 0.0])


@pytest.mark.usefixtures("five")
@pytest.mark.parametrize("seed", [0, 1, 2, 3])
def test_joints_stay_within_their_ranges(seed):
    limb = limb_of(5, seed=seed, limited=(0, 2, 3))
    found = simulate(limb, 3.0)
    total = energy(limb, found.angle, found.velocity)
    # Limits take energy and give none.
    assert np.diff(total).max() < 1e-6 * np.ptp(total)
    touched = 0
    for joint in 0, 2, 3:
        lowest, highest = limb.segments[joint].joint_range
        angle, velocity = found.angle[:, joint], found.velocity[:, joint]
        assert angle.min() >= lowest - 1e-9
        assert angle.max() <= highest + 1e-9
        resting = (angle == lowest) | (angle == highest)
        touched += resting.sum()
        assert np.all(velocity[resting] == 0.0)
        # Nothing jumps: between two instants a joint moves no farther than its speed and acceleration allow.
        reach = np.maximum(np.abs(velocity[:-1]), np.abs(velocity[1:])) * 1e-3
        assert (np.abs(np.diff(angle)) <= reach + 0.2e-3).all()
    assert touched > 100
    # Impacts take energy, nothing gives any.
    total = energy(limb, found.angle, found.velocity)
    assert np.diff(total).max() < 1e-5
    assert total[-1] < total[0] - 0.1
