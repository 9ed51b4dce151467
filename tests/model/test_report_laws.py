"""Laws that are not the report's are told apart."""

from __future__ import annotations

from pathlib import Path

import pytest

from limb_nodes import cli
from limb_nodes.model import load_limb
from limb_nodes.model.report_laws import other_laws

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize("name", ["reference_joint", "reference_joint_tendon", "seated_knee", "arm", "pennate_leg"])
def test_the_shipped_limbs_have_the_reports_laws(name):
    assert other_laws(load_limb(ROOT / "params" / f"{name}.yaml")) == []


def test_extensions_are_named_with_their_owners():
    leg = other_laws(load_limb(ROOT / "tests/levels/two_joint_leg.yaml"))
    assert "path straight_lines (gluteus, rectus_femoris)" in leg
    assert "tissue linear (hip, knee, ankle)" in leg
    assert not any(law.startswith("tendon") for law in leg)
    alternatives = other_laws(load_limb(ROOT / "tests/levels/alternatives.yaml"))
    assert "recruitment fuglevand (flexor, extensor)" in alternatives
    assert "sarcomere huxley (flexor, extensor)" in alternatives


def test_verify_names_them(tmp_path, capsys):
    for name in "reference_joint", "reference_joint_tendon":
        text = (ROOT / "params" / f"{name}.yaml").read_text()
        assert text.count("law: constant_moment_arm") == 2
        (tmp_path / f"{name}.yaml").write_text(text.replace("law: constant_moment_arm", "law: geometric_moment_arm"))
    cli.main(["verify", "--whole", "--case", "3.10", "--limbs", str(tmp_path)])
    assert "laws that are not the report's: path geometric_moment_arm (flexor, extensor)" in capsys.readouterr().out
    assert cli.main(["verify", "--whole", "--case", "3.10"]) == 0
    assert "laws that are not the report's: none" in capsys.readouterr().out
