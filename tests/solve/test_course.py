"""A movement that is solved in parts is the one solved at once, to the last bit; a failure says where and why."""

import dataclasses

import numpy as np
import pytest

from limb_nodes.model import load_limb
from limb_nodes.solve import whole
from limb_nodes.solve.failure import SolveError
from limb_nodes.solve.whole import WholeModel
from tests.solve.broken_limb import write_broken_limb

LIMBS = ["reference_joint", "reference_joint_tendon", "seated_knee", "arm", "pennate_leg"]


def bursts(model, count: int, rate: float) -> np.ndarray:
    """Sines that start and stop at once, so that there are corners."""
    time = np.arange(count) / rate
    columns = [
        np.clip(np.sin((3.0 + m) * time + m), 0.0, 1.0) * (time % 0.7 > 0.2) for m in range(len(model.limb.muscles))
    ]
    return np.stack(columns, axis=1)


def flat(movement) -> dict[str, np.ndarray]:
    """Every array of a movement by name."""
    fields = {field.name: getattr(movement, field.name) for field in dataclasses.fields(movement)}
    parts = {f"{kind}.{name}": values for kind in ("muscle", "unit") for name, values in fields.pop(kind).items()}
    del fields["state_names"], fields["steps"]
    return fields | parts


@pytest.mark.parametrize("name", LIMBS)
@pytest.mark.parametrize("method", ["explicit", "implicit"])
@pytest.mark.parametrize(("rate", "longest"), [(1000.0, 1), (120.0, 50)])
def test_parts_are_the_whole(name, method, rate, longest, model_named, monkeypatch):
    model = model_named(name)
    excitation = bursts(model, round(2.2 * rate), rate)
    at_once = model.simulate(excitation, rate, method=method)
    monkeypatch.setattr(whole, "LONGEST_PART", longest)
    parts = list(model.simulate_in_parts(excitation, rate, method=method))
    assert len(parts) > 3
    assert parts[-1].steps == at_once.steps
    for key, values in flat(at_once).items():
        np.testing.assert_array_equal(np.concatenate([flat(part)[key] for part in parts]), values, err_msg=key)


@pytest.mark.parametrize("count", [1, 2, 3, 8])
def test_short_inputs(count, model_named):
    model = model_named("reference_joint")
    excitation = np.full((count, 2), 0.3)
    (part,) = model.simulate_in_parts(excitation, 1000.0)
    np.testing.assert_array_equal(part.angle, model.simulate(excitation, 1000.0).angle)
    assert len(part.time) == count


def test_a_long_input_takes_its_drives_from_the_table_in_every_part(model_named, monkeypatch):
    model = model_named("arm")
    excitation = bursts(model, 2500, 1000.0)
    assert len(excitation) >= model.table_pays
    monkeypatch.setattr(whole, "LONGEST_PART", 500)
    found = np.concatenate([part.angle for part in model.simulate_in_parts(excitation, 1000.0)])
    np.testing.assert_array_equal(found, model.simulate(excitation, 1000.0).angle)


@pytest.mark.parametrize("method", ["explicit", "implicit"])
def test_a_law_that_breaks_off_is_named_with_time_and_place(method, tmp_path):
    model = WholeModel(load_limb(write_broken_limb(tmp_path, 1.24), allow_laws=True))
    excitation = np.tile([0.9, 0.0], (2001, 1))
    parts = []
    with pytest.raises(SolveError) as caught:
        parts.extend(model.simulate_in_parts(excitation, 1000.0, method=method))
    line = str(caught.value)
    assert "a rate is not a finite number: muscle flexor, unit unit, law breaks_off:breaks_off of force_length" in line
    assert "force_length_factor is nan at fibre_length_norm 1.24" in line
    assert 0.0 < parts[-1].time[-1] < 1.0
    np.testing.assert_array_less(parts[-1].unit["fibre_length_norm"][:, 0], 1.24)
    with pytest.raises(SolveError, match=r"stops at 0\.\d+ s"):
        model.simulate(excitation, 1000.0, method=method)
