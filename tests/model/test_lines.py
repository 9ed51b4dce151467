"""The lines of muscles are where their path law puts them."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from limb_nodes.levels.muscle.path import muscle_tendon_length
from limb_nodes.levels.muscle.prescribed_path import prescribed
from limb_nodes.model import load_limb
from limb_nodes.model.chosen import ChosenLaw
from limb_nodes.model.lines import has_line, maximum_force, muscle_lines
from limb_nodes.model.points import point_names, points
from limb_nodes.solve.outputs import UNIT_OUTPUTS
from limb_nodes.solve.stepping import MuscleStepper

PARAMS = Path(__file__).resolve().parents[2] / "params"
LIMBS = [path for path in sorted(PARAMS.glob("*.yaml")) if "\nsegments:" in path.read_text()]


@pytest.mark.parametrize("path", LIMBS, ids=lambda path: path.stem)
def test_a_line_is_as_long_as_its_muscle_and_tendon(path):
    limb = load_limb(path)
    rng = np.random.default_rng(5)
    for _ in range(20):
        angle = rng.uniform(-2.0, 2.0, len(limb.segments)).tolist()
        lines = muscle_lines(limb, angle)
        assert list(lines) == limb.muscle_names
        for muscle in limb.muscles:
            values = muscle.laws["path"].values
            geometry = (values[name] for name in ("moment_arm", "proximal_distance", "distal_distance"))
            expected = muscle_tendon_length(angle[muscle.joints[0]], muscle.role, *geometry)
            origin, pulley, insertion = lines[muscle.name]
            assert math.dist(origin, pulley) + math.dist(pulley, insertion) == pytest.approx(expected, rel=1e-12)


def test_origin_and_insertion_lie_on_the_segments_of_the_joint():
    limb = load_limb(PARAMS / "arm.yaml")
    angle = [0.4, 0.7]
    places = dict(zip(point_names(limb), points(limb, angle), strict=True))
    for muscle in limb.muscles:
        joint = places[limb.joint_names[muscle.joints[0]]]
        after = places["tip" if muscle.joints[0] == 1 else limb.joint_names[1]]
        origin, pulley, insertion = muscle_lines(limb, angle)[muscle.name]
        values = muscle.laws["path"].values
        assert math.dist(pulley, joint) == pytest.approx(values["moment_arm"])
        along = np.subtract(after, joint) / math.dist(after, joint)
        np.testing.assert_allclose(np.subtract(insertion, joint), values["distal_distance"] * along, atol=1e-12)
        if muscle.joints[0] == 1:
            before = np.subtract(joint, places[limb.joint_names[0]])
            back = -values["proximal_distance"] * before / np.linalg.norm(before)
            np.testing.assert_allclose(np.subtract(origin, joint), back, atol=1e-12)


def test_the_pulley_is_on_the_side_to_which_the_muscle_turns_the_joint():
    limb = load_limb(PARAMS / "seated_knee.yaml")
    (angle,) = (0.5,)
    for muscle in limb.muscles:
        origin, pulley, insertion = muscle_lines(limb, [angle])[muscle.name]
        lever, pull = np.subtract(insertion, limb.base_position), np.subtract(pulley, insertion)
        assert math.copysign(1.0, lever[0] * pull[1] - lever[1] * pull[0]) == muscle.role
        assert origin != insertion


def test_a_muscle_with_a_path_of_another_kind_has_no_line():
    limb = load_limb(PARAMS / "reference_joint.yaml")
    muscle, *others = limb.muscles
    elsewhere = replace(muscle, laws={**muscle.laws, "path": ChosenLaw(prescribed, {}, "")})
    assert has_line(muscle)
    assert list(muscle_lines(replace(limb, muscles=(elsewhere, *others)), [0.0])) == [other.name for other in others]


def test_the_greatest_force_is_reached_by_all_units_at_optimal_length():
    limb = load_limb(PARAMS / "reference_joint.yaml")
    stepper = MuscleStepper(limb)
    names = [(muscle.name, number) for number, muscle in enumerate(limb.muscles)]
    active = dict.fromkeys(limb.muscle_names, 0.0)
    for angle in np.linspace(-1.5, 1.5, 301):
        _, units = stepper.observe(np.array([angle]), np.zeros(1), np.ones(len(names)))
        row = 0
        for muscle in limb.muscles:
            shown = units[row : row + len(muscle.units)]
            row += len(muscle.units)
            force = shown[:, UNIT_OUTPUTS.index("fibre_force")] - shown[:, UNIT_OUTPUTS.index("passive_force")]
            factors = shown[:, UNIT_OUTPUTS.index("force_length_factor")]
            factors = factors * shown[:, UNIT_OUTPUTS.index("force_frequency_factor")]
            active[muscle.name] = max(active[muscle.name], float((force / factors).sum()))
    for muscle in limb.muscles:
        assert maximum_force(muscle) == pytest.approx(active[muscle.name], rel=1e-9)
