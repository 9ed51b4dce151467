"""The laws that can take the place of the report's: their papers' numbers, and all of them in one limb."""

import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

from limb_nodes.levels import CONTRACTS, REGISTRY
from limb_nodes.levels.motor_unit import activation_frequency, exponential_passive_force, fuglevand
from limb_nodes.levels.motor_unit.gordon_huxley_julian import gordon_huxley_julian
from limb_nodes.levels.muscle import constant_thickness, first_order, geometric_path, path, toe_region
from limb_nodes.levels.sarcomere import bond_moments, hill, huxley
from limb_nodes.model import load_limb
from limb_nodes.solve.stepping import LimbStepper, MuscleStepper
from limb_nodes.solve.whole import WholeModel

ALTERNATIVES = Path(__file__).with_name("alternatives.yaml")


def defaults(process: str, name: str) -> dict[str, float]:
    """The default values of a law's parameters."""
    return {parameter.name: parameter.default for parameter in REGISTRY[process][name].parameters}


# Hill


def hill_force(velocity: float, plateau: float = 1.5) -> float:
    """Force over P_0 at a velocity in units of v_max, a/P_0 = 0.25."""
    return hill.sarcomere_force(velocity, 1.0, 1.0, 0.25, plateau)


# (P + a)(v + b) = (P_0 + a) b with a = b = 0.25: P = 1.25 * 0.25/(v + 0.25) - 0.25.
@pytest.mark.parametrize(("velocity", "force"), [(0.0, 1.0), (0.25, 0.375), (0.5, 1 / 6), (0.75, 0.0625), (1.0, 0.0)])
def test_hill_hyperbola(velocity, force):
    assert hill_force(velocity) == pytest.approx(force, abs=1e-12)


def test_hill_power_is_greatest_at_a_third_of_velocity_and_force():
    velocities = np.linspace(0, 1, 1001)
    best = velocities[np.argmax([v * hill_force(v) for v in velocities])]
    # v/v_max = P/P_0 = sqrt(k^2 + k) - k, 0.309 at k = 0.25.
    assert best == pytest.approx(0.309, abs=1e-3)
    assert hill_force(best) == pytest.approx(0.309, abs=1e-3)


def test_hill_lengthening_joins_smoothly():
    small = 1e-6
    # The slope of the hyperbola at rest is -(1 + P_0/a) = -5.
    assert (hill_force(small) - hill_force(0.0)) / small == pytest.approx(-5.0, rel=1e-4)
    assert (hill_force(0.0) - hill_force(-small)) / small == pytest.approx(-5.0, rel=1e-4)
    assert hill_force(-1e6) == pytest.approx(1.5, rel=1e-5)


# Huxley


@pytest.mark.parametrize(("mean", "deviation"), [(0.5, 0.29), (-0.4, 0.6), (1.7, 0.3)])
def test_bond_moments_against_quadrature(mean, deviation):
    def normal(x: float) -> float:
        return math.exp(-0.5 * ((x - mean) / deviation) ** 2) / (deviation * math.sqrt(2 * math.pi))

    def detaching(x: float) -> float:
        f = 43.3 * x if 0 < x < 1 else 0.0
        g = 209.0 if x < 0 else 10.0 * x + 30.0 * max(0.0, x - 1.0)
        return f + g

    for power, loss in enumerate((bond_moments.loss_0, bond_moments.loss_1, bond_moments.loss_2)):
        parts = [
            quad(lambda x, p=power: x**p * detaching(x) * normal(x), low, high, epsabs=1e-12, epsrel=1e-12)[0]
            for low, high in ((-8, 0), (0, 1), (1, 8))
        ]
        assert loss(mean, deviation, 43.3, 10.0, 209.0, 30.0) == pytest.approx(sum(parts), rel=1e-8)


def steady_force(velocity: float, rates: tuple[float, ...]) -> float:
    """Steady force over the isometric one at a velocity u (1/s)."""
    mean, variance = huxley.isometric_mean(*rates), huxley.isometric_variance(*rates)
    bonds = huxley.isometric_moment_0(mean, variance, *rates)

    def slope(_, q):
        p = huxley.bond_mean(q[0], q[1])
        s = huxley.bond_deviation(q[0], q[2], p)
        return [
            huxley.bond_moment_0_rate(q[0], huxley.bond_loss_0(p, s, *rates), rates[0]),
            huxley.bond_moment_1_rate(q[0], huxley.bond_loss_1(p, s, *rates), velocity, rates[0]),
            huxley.bond_moment_2_rate(q[0], q[1], huxley.bond_loss_2(p, s, *rates), velocity, rates[0]),
        ]

    # Switched on: no bonds at the start.
    solved = solve_ivp(slope, (0.0, 10.0), [0.0, 0.0, 0.0], method="LSODA", rtol=1e-9, atol=1e-12)
    return float(solved.y[1, -1] / huxley.isometric_moment_1(bonds, mean))


# Huxley 1957, frog at 0 C; none of Zahalak's extension.
FROG = (43.3, 10.0, 209.0, 0.0)


def huxley_force(velocity: float) -> float:
    """Huxley's own closed form, of the full distribution; velocity in units of phi."""
    part = (FROG[0] + FROG[1]) / FROG[2]
    return 1.0 - velocity * (1.0 - math.exp(-1.0 / velocity)) * (1.0 + 0.5 * part * part * velocity)


@pytest.mark.parametrize("velocity", [0.1, 0.25, 0.5, 1.0, 2.0, 3.0, 4.0])
def test_moments_follow_huxleys_force_velocity_curve(velocity):
    # phi of whole muscle is (f_1 + g_1)/2 in reaches per second of half a sarcomere; V_max = 4 phi.
    found = steady_force(velocity * (FROG[0] + FROG[1]) / 2.0, FROG)
    assert found == pytest.approx(huxley_force(velocity), abs=0.035)


@pytest.mark.parametrize("rates", [FROG, (43.3, 10.0, 209.0, 30.0), (500.0, 20.0, 3000.0, 10.0), (5.0, 8.0, 6.0, 90.0)])
def test_huxley_is_calibrated_to_its_isometric_force(rates):
    assert steady_force(0.0, rates) == pytest.approx(1.0, abs=1e-6)


def test_huxley_stretch():
    # Katz 1939: up to 1.8 times the isometric force in slow stretch; Huxley without the extension far more.
    default = tuple(
        defaults("sarcomere", "huxley")[name] for name in ("attachment", "detachment", "release", "overstretch")
    )
    velocities = [-0.5 * part * (FROG[0] + FROG[1]) for part in (0.5, 1.0, 2.0)]
    assert 1.6 < max(steady_force(v, default) for v in velocities) < 1.9
    assert steady_force(velocities[1], FROG) > 3.0


# Motor unit


# Gordon, Huxley and Julian's figure 12: frog, actin 1.00 um, myosin 1.65 um.
@pytest.mark.parametrize(
    ("length", "factor"),
    [(1.0, 0.0), (1.27, 0.0), (1.67, 0.84), (2.0, 1.0), (2.1, 1.0), (2.25, 1.0), (2.95, 0.5), (3.65, 0.0), (4.0, 0.0)],
)
def test_frog_length_tension_diagram(length, factor):
    values = defaults("force_length", "gordon_huxley_julian")
    assert gordon_huxley_julian(length * 1e-6, 2.0e-6, 3.65e-6, *values.values()) == pytest.approx(factor, abs=1e-9)


def test_plateau_moves_with_the_filaments():
    values = defaults("force_length", "gordon_huxley_julian")
    factors = [gordon_huxley_julian(x * 1e-6, 2.7e-6, 4.3e-6, *values.values()) for x in (2.7, 2.95, 3.625, 4.3)]
    assert factors == pytest.approx([1.0, 1.0, 0.5, 0.0], abs=1e-9)


def frequency_factor(frequency: float, length: float = 1.0, **changed: float) -> float:
    """Af at a frequency over f_0.5 and a length over the optimal one."""
    values = {**defaults("force_frequency", "cheng"), **changed}
    return activation_frequency.cheng(15.0 * frequency, 30.0, 2.7e-6 * length, 2.7e-6, *values.values())


def test_activation_frequency():
    assert frequency_factor(0.0) == 0.0
    # f_0.5 is the frequency of half the force: 1 - exp(-(1/1.176)^2.1).
    assert frequency_factor(1.0) == pytest.approx(0.509, abs=5e-4)
    assert frequency_factor(2.0) == pytest.approx(0.953, abs=5e-4)
    # n_f at 0.8 L_0 is 2.1 + 5/4 = 3.35 in slow, 2.925 in fast fibres; at 1.25 L_0 it is 1.1.
    assert frequency_factor(1.0, 0.8) == pytest.approx(1 - math.exp(-((1 / (0.56 * 3.35)) ** 3.35)), rel=1e-12)
    assert frequency_factor(1.0, 0.8, length_dependence=3.3) == pytest.approx(0.2103, abs=5e-4)
    assert frequency_factor(1.0, 1.25) == pytest.approx(0.8180, abs=5e-4)


def test_long_fibres_need_lower_frequencies():
    for frequency in (0.25, 0.5, 1.0):
        factors = [frequency_factor(frequency, length) for length in (0.6, 0.8, 1.0, 1.2, 1.5, 1.8, 2.5)]
        assert all(math.isfinite(factor) for factor in factors)
        assert factors[:5] == sorted(factors[:5])


def test_exponential_passive_force():
    # Thelen 2003, k_PE = 5: (e^2.5 - 1)/(e^5 - 1) at half of the strain epsilon_0.
    assert exponential_passive_force.exponential(2.0, 1.0, 5.0) == pytest.approx(1.0)
    assert exponential_passive_force.exponential(1.5, 1.0, 5.0) == pytest.approx(0.0759, abs=5e-5)
    assert exponential_passive_force.exponential(0.7, 1.0, 5.0) == 0.0


def test_fuglevand_thresholds():
    def joins(rank: float) -> float:
        activations = np.linspace(0, 1, 20001)
        return activations[np.argmax([fuglevand.fuglevand(a, rank, 8.0, 35.0, 30.0, 0.53) > 0.0 for a in activations])]

    first, middle, last = joins(0.0), joins(0.5), joins(1.0)
    assert last / first == pytest.approx(30.0, rel=3e-3)
    assert middle == pytest.approx(math.sqrt(first * last), rel=3e-3)
    assert last == pytest.approx(30 / 57, abs=4e-3)


def test_fuglevand_rates():
    # All start at 8 Hz and rise with the same slope; early ones are at their greatest rate before the end.
    assert fuglevand.fuglevand(0.5300001, 1.0, 8.0, 35.0, 30.0, 0.53) == pytest.approx(8.0, abs=1e-4)
    assert fuglevand.fuglevand(1.0, 1.0, 8.0, 35.0, 30.0, 0.53) == pytest.approx(35.0)
    assert fuglevand.fuglevand(0.6, 0.0, 8.0, 35.0, 30.0, 0.53) == 35.0
    slopes = [
        (
            fuglevand.fuglevand(0.55, rank, 8.0, 50.0, 30.0, 0.53)
            - fuglevand.fuglevand(0.54, rank, 8.0, 50.0, 30.0, 0.53)
        )
        for rank in (0.8, 1.0)
    ]
    assert slopes[0] == pytest.approx(slopes[1])


# Muscle


def activation_after(time: float, start: float, excitation: float) -> float:
    solved = solve_ivp(
        lambda _, a: [first_order.activation_rate(excitation, a[0], 0.015, 0.05)],
        (0.0, time),
        [start],
        rtol=1e-10,
        atol=1e-12,
    )
    return solved.y[0, -1]


@pytest.mark.parametrize("activation", [0.2, 0.5, 0.9])
def test_activation_rises_and_falls_as_thelen_has_it(activation):
    # The integrals of da (0.5 + 1.5 a)/(1 - a) and of da/(a (0.5 + 1.5 a)).
    rise = 0.015 * (-2.0 * math.log(1.0 - activation) - 1.5 * activation)
    fall = 0.05 * 2.0 * (math.log((0.5 + 1.5 * activation) / activation) - math.log(2.0))
    assert activation_after(rise, 0.0, 1.0) == pytest.approx(activation, abs=1e-7)
    assert activation_after(fall, 1.0, 0.0) == pytest.approx(activation, abs=1e-7)


def tendon_force(strain: float) -> float:
    """Force of Thelen's tendon over the greatest, epsilon_0 = 0.04."""
    toe = toe_region.toe_strain(0.04, 0.33, 3.0)
    return toe_region.elastic_tendon_force(0.2 * (1.0 + strain), 0.2, toe, 1.0, 0.04, 0.33, 3.0)


def test_toe_region_has_thelens_constants():
    toe = toe_region.toe_strain(0.04, 0.33, 3.0)
    assert toe / 0.04 == pytest.approx(0.609, abs=1e-3)
    assert (tendon_force(0.05) - tendon_force(0.04)) / 0.01 == pytest.approx(1.712 / 0.04, rel=1e-3)
    assert tendon_force(toe) == pytest.approx(0.33)
    assert tendon_force(0.04) == pytest.approx(1.0)
    assert tendon_force(-0.1) == tendon_force(0.0) == 0.0
    below, above = (tendon_force(toe) - tendon_force(toe - 1e-7)), (tendon_force(toe + 1e-7) - tendon_force(toe))
    assert below == pytest.approx(above, rel=1e-4)


@pytest.mark.parametrize("role", [1.0, -1.0])
@pytest.mark.parametrize("angle", [-1.0, 0.0, 0.7, 2.0])
def test_geometric_moment_arm_does_the_work_of_the_force(role, angle):
    values = (0.0215, 0.10, 0.03)
    arm = geometric_path.moment_arm(path.path_slope(angle, role, *values), role)
    step = 1e-6
    lengths = [path.muscle_tendon_length(angle + side, role, *values) for side in (-step, step)]
    # Torque +F r of a flexor and -F r of an extensor, times the turn, is F times the shortening.
    assert role * arm == pytest.approx((lengths[0] - lengths[1]) / (2 * step), rel=1e-7)


def test_constant_thickness():
    # A fibre of 50 mm at 25 degrees; shortened along the line of pull until the sine doubles at half the length.
    thickness = 0.05 * math.sin(math.radians(25))
    length = 0.05 * math.cos(math.radians(25))
    assert math.degrees(constant_thickness.pennation_angle(length, thickness)) == pytest.approx(25)
    assert constant_thickness.fibre_length(length, thickness) == pytest.approx(0.05)
    short = math.sqrt(0.025**2 - thickness**2)
    assert math.sin(constant_thickness.pennation_angle(short, thickness)) == pytest.approx(
        2 * math.sin(math.radians(25))
    )
    angle = constant_thickness.pennation_angle(length, thickness)
    # No work is lost in the pennation.
    force, velocity = 37.0, 0.11
    assert constant_thickness.muscle_force(force, angle) * velocity == pytest.approx(
        force * constant_thickness.fibre_velocity(velocity, angle)
    )
    step = 1e-7
    slope = (constant_thickness.fibre_length(length + step, thickness) - 0.05) / step
    assert constant_thickness.fibre_velocity(1.0, angle) == pytest.approx(slope, rel=1e-5)


# All in one limb


@pytest.fixture(scope="module")
def limb():
    return load_limb(ALTERNATIVES)


def excitation(rate: float, duration: float) -> np.ndarray:
    time = np.arange(round(duration * rate) + 1) / rate
    return np.stack([0.5 + 0.4 * np.sin(6.0 * time), 0.5 + 0.4 * np.sin(6.0 * time + 2.0)], axis=1)


def stepped(limb, given: np.ndarray, rate: float) -> tuple[np.ndarray, np.ndarray]:
    """Joint angles by the nodes' steps, and the internal states at the end."""
    muscles, chain, period = MuscleStepper(limb), LimbStepper(limb), 1.0 / rate
    angles = [chain.angle[0]]
    for now, then in pairwise(given):
        drive, next_drive = muscles.drive(now), muscles.drive(then)
        before = chain.angle.copy(), chain.velocity.copy()
        chain.step(muscles.torque(*before, drive, next_drive, period), period)
        muscles.advance(before, (chain.angle.copy(), chain.velocity.copy()), drive, next_drive, period)
        angles.append(chain.angle[0])
    return np.array(angles), muscles.internal


def test_limb_holds_every_alternative(limb):
    chosen = {
        (p, c.law.name) for m in limb.muscles for laws in (m.laws, *(u.laws for u in m.units)) for p, c in laws.items()
    }
    by_report = {
        ("sarcomere", "derenyi_vicsek"),
        ("sarcomere", "constant"),
        ("force_length", "constant"),
        ("recruitment", "linear"),
        ("activation_dynamics", "none"),
        ("tendon", "rigid"),
        ("tendon", "voigt"),
        ("path", "constant_moment_arm"),
        ("aponeurosis", "none"),
        ("aponeurosis", "constant_area"),
    }
    # In limbs of their own.
    elsewhere = {
        ("sarcomere", "huxley_distribution"),
        ("force_length", "cheng_optimal_length"),
        ("force_frequency", "twitch_tetanus"),
        ("activation_dynamics", "second_order"),
        ("activation_dynamics", "second_order_logarithmic"),
    }
    of_muscles = [process for process, contract in CONTRACTS.items() if contract.owner != "joint"]
    assert {(process, name) for process in of_muscles for name in REGISTRY[process]} - chosen == by_report | elsewhere


@pytest.mark.parametrize(("rate", "apart"), [(1000.0, 3e-4), (4000.0, 4e-5)])
def test_alternatives_run_whole_and_stepped_alike(rate, apart, limb):
    """A unit that joins jumps to its lowest frequency within a tick; what that costs falls with the tick."""
    given = excitation(rate, 1.5)
    whole = WholeModel(limb).simulate(given, rate)
    angles, internal = stepped(limb, given, rate)
    assert np.ptp(whole.angle) > 0.3
    assert angles == pytest.approx(whole.angle[:, 0], abs=apart)
    assert internal == pytest.approx(whole.internal[-1], abs=2e-3)


def test_states_of_laws_are_the_limbs(limb):
    model = WholeModel(limb)
    names = dict(zip(model.layout.state_names, model.layout.initial_states, strict=True))
    own = ("tendon_length", "activation", *(f"b.bond_moment_{i}" for i in range(3)))
    assert sorted(names) == sorted(f"{muscle}.{state}" for muscle in ("flexor", "extensor") for state in own)
    # At the start as many bonds as in isometry: 0.684, 0.438 and 0.322 for the frog without extension.
    assert [names[f"flexor.b.bond_moment_{i}"] for i in range(3)] == pytest.approx([0.684, 0.438, 0.322], abs=0.03)


def test_virtual_work_through_the_whole_muscle(limb):
    """The torque does the work of the tendon's force, instant by instant."""
    movement = WholeModel(limb).simulate(excitation(200.0, 1.0), 200.0)
    power = movement.muscle["muscle_torque"] * movement.velocity
    shortening = movement.muscle["muscle_force"] * movement.muscle["muscle_tendon_velocity"]
    assert power == pytest.approx(shortening, rel=1e-9, abs=1e-12)


def test_fuglevand_thresholds_of_four_units(tmp_path):
    """RTE_i = exp(i ln(RR)/n) for i from 1 to n (the paper's equation 1), with the last one at 0.53."""
    arm = Path(__file__).resolve().parents[2] / "params" / "arm.yaml"
    file = tmp_path / "arm.yaml"
    file.write_text(arm.read_text().replace("recruitment: {law: linear}", "recruitment: {law: fuglevand}"))
    for muscle in load_limb(file).muscles:
        joins = []
        for unit in muscle.units:
            law = unit.laws["recruitment"]
            rest = [unit.values[name] for name in ("unit_rank", "minimum_frequency", "maximum_frequency")]
            low, high = 0.0, 1.0
            for _ in range(60):
                middle = 0.5 * (low + high)
                low, high = (low, middle) if law.law(middle, *rest, *law.values.values()) > 0.0 else (middle, high)
            joins.append(high)
        assert joins == pytest.approx([0.04136, 0.09677, 0.22649, 0.53], rel=1e-3)
