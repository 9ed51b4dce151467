"""The maximal-activation benchmark on the rat soleus."""

import math

import numpy as np
import pytest

from limb_nodes.levels.sarcomere import derenyi_vicsek as dv
from limb_nodes.model import load_limb, with_values
from limb_nodes.solve.bench import MuscleBench
from tests.literature import fit_rat_soleus as benchmark


@pytest.fixture(scope="module")
def soleus():
    return load_limb(benchmark.LIMB)


@pytest.fixture(scope="module")
def bench(soleus):
    return MuscleBench(soleus, "soleus")


@pytest.mark.parametrize("number", [1, 3, 5])
def test_mean_absolute_error(bench, number):
    """At most 5 % of 1.17 N; trial 3 has not been fitted. Published, elastic tendon: 3.3 to 8.9 %."""
    assert benchmark.error(bench, number) <= 0.05
    assert benchmark.error_over_time(bench, number) <= 0.05


@pytest.mark.parametrize(("number", "most"), [(1, 0.03), (3, 0.03), (5, 0.042)])
def test_the_shipped_soleus(number, most):
    """Hill's curve, length-tension over the optimal length and a toe region; trial 3 has not been fitted."""
    shipped = MuscleBench(load_limb(benchmark.SHIPPED), "soleus")
    assert benchmark.error(shipped, number) <= most
    assert benchmark.error_over_time(shipped, number) <= most


def test_muscle_is_switched_on_at_the_start(bench):
    for number in (1, 3, 5):
        record = benchmark.run(bench, number)
        assert record.force[0] == pytest.approx(0.0, abs=1e-9)
        assert record.muscle["activation"][[0, -1]] == pytest.approx([0.0, 1.0], abs=1e-6)


def test_laws_are_the_reports(soleus):
    (muscle,) = soleus.muscles
    (unit,) = muscle.units
    assert unit.laws["sarcomere"].law.name == "derenyi_vicsek"
    assert muscle.laws["tendon"].law.name == "voigt"


def test_values_stay_near_the_published_fit(soleus):
    """Millard 2013: F_max 1.276 N, V_max 5.316 optimal lengths/s, l_opt 17.1 mm, slack 17.1 mm; here less strictly."""
    (muscle,) = soleus.muscles
    (unit,) = muscle.units
    chosen = unit.laws["sarcomere"].values
    optimal = unit.values["series_sarcomeres"] * 2 * chosen["actin_length"]
    assert optimal == pytest.approx(17.1e-3, rel=1e-3)
    force = unit.values["parallel_sarcomeres"] * chosen["power_stroke"] / chosen["binding_site_spacing"]
    assert force * chosen["attachment_force"] == pytest.approx(1.276, rel=0.05)
    k_m = dv.unhindered_michaelis_constant(chosen["adp_release_rate"], chosen["atp_binding_rate"])
    fastest = dv.maximum_sarcomere_velocity(chosen["power_stroke"] * chosen["adp_release_rate"], chosen["atp"], k_m)
    assert fastest / (2 * chosen["actin_length"]) == pytest.approx(5.316, rel=0.25)
    tendon = muscle.laws["tendon"].values
    assert tendon["slack_length"] == pytest.approx(17.1e-3, rel=0.12)
    # Strain at the isometric force; Millard's tendon: 4.9 %.
    assert 0.03 < 1.276 / tendon["stiffness"] / tendon["slack_length"] < 0.07


def test_fit_finds_its_way_back(soleus):
    """From values that are off by up to 20 %, a few evaluations lead back below 5 % on all three trials."""
    start = {}
    for (place, (_, low, high)), off in zip(benchmark.FREE.items(), (0.9, 1.2, 0.9, 1.2, 1.2, 1.04, 0.8), strict=True):
        section = soleus.content["muscles"][0]
        for key in place.removeprefix("muscles[0].").replace("[0]", ".0").split("."):
            section = section[int(key) if key.isdigit() else key]
        start[place] = float(np.clip(section * off, 1.001 * low, 0.999 * high))
    perturbed = MuscleBench(with_values(soleus, start), "soleus")
    before = max(benchmark.error(perturbed, number) for number in benchmark.TRIALS)
    assert before > 0.07
    values = benchmark.fit(soleus, start, evaluations=8)
    perturbed.adopt(with_values(soleus, values))
    errors = [benchmark.error(perturbed, number) for number in benchmark.TRIALS]
    assert max(errors) <= 0.05, errors
    assert math.isfinite(sum(values.values()))
