"""The curves of `limb curves`: published numbers, units, who shares a curve, and the picture."""

import math
from pathlib import Path

import numpy as np
import pytest

from limb_nodes.analysis.curves import characteristics
from limb_nodes.analysis.curves.picture import shortened
from limb_nodes.cli import main
from limb_nodes.model import load_limb, with_values

ROOT = Path(__file__).parents[2]
ALTERNATIVES = ROOT / "tests" / "levels" / "alternatives.yaml"


def panels(limb) -> dict:
    return {panel.name: panel for panel in characteristics(limb)}


@pytest.fixture(scope="module")
def reference():
    return panels(load_limb(ROOT / "params" / "reference_joint_tendon.yaml"))


@pytest.fixture(scope="module")
def alternatives():
    return panels(load_limb(ALTERNATIVES))


def at(panel, x: float, curve: int = 0) -> float:
    """A curve's value at x."""
    return float(np.interp(x, panel.curves[curve].x, panel.curves[curve].y))


# The report's figure 2.2, psoas: F_S_max = 9.7778e-13 N, V_max = 2.29817e-6 m/s.
@pytest.mark.parametrize(
    ("velocity", "force"), [(-0.1, 1.1520), (0.0, 1.0), (0.1, 0.6690), (0.3, 0.2693), (0.5, 0.1274)]
)
def test_force_velocity(reference, velocity, force):
    panel = reference["force_velocity"]
    assert (panel.x.unit, panel.y.unit, panel.figure) == ("m/s", "N", "fig. 2.2")
    assert at(panel, velocity * 2.29817e-6) / 9.7778e-13 == pytest.approx(force, abs=2e-3)
    assert panel.curves[0].x[-1] == pytest.approx(2.3e-6, rel=0.06)


def test_force_length_and_frequency(reference):
    assert at(reference["force_length"], 1.0) == pytest.approx(1.0)
    # exp(-|1/1.12|^1.61) at the shortest length (2.22, slow).
    assert at(reference["force_length"], 0.0) == pytest.approx(math.exp(-((1 / 1.12) ** 1.61)))
    panel = reference["force_frequency"]
    assert panel.x.unit == "Hz"
    assert [at(panel, f) for f in (5.0, 10.0, 15.0)] == pytest.approx([0.0, 0.5, 1.0], abs=1e-9)
    assert at(reference["passive_force"], 1.6) == pytest.approx((0.4 / 0.8) ** 2, abs=1e-3)


def test_tendon_at_rest(reference):
    panel = reference["tendon"]
    # 1e5 N/m up to the muscle's 97.8 N.
    assert panel.curves[0].y[-1] == pytest.approx(97.778, rel=1e-4)
    assert panel.curves[0].x[-1] == pytest.approx(97.778e-5, rel=1e-4)


def test_path_and_moment_arm(reference):
    # At zero angle sqrt(r^2 + d^2) on both sides of the joint.
    assert at(reference["path"], 0.0) == pytest.approx(math.hypot(0.0215, 0.1) + math.hypot(0.0215, 0.03), rel=1e-6)
    assert set(reference["moment_arm"].curves[0].y) == {0.0215}


def test_equal_laws_share_a_curve(reference):
    assert [curve.label for curve in reference["tendon"].curves] == ["flexor, extensor"]
    assert [curve.label for curve in reference["moment_arm"].curves] == ["flexor, extensor"]
    assert [curve.label for curve in reference["path"].curves] == ["flexor", "extensor"]
    assert [curve.label for curve in reference["force_velocity"].curves] == ["psoas"]
    assert [curve.label for curve in reference["recruitment"].curves] == ["flexor, extensor"]


def test_silent_units_are_not_drawn(reference):
    curve = reference["recruitment"].curves[0]
    drawn = ~np.isnan(curve.y)
    assert curve.x[drawn][0] == pytest.approx(0.8, abs=3e-3)
    assert curve.y[drawn][[0, -1]] == pytest.approx([5.0, 15.0], abs=0.2)


def test_what_a_limb_lacks_has_no_panel(reference, alternatives):
    assert "pennation" not in reference
    assert "activation_dynamics" not in reference
    assert {"pennation", "activation_dynamics"} <= set(alternatives)


def test_states_are_settled(alternatives):
    panel = alternatives["force_velocity"]
    assert panel.laws == ["hill", "huxley"]
    bridges = next(i for i, curve in enumerate(panel.curves) if "huxley" in curve.label)
    assert at(panel, 0.0, bridges) == pytest.approx(9.7778e-13, rel=0.03)
    # Huxley 1957: 0.347 of the isometric force at phi, here (f_1 + g_1) h = 53.3/s * 15.6 nm per sarcomere.
    assert at(panel, 53.3 * 15.6e-9, bridges) / 9.7778e-13 == pytest.approx(0.347, abs=0.04)


def test_activation_rises_and_falls(alternatives):
    panel = alternatives["activation_dynamics"]
    # Half is reached after 0.015 (2 ln 2 - 0.75) s.
    assert at(panel, 0.015 * (2 * math.log(2) - 0.75)) == pytest.approx(0.5, abs=0.03)
    assert at(panel, 0.2) > 0.99
    assert at(panel, 0.5) < 0.05


def test_length_dependent_frequencies(alternatives):
    panel = alternatives["force_frequency"]
    variants = [curve for curve in panel.curves if curve.key == panel.curves[0].key]
    assert [curve.style for curve in variants] == [0, 1, 2]
    middle = [float(np.interp(7.5, curve.x, curve.y)) for curve in variants]
    assert middle[1] < middle[0] < middle[2]
    assert middle[0] == pytest.approx(0.509, abs=2e-3)


def test_pennation_by_muscle_length(alternatives):
    curve = alternatives["pennation"].curves[0]
    assert curve.y == pytest.approx(np.arctan2(0.03, curve.x), rel=1e-9)


def test_one_curve_per_kind_of_sarcomere():
    labels = [curve.label for curve in panels(load_limb(ROOT / "params" / "arm.yaml"))["force_velocity"].curves]
    assert labels == ["slow", "fast"]


def test_law_that_never_reaches_zero():
    limb = load_limb(ROOT / "params" / "reference_joint.yaml")
    panel = panels(with_values(limb, {"sarcomeres.psoas": {"law": "constant"}}))["force_velocity"]
    assert set(panel.curves[0].y) == {9.7778e-13}


@pytest.mark.parametrize("ending", ["png", "pdf", "svg"])
def test_picture(tmp_path, ending, capsys):
    out = tmp_path / f"curves.{ending}"
    assert main(["curves", str(ROOT / "params" / "reference_joint.yaml"), "-o", str(out)]) == 0
    assert out.stat().st_size > 10_000
    said = capsys.readouterr().out
    assert "Force by velocity: derenyi_vicsek" in said
    assert said.rstrip().endswith(f"picture: {out}")


def test_svg_names_every_unit(tmp_path):
    import matplotlib

    out = tmp_path / "curves.svg"
    with matplotlib.rc_context({"svg.fonttype": "none"}):
        assert main(["curves", str(ALTERNATIVES), "-o", str(out)]) == 0
    text = out.read_text(encoding="utf-8")
    for words in ("[µm/s]", "[pN]", "[Hz]", "[1]", "[mm]", "[N]", "[°]", "[s]", "huxley", "gordon_huxley_julian"):
        assert words in text, words


@pytest.mark.parametrize(
    ("limb", "out", "words"),
    [
        ("params/arm.yaml", "curves.txt", "a name that ends in .png or .pdf or .svg is needed"),
        ("params/arm.yaml", "nowhere/curves.png", "a folder that exists is needed"),
        ("params/none.yaml", "curves.png", "no such file"),
    ],
)
def test_bad_input_is_one_line(tmp_path, capsys, limb, out, words):
    assert main(["curves", str(ROOT / limb), "-o", str(tmp_path / out)]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert words in error


def test_limb_without_muscles(tmp_path, capsys):
    bare = "name: bare\nsegments: [{name: rod, mass: 1, length: 1, com_distance: 0.5, inertia: 0.1}]\n"
    (tmp_path / "bare.yaml").write_text(bare, encoding="utf-8")
    assert main(["curves", str(tmp_path / "bare.yaml"), "-o", str(tmp_path / "x.png")]) == 2
    assert "muscles is empty" in capsys.readouterr().err


def test_a_muscle_over_two_joints_has_a_curve_for_each():
    leg = panels(load_limb(ROOT / "tests" / "levels" / "two_joint_leg.yaml"))
    arms = {curve.label: curve for curve in leg["moment_arm"].curves}
    hip, knee = arms["hamstrings, hip"], arms["hamstrings, knee"]
    assert set(hip.y) == {-0.06}
    assert set(knee.y) == {-0.035}
    assert (hip.key, hip.style, knee.key, knee.style) == ("hamstrings", 0, "hamstrings", 1)
    assert (hip.x[0], hip.x[-1], knee.x[0], knee.x[-1]) == (-1.5, 2.0, -2.4, 0.2)
    path = {curve.label: curve for curve in leg["path"].curves}["hamstrings, knee"]
    # The hip stays at 0.3 rad, as at the start.
    assert np.interp(-0.5, path.x, path.y) == pytest.approx(0.44, abs=1e-12)


def test_long_labels_are_shortened():
    assert shortened("flexor, extensor") == "flexor, extensor"
    two = "a_muscle_with_a_very_long_name_indeed, a_joint"
    assert shortened(two) == two
    many = ", ".join(f"muscle_number_{k}" for k in range(5))
    assert shortened(many) == "muscle_number_0, muscle_number_1, 3 more"
