"""The steps of the nodes against the whole model: must-show 6."""

import numpy as np
import pytest

from limb_nodes.solve.failure import SolveError
from limb_nodes.solve.stepping import LimbStepper, MuscleStepper


def run(limb, excitation: np.ndarray, rate: float) -> tuple[np.ndarray, np.ndarray, MuscleStepper]:
    """Joint angles and velocities [T, n] from muscles and chain that meet at ticks only."""
    muscles, chain = MuscleStepper(limb), LimbStepper(limb)
    period = 1.0 / rate
    angles, velocities = [chain.angle.copy()], [chain.velocity.copy()]
    earlier, drive = None, muscles.drive(excitation[0])
    for row in excitation[1:]:
        following = muscles.drive(row)
        before = chain.angle.copy(), chain.velocity.copy()
        torque = muscles.torque(*before, drive, following, period, earlier)
        chain.step(torque, period)
        after = chain.angle.copy(), chain.velocity.copy()
        muscles.advance(before, after, drive, following, period, earlier)
        earlier, drive = drive, following
        angles.append(chain.angle.copy())
        velocities.append(chain.velocity.copy())
    return np.array(angles), np.array(velocities), muscles


@pytest.mark.parametrize(("rate", "tolerance"), [(1000.0, 2e-5), (200.0, 5e-4)])
@pytest.mark.parametrize("name", ["reference_joint", "reference_joint_tendon"])
def test_ten_seconds_of_sine_and_cosine(name, rate, tolerance, limb_named, model_named, sine_cosine):
    time = np.arange(round(10 * rate) + 1) / rate
    excitation = sine_cosine(time)
    whole = model_named(name).simulate(excitation, rate, method="explicit")
    angle, _, muscles = run(limb_named(name), excitation, rate)
    error = np.abs(angle - whole.angle).max()
    assert np.ptp(whole.angle) > 0.5
    assert error <= tolerance
    np.testing.assert_allclose(muscles.internal, whole.internal[-1], atol=1e-5)


def test_the_error_falls_with_the_square_of_the_tick(limb_named, model_named):
    """Smooth input, so that only the exchange at ticks errs."""

    def error(rate: float) -> float:
        time = np.arange(round(2 * rate) + 1) / rate
        excitation = 0.92 + 0.04 * np.column_stack([np.sin(5 * time), np.cos(5 * time)])
        whole = model_named("reference_joint_tendon").simulate(excitation, rate, method="explicit")
        return np.abs(run(limb_named("reference_joint_tendon"), excitation, rate)[0] - whole.angle).max()

    coarse, fine = error(100.0), error(400.0)
    assert fine < coarse / 12
    assert coarse < 1e-3


def test_several_joints_with_ranges(limb_named, model_named, waves):
    """The arm, whose elbow strikes its limit."""
    rate = 1000.0
    excitation = waves(np.arange(1001) / rate, 4)
    whole = model_named("arm").simulate(excitation, rate, method="explicit")
    angle, velocity, _ = run(limb_named("arm"), excitation, rate)
    assert (whole.angle[:, 1] == 0.0).any()
    np.testing.assert_allclose(angle, whole.angle, rtol=0, atol=2e-4)
    resting = angle[:, 1] == 0.0
    assert resting.any()
    assert (velocity[resting, 1] == 0.0).all()
    assert angle[:, 1].min() == 0.0


def test_the_same_steps_give_the_same_numbers(limb_named, sine_cosine):
    excitation = sine_cosine(np.arange(501) / 1000)
    one, two = (run(limb_named("reference_joint_tendon"), excitation, 1000.0) for _ in range(2))
    assert np.array_equal(one[0], two[0])
    assert np.array_equal(one[1], two[1])


def test_what_is_shown_is_what_the_whole_model_shows(limb_named, model_named, sine_cosine):
    excitation = sine_cosine(np.arange(101) / 1000)
    whole = model_named("reference_joint_tendon").simulate(excitation, 1000.0, method="explicit")
    muscles = MuscleStepper(limb_named("reference_joint_tendon"))
    muscles.internal[:] = whole.internal[100]
    muscles.observe(whole.angle[100], whole.velocity[100], excitation[100])
    wanted = {**whole.muscle, **whole.unit}
    assert muscles.shown.keys() == wanted.keys()
    for name, values in muscles.shown.items():
        np.testing.assert_allclose(values, wanted[name][100], rtol=1e-12, err_msg=name)


def test_a_load_on_the_tip(limb_named, model_named):
    load = {"tip_force": [3.0, -5.0], "tip_torque": 0.2}
    still = np.zeros((301, 2))
    whole = model_named("reference_joint", load).simulate(still, 1000.0, method="explicit")
    chain, muscles = LimbStepper(limb_named("reference_joint")), MuscleStepper(limb_named("reference_joint"))
    chain.load[:] = [3.0, -5.0, 0.2]
    drive = muscles.drive(still[0])
    for row in range(300):
        torque = muscles.torque(chain.angle, chain.velocity, drive, drive, 1e-3)
        np.testing.assert_allclose(chain.acceleration(torque), whole.acceleration[row], rtol=1e-4, atol=1e-3)
        chain.step(torque, 1e-3)
    np.testing.assert_allclose(chain.angle, whole.angle[-1], atol=1e-6)


def test_a_torque_that_is_not_a_number_is_an_error(limb_named):
    for row in range(4):
        chain = LimbStepper(limb_named("reference_joint"))
        torque = np.zeros((4, 1))
        torque[row] = np.nan
        with pytest.raises(SolveError, match="cannot be advanced"):
            chain.step(torque, 1e-3)


@pytest.mark.parametrize("muscle", [0, 1])
def test_an_activation_that_is_not_a_number_is_an_error(muscle, limb_named):
    """In the first muscle as in the last: the state of one is not a number, that of the other is."""
    muscles = MuscleStepper(limb_named("reference_joint_tendon"))
    excitation = np.full(2, 0.9)
    excitation[muscle] = np.nan
    drive = muscles.drive(excitation)
    here = np.array([0.3]), np.array([0.0])
    assert np.isnan(muscles.torque(*here, drive, drive, 1e-3)[0]).all()
    with pytest.raises(SolveError, match="cannot be advanced"):
        muscles.advance(here, here, drive, drive, 1e-3)
