"""Huxley's two-state cross-bridges in Zahalak's distribution-moment approximation.

Bonds of length x (in units of the reach h) between myosin and actin are made at the rate f(x) and
broken at g(x). Zahalak takes their distribution for a normal one, of which the first three moments
are the states of the law: Q_0 (stiffness), Q_1 (force), Q_2 (elastic energy).

Symbols of the paper: Q_i bond_moment_i, F_i/Q_0 bond_loss_i, u bond_velocity, f_1 attachment, g_1 detachment,
g_2 release, g_3 overstretch, h reach. Half a sarcomere shortens at half its velocity.
"""

import math
from functools import lru_cache

from limb_nodes.foundation.parameter import Parameter
from limb_nodes.levels.contracts import register
from limb_nodes.levels.equation import Law, State, equation
from limb_nodes.levels.sarcomere.bond_moments import loss_0, loss_1, loss_2

# Bonds just made, as a share of all sites, that are always counted in: the mean length of no bonds
# at all would be 0/0. Just made, they have the moments 1, 2/3 and 1/2 of f.
FRESH = 1e-8
# Of Newton's method, to the steady state in isometry.
STEPS = 15

# f_1, g_1, g_2, g_3 (1/s).
Rates = tuple[float, float, float, float]


@equation("P_0", "maximum_sarcomere_force")
def maximum_sarcomere_force(maximum_force: float) -> float:
    """Isometric force (N)."""
    return maximum_force


@equation("u", "bond_velocity")
def bond_velocity(sarcomere_velocity: float, reach: float) -> float:
    """Shortening velocity (1/s) of half a sarcomere in units of the reach."""
    return 0.5 * sarcomere_velocity / reach


@equation("p", "bond_mean")
def bond_mean(bond_moment_0: float, bond_moment_1: float) -> float:
    """Mean length (1) of the bonds, Q_1/Q_0."""
    return (bond_moment_1 + FRESH * 2.0 / 3.0) / (max(0.0, bond_moment_0) + FRESH)


@equation("q", "bond_deviation")
def bond_deviation(bond_moment_0: float, bond_moment_2: float, bond_mean: float) -> float:
    """Standard deviation (1) of the bonds' length, sqrt(Q_2/Q_0 - p^2)."""
    square = (bond_moment_2 + FRESH * 0.5) / (max(0.0, bond_moment_0) + FRESH)
    return math.sqrt(max(1e-6, square - bond_mean * bond_mean))


@equation("F_0/Q_0", "bond_loss_0")
def bond_loss_0(
    bond_mean: float, bond_deviation: float, attachment: float, detachment: float, release: float, overstretch: float
) -> float:
    """Loss (1/s) of bonds, over their number."""
    return loss_0(bond_mean, bond_deviation, attachment, detachment, release, overstretch)


@equation("F_1/Q_0", "bond_loss_1")
def bond_loss_1(
    bond_mean: float, bond_deviation: float, attachment: float, detachment: float, release: float, overstretch: float
) -> float:
    """Loss (1/s) of the bonds' summed length, over their number."""
    return loss_1(bond_mean, bond_deviation, attachment, detachment, release, overstretch)


@equation("F_2/Q_0", "bond_loss_2")
def bond_loss_2(
    bond_mean: float, bond_deviation: float, attachment: float, detachment: float, release: float, overstretch: float
) -> float:
    """Loss (1/s) of the bonds' summed squared length, over their number."""
    return loss_2(bond_mean, bond_deviation, attachment, detachment, release, overstretch)


@equation("dQ_0/dt", "bond_moment_0_rate")
def bond_moment_0_rate(bond_moment_0: float, bond_loss_0: float, attachment: float) -> float:
    """Rate (1/s) of the number of bonds: b_0 - F_0."""
    return attachment / 2.0 - bond_moment_0 * bond_loss_0


@equation("dQ_1/dt", "bond_moment_1_rate")
def bond_moment_1_rate(bond_moment_0: float, bond_loss_1: float, bond_velocity: float, attachment: float) -> float:
    """Rate (1/s) of the bonds' summed length: b_1 - F_1 - u Q_0."""
    return attachment / 3.0 - bond_moment_0 * (bond_loss_1 + bond_velocity)


@equation("dQ_2/dt", "bond_moment_2_rate")
def bond_moment_2_rate(
    bond_moment_0: float, bond_moment_1: float, bond_loss_2: float, bond_velocity: float, attachment: float
) -> float:
    """Rate (1/s) of the bonds' summed squared length: b_2 - F_2 - 2 u Q_1."""
    return attachment / 4.0 - bond_moment_0 * bond_loss_2 - 2.0 * bond_velocity * bond_moment_1


def misfits(mean: float, variance: float, rates: Rates) -> tuple[float, float]:
    """Both are zero if a distribution stays as it is in isometry: F_1/F_0 = b_1/b_0 and F_2/F_0 = b_2/b_0."""
    deviation = math.sqrt(variance)
    lost = loss_0(mean, deviation, *rates)
    return (
        loss_1(mean, deviation, *rates) - lost * 2.0 / 3.0,
        loss_2(mean, deviation, *rates) - lost * 0.5,
    )


def newton_step(mean: float, variance: float, rates: Rates) -> tuple[float, float]:
    """Newton's step of mean and variance (1) towards the steady state in isometry."""
    d = 1e-5
    one, two = misfits(mean, variance, rates)
    by_mean = zip(misfits(mean + d, variance, rates), misfits(mean - d, variance, rates), strict=True)
    by_variance = zip(misfits(mean, variance + d, rates), misfits(mean, variance - d, rates), strict=True)
    one_mean, two_mean = ((after - before) / (2.0 * d) for after, before in by_mean)
    one_variance, two_variance = ((after - before) / (2.0 * d) for after, before in by_variance)
    determinant = one_mean * two_variance - one_variance * two_mean
    return (
        (one_variance * two - two_variance * one) / determinant,
        (two_mean * one - one_mean * two) / determinant,
    )


@lru_cache
def isometric_bonds(rates: Rates) -> tuple[float, float]:
    """Mean and variance (1) of the bonds' length in isometry, from those of Huxley's exact distribution on."""
    mean, variance = 0.5, 1.0 / 12.0
    for _ in range(STEPS):
        mean_step, variance_step = newton_step(mean, variance, rates)
        mean = min(0.95, max(0.05, mean + mean_step))
        variance = min(0.5, max(0.01, variance + variance_step))
    return mean, variance


@equation("p, isometric", "isometric_mean")
def isometric_mean(attachment: float, detachment: float, release: float, overstretch: float) -> float:
    """Mean length (1) of the bonds in isometry."""
    return isometric_bonds((attachment, detachment, release, overstretch))[0]


@equation("q^2, isometric", "isometric_variance")
def isometric_variance(attachment: float, detachment: float, release: float, overstretch: float) -> float:
    """Variance (1) of the bonds' length in isometry."""
    return isometric_bonds((attachment, detachment, release, overstretch))[1]


@equation("Q_0, isometric", "isometric_moment_0")
def isometric_moment_0(
    isometric_mean: float,
    isometric_variance: float,
    attachment: float,
    detachment: float,
    release: float,
    overstretch: float,
) -> float:
    """Share (1) of the sites with a bond in isometry, b_0 Q_0/F_0."""
    deviation = math.sqrt(isometric_variance)
    return attachment / 2.0 / loss_0(isometric_mean, deviation, attachment, detachment, release, overstretch)


@equation("Q_1, isometric", "isometric_moment_1")
def isometric_moment_1(isometric_moment_0: float, isometric_mean: float) -> float:
    """First moment (1) of the bonds in isometry."""
    return isometric_moment_0 * isometric_mean


@equation("Q_0, start", "initial_moment_0")
def initial_moment_0(initial_bonds: float, isometric_moment_0: float) -> float:
    """Q_0 (1) at the start."""
    return initial_bonds * isometric_moment_0


@equation("Q_1, start", "initial_moment_1")
def initial_moment_1(initial_bonds: float, isometric_moment_1: float) -> float:
    """Q_1 (1) at the start."""
    return initial_bonds * isometric_moment_1


@equation("Q_2, start", "initial_moment_2")
def initial_moment_2(
    initial_bonds: float, isometric_moment_0: float, isometric_mean: float, isometric_variance: float
) -> float:
    """Q_2 (1) at the start."""
    return initial_bonds * isometric_moment_0 * (isometric_mean * isometric_mean + isometric_variance)


@equation("Q_1 to force", "sarcomere_force")
def sarcomere_force(bond_moment_1: float, isometric_moment_1: float, maximum_force: float) -> float:
    """Force (N): the bonds are springs, so it goes with their summed length."""
    return maximum_force * bond_moment_1 / isometric_moment_1


huxley = register(
    Law(
        "sarcomere",
        "huxley",
        (
            maximum_sarcomere_force,
            isometric_mean,
            isometric_variance,
            isometric_moment_0,
            isometric_moment_1,
            initial_moment_0,
            initial_moment_1,
            initial_moment_2,
            bond_velocity,
            bond_mean,
            bond_deviation,
            bond_loss_0,
            bond_loss_1,
            bond_loss_2,
            bond_moment_0_rate,
            bond_moment_1_rate,
            bond_moment_2_rate,
            sarcomere_force,
        ),
        (
            Parameter(
                "maximum_force",
                "N",
                "isometric force",
                9.7778e-13,
                "report, 2.4 with the values of rabbit psoas",
                above=0.0,
            ),
            Parameter(
                "reach",
                "m",
                "greatest distance at which a bond is made, h",
                15.6e-9,
                "Huxley, Prog Biophys 7 (1957) 255",
                above=1e-10,
                below=1e-6,
            ),
            Parameter(
                "attachment",
                "1/s",
                "rate of making bonds at the reach, f_1",
                43.3,
                "Huxley 1957, frog at 0 C",
                minimum=0.1,
                maximum=1e5,
            ),
            Parameter(
                "detachment",
                "1/s",
                "rate of breaking bonds at the reach, g_1",
                10.0,
                "Huxley 1957, frog at 0 C",
                minimum=0.1,
                maximum=1e5,
            ),
            Parameter(
                "release",
                "1/s",
                "rate of breaking bonds that pull backwards, g_2",
                209.0,
                "Huxley 1957, frog at 0 C",
                minimum=0.1,
                maximum=1e5,
            ),
            Parameter(
                "overstretch",
                "1/s",
                "further rate of breaking bonds per length beyond the reach, g_3",
                30.0,
                "estimate: at most 1.8 times the isometric force in stretch (Katz 1939); 0 in Huxley 1957, 3.7 times",
                minimum=0.0,
                maximum=1e5,
            ),
            Parameter(
                "initial_bonds",
                "1",
                "bonds at the start over those in isometry; 0: all are still to be made",
                1.0,
                "depends on the run",
                minimum=0.0,
                maximum=2.0,
            ),
        ),
        states=(
            State("bond_moment_0", "bond_moment_0_rate", "dQ_0/dt", "initial_moment_0", 0.5),
            State("bond_moment_1", "bond_moment_1_rate", "dQ_1/dt", "initial_moment_1", 0.5),
            State("bond_moment_2", "bond_moment_2_rate", "dQ_2/dt", "initial_moment_2", 0.5),
        ),
        ranges={"bond_moment_0": (0.0, 1.0), "bond_moment_1": (-1.0, 2.0), "bond_moment_2": (0.0, 4.0)},
        source="Zahalak, Math Biosci 55 (1981) 89, after Huxley, Prog Biophys 7 (1957) 255",
    )
)
