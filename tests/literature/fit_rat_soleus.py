"""The rat soleus benchmark: its trials, the errors of a limb's muscle on them, and the fit to two of them.

`python -m tests.literature.fit_rat_soleus` fits trials 1 and 5, prints the errors on all three and the
values for rat_soleus.yaml, of the report's laws here and of those in params/.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from limb_nodes.model import Limb, load_limb, with_values
from limb_nodes.solve.bench import BenchRecord, Course, MuscleBench
from tests.recordings import recorded

LIMB = Path(__file__).with_name("rat_soleus.yaml")
SHIPPED = Path(__file__).parents[2] / "params" / "rat_soleus.yaml"
# Amplitude (m) of the displacement in each trial.
TRIALS = {1: 0.05e-3, 3: 0.25e-3, 5: 1.0e-3}
FITTED_TO = (1, 5)
# Measured isometric force (N), to which errors refer.
ISOMETRIC = 1.17
# Muscle-tendon length (m) at no displacement: 2 mm less than the fibres' optimum and the tendon's slack.
START = 17.1e-3 * math.cos(math.radians(6.0)) + 17.1e-3 - 2.0e-3

UNIT, MUSCLE = "muscles[0].units[0]", "muscles[0]"
# What is fitted: start (published where there is a value), lowest, highest.
FREE = {
    f"{UNIT}.parallel_sarcomeres": (1.305e12, 1.0e12, 2.0e12),
    f"{UNIT}.sarcomere.adp_release_rate": (1400.0, 400.0, 4000.0),
    f"{UNIT}.sarcomere.eccentric_plateau": (1.4, 1.1, 2.0),
    f"{MUSCLE}.tendon.stiffness": (1500.0, 500.0, 5000.0),
    f"{MUSCLE}.tendon.damping": (1.0, 0.02, 10.0),
    f"{MUSCLE}.tendon.slack_length": (0.0171, 0.0145, 0.0187),
    f"{MUSCLE}.activation_dynamics.rise_time": (0.03, 0.005, 0.15),
}
# The same of the shipped limb; these are free in both.
ALIKE = (
    f"{UNIT}.sarcomere.eccentric_plateau",
    f"{MUSCLE}.tendon.damping",
    f"{MUSCLE}.tendon.slack_length",
    f"{MUSCLE}.activation_dynamics.rise_time",
)
FREE_SHIPPED = {
    f"{UNIT}.parallel_sarcomeres": (1.305e12, 1.24e12, 1.45e12),
    f"{UNIT}.sarcomere.maximum_velocity": (14.35e-6, 8e-6, 2.4e-5),
    f"{UNIT}.sarcomere.curvature": (0.3, 0.05, 1.5),
    f"{MUSCLE}.tendon.strain_at_maximum": (0.049, 0.03, 0.12),
    f"{MUSCLE}.tendon.toe_force": (0.33, 0.1, 0.6),
    **{place: FREE[place] for place in ALIKE},
}
Free = dict[str, tuple[float, float, float]]


@dataclass(frozen=True)
class Trial:
    """A trial: times (s) and forces (N) that were measured; times, lengths (m) and rates (m/s) to follow."""

    measured_time: np.ndarray
    measured_force: np.ndarray
    time: np.ndarray
    length: np.ndarray
    rate: np.ndarray


def columns(path: Path) -> np.ndarray:
    """Rows of two numbers behind the line of column names."""
    rows = path.read_text("utf-8").split("endheader")[1].split()[2:]
    return np.array(rows, dtype=float).reshape(-1, 2)


@cache
def trial(number: int) -> Trial:
    """A trial, its displacement a smooth curve through the samples."""
    folder = recorded("rat_soleus")
    moved, force = columns(folder / "displacement.dat"), columns(folder / f"force_trial{number}.dat")
    time = np.union1d(moved[:, 0], force[:, 0])
    length, rate = Course(moved[:, 0], START + TRIALS[number] * moved[:, 1], smooth=True).at(time)
    return Trial(force[:, 0], force[:, 1], time, length, rate)


def run(bench: MuscleBench, number: int) -> BenchRecord:
    """The muscle in a trial: tendon slack, not activated, then fully excited from the start on."""
    given = trial(number)
    return bench.run(given.time, given.length, 1.0, given.rate, initial="file")


def misses(bench: MuscleBench, number: int) -> np.ndarray:
    """Computed minus measured force over the isometric force, at the measured samples."""
    given, record = trial(number), run(bench, number)
    return (np.interp(given.measured_time, record.time, record.force) - given.measured_force) / ISOMETRIC


def error(bench: MuscleBench, number: int) -> float:
    """Mean absolute error over the isometric force."""
    return float(np.abs(misses(bench, number)).mean())


def error_over_time(bench: MuscleBench, number: int) -> float:
    """The same, each sample weighted with the time that it stands for."""
    time = trial(number).measured_time
    return float(np.sum(np.gradient(time) * np.abs(misses(bench, number))) / np.sum(np.gradient(time)))


def fit(limb: Limb, start: dict[str, float], evaluations: int = 30, free: Free = FREE) -> dict[str, float]:
    """Values at the free places that fit trials 1 and 5 best, each trial with equal weight.

    The loss grows linearly for great misses, as the mean absolute error does.
    """
    bench = MuscleBench(limb, "soleus")
    lowest = np.log([low for _, low, _ in free.values()])
    highest = np.log([high for _, _, high in free.values()])

    def limb_of(logarithms: np.ndarray) -> Limb:
        return with_values(limb, dict(zip(free, np.exp(logarithms).tolist(), strict=True)))

    def residuals(logarithms: np.ndarray) -> np.ndarray:
        bench.adopt(limb_of(logarithms))
        return np.concatenate([8.0 * m / math.sqrt(m.size) for m in (misses(bench, n) for n in FITTED_TO)])

    found = least_squares(
        residuals,
        np.log([start[place] for place in free]),
        bounds=(lowest, highest),
        loss="soft_l1",
        f_scale=0.02,
        x_scale=0.1,
        diff_step=1e-5,
        max_nfev=evaluations,
    )
    return dict(zip(free, np.exp(found.x).tolist(), strict=True))


if __name__ == "__main__":
    for file, free in (LIMB, FREE), (SHIPPED, FREE_SHIPPED):
        soleus = load_limb(file)
        values = fit(soleus, {place: start for place, (start, _, _) in free.items()}, 60, free)
        print(file.parent.name)
        for place, value in values.items():
            print(f"{place:45} {value:.5g}")
        bench = MuscleBench(with_values(soleus, values), "soleus")
        for number in TRIALS:
            by_sample, by_time = 100 * error(bench, number), 100 * error_over_time(bench, number)
            print(f"trial {number}: {by_sample:.2f} %, by time {by_time:.2f} %")
