"""`limb scale`: the limb of a smaller or taller person is the same limb in other units of length, mass and force."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from limb_nodes import cli
from limb_nodes.model import load_limb
from limb_nodes.model.load import parse_limb
from limb_nodes.model.scale import factors_between, scaled_text
from limb_nodes.solve.whole import WholeModel

ROOT = Path(__file__).resolve().parents[2]
PERSON = "person: {mass: 75.0, height: 1.75}\n"
TISSUE = """    tissue:
      - {law: linear, stiffness: 2.0, damping: 0.5, rest_angle: 0.2}
      - {law: exponential, upper_angle: 1.2, upper_growth: 8.0, lower_angle: -0.2, lower_growth: 5.0}
      - {law: upper_stop, stop_angle: 1.0, stiffness: 200.0}
"""


def texts() -> dict[str, str]:
    """Limbs of all kinds of paths, with pennation and tissue."""
    found = {name: (ROOT / "params" / f"{name}.yaml").read_text() for name in ("seated_knee", "arm", "pennate_leg")}
    found["two_joints"] = PERSON + (ROOT / "tests/levels/two_joint_leg.yaml").read_text()
    found["defaults"] = PERSON + (ROOT / "tests/levels/alternatives.yaml").read_text()
    joint = (ROOT / "params/reference_joint_tendon.yaml").read_text()
    place = "    angle: 0.5235987755982988"
    assert joint.count(place) == 1
    found["tissue"] = PERSON + joint.replace(place, TISSUE + place)
    return found


def shown(limb, angle: float) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """What muscles and units show, and the accelerations, at once after the start, all joints turned by an angle."""
    model = WholeModel(limb)
    given = np.full((2, len(limb.muscles)), 0.7)
    found = model.simulate(given, 1000.0)
    return {**found.muscle, **found.unit}, found.acceleration


@pytest.mark.parametrize("name", texts())
def test_the_same_limb_in_other_units(name):
    """Lengths, forces and torques at the start in proportion; what has no unit stays."""
    limb = parse_limb(texts()[name], name)
    smaller = parse_limb(scaled_text(limb, factors_between(limb, 60.0, 1.6)), name)
    factors = factors_between(limb, 60.0, 1.6)
    assert (factors.length, factors.mass) == pytest.approx((1.6 / 1.75, 0.8))
    assert factors.force == pytest.approx(0.8 ** (2 / 3))
    (before, _), (after, _) = shown(limb, 0.1), shown(smaller, 0.1)
    powers = {
        "muscle_tendon_length": (1, 0), "muscle_length": (1, 0), "fibre_length": (1, 0), "tendon_length": (1, 0),
        "total_fibre_force": (0, 1), "muscle_force": (0, 1), "muscle_torque": (1, 1), "moment_arm": (1, 0),
        "pennation_angle": (0, 0), "fibre_length_norm": (0, 0), "activation": (0, 0),
    }  # fmt: skip
    for quantity, (length, force) in powers.items():
        wanted = before[quantity][0] * factors.of(length, 0, force)
        np.testing.assert_allclose(after[quantity][0], wanted, rtol=2e-4, atol=1e-9 + 2e-4 * np.abs(wanted).max())


def test_tissue_gives_moments_in_proportion():
    limb = parse_limb(texts()["tissue"], "tissue")
    other = parse_limb(scaled_text(limb, factors_between(limb, 100.0, 1.9)), "tissue")
    factors = factors_between(limb, 100.0, 1.9)
    for one, new in zip(limb.segments[0].tissue, other.segments[0].tissue, strict=True):
        for angle, velocity in (0.9, 0.0), (1.1, 0.3), (-0.1, -0.2):
            before = one.law.equations[-1].function(angle, velocity, *one.values.values())
            after = new.law.equations[-1].function(angle, velocity, *new.values.values())
            assert after == pytest.approx(before * factors.of(1, 0, 1), rel=1e-4, abs=1e-9)


@pytest.mark.parametrize("name", texts())
def test_there_and_back(name):
    limb = parse_limb(texts()[name], name)
    there = parse_limb(scaled_text(limb, factors_between(limb, 95.0, 1.95)), name)
    back = parse_limb(scaled_text(there, factors_between(there, 75.0, 1.75)), name)
    returned = dict(numbers(back.content))
    for place, before in numbers(limb.content):
        assert returned[place] == pytest.approx(before, rel=2e-5), place
    assert back.person == limb.person
    # Values and comments stand where they stood.
    assert [line.split(":")[0] for line in there.text.splitlines()[3:] if "#" in line] == [
        line.split(":")[0] for line in limb.text.splitlines() if "#" in line
    ]


def numbers(content, place: str = ""):
    """Every number of plain data with its place."""
    if isinstance(content, dict):
        for key in sorted(content):
            yield from numbers(content[key], f"{place}.{key}")
    elif isinstance(content, list):
        for index, one in enumerate(content):
            yield from numbers(one, f"{place}[{index}]")
    elif isinstance(content, float | int):
        yield place, content


def test_the_command(tmp_path, capsys):
    out = tmp_path / "small.yaml"
    assert cli.main(["scale", str(ROOT / "params/seated_knee.yaml"), "--mass", "60", "-o", str(out)]) == 0
    printed = capsys.readouterr().out
    assert printed.splitlines()[:3] == ["lengths    times 1", "masses     times 0.8", "forces     times 0.8618"]
    assert load_limb(out).person.mass == 60.0
    assert load_limb(out).segments[0].mass == pytest.approx(0.8 * 4.575)
    assert "gait2392" in out.read_text()


REFUSED = {
    "a giant": (("--height", "5"), "--height is 5; a number >= 0.4 and <= 2.6 in m is needed"),
    "a whale": (("--mass", "1000"), "--mass is 1000; a number >= 2 and <= 400 in kg is needed"),
    "nobody": (("--mass", "20", "--height", "2.2"), "a body mass index of 4.13 kg/m^2; one from 8 to 100 is needed"),
    "nothing": ((), "--mass is missing, and height too; one of them or both are needed"),
    "not a number": (("--mass", "nan"), "--mass is nan; a number"),
}


@pytest.mark.parametrize(("options", "said"), REFUSED.values(), ids=REFUSED)
def test_refused(options, said, tmp_path, capsys):
    out = tmp_path / "out.yaml"
    assert cli.main(["scale", str(ROOT / "params/arm.yaml"), *options, "-o", str(out)]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert not out.exists()


def test_whose_limb_it_is_must_be_known(tmp_path, capsys):
    given = ["scale", str(ROOT / "params/reference_joint.yaml"), "--mass", "60", "-o", str(tmp_path / "out.yaml")]
    assert cli.main(given) == 2
    assert "reference_joint.yaml: person is missing; whose limb it is" in capsys.readouterr().err
    existing = tmp_path / "there.yaml"
    existing.write_text("kept")
    assert cli.main(["scale", str(ROOT / "params/arm.yaml"), "--mass", "60", "-o", str(existing)]) == 2
    assert "exists; the name of a new file is needed" in capsys.readouterr().err
    assert existing.read_text() == "kept"


def test_what_a_merge_shares_is_scaled_once():
    """Also a default that is written down for a section which has no key of its own."""
    text = texts()["defaults"]
    tendon = "    tendon: {law: toe_region, slack_length: 0.03, maximum_force: 100.0}\n"
    assert text.count(tendon) == 2
    first = tendon.replace("tendon: {", "tendon: &tendon {")
    shared = text.replace(tendon, first, 1).replace(tendon, "    tendon: {<<: *tendon}\n", 1)
    limb, plain = parse_limb(shared, "shared"), parse_limb(text, "plain")
    factors = factors_between(limb, 60.0, 1.6)
    one, other = (parse_limb(scaled_text(limb, factors), limb.file) for limb in (limb, plain))
    for muscle, wanted in zip(one.muscles, other.muscles, strict=True):
        assert muscle.laws["tendon"].values == wanted.laws["tendon"].values
    assert one.muscles[0].laws["tendon"].values["damping"] == pytest.approx(1e4 * factors.of(-1, 0, 1), rel=1e-5)
