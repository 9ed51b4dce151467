"""Reading limbs: what is in params/, what has defaults, and every way to get it wrong."""

import copy
import math
import re
from pathlib import Path

import pytest
from ruamel.yaml import YAML

from limb_nodes.errors import UserError
from limb_nodes.model import load_limb, parse_limb, with_values
from limb_nodes.model.load import build_limb

PARAMS = Path(__file__).parents[2] / "params"
LIMBS = sorted(path for path in PARAMS.glob("*.yaml") if "\nsegments:" in path.read_text())

BASE = """
name: small
segments:
  - {name: upper, joint: shoulder, mass: 2.0, length: 0.3, com_distance: 0.15, inertia: 0.02, range: [-1.0, 1.5]}
  - {name: lower, joint: elbow, mass: 1.0, length: 0.3, com_distance: 0.15, inertia: 0.02}
sarcomeres:
  psoas: {law: derenyi_vicsek, atp: 3.0e-3}
unit_kinds:
  slow:
    sarcomere: psoas
    series_sarcomeres: 40000
    parallel_sarcomeres: 1.0e+14
    minimum_frequency: 5.0
    maximum_frequency: 15.0
    pcsa: 1.0e-4
    maximum_passive_force: 30.0
    force_length: {law: cheng, omega: 1.12}
muscles:
  - name: flexor
    joint: elbow
    role: flexor
    activation_threshold: 0.5
    path: {moment_arm: 0.02, proximal_distance: 0.1, distal_distance: 0.03}
    tendon: {law: voigt, stiffness: 1.0e+5, slack_length: 0.03}
    aponeurosis: {law: constant_area, area: 2.0e-4, stiffness: 4.0e+7, slack_length: 0.02}
    units:
      - {kind: slow, name: first}
      - {kind: slow, name: second, count: 2}
  - name: extensor
    joint: shoulder
    role: extensor
    path: {law: constant_moment_arm, moment_arm: 0.02, proximal_distance: 0.1, distal_distance: 0.03}
    units:
      - {kind: slow}
"""
GONE = object()


def content(changes: dict | None = None):
    """BASE with other values at places such as ("muscles", 0, "name")."""
    made = YAML(typ="safe", pure=True).load(BASE)
    for place, value in (changes or {}).items():
        target = made
        for step in place[:-1]:
            target = target[step]
        if value is GONE:
            del target[place[-1]]
        else:
            target[place[-1]] = value
    return made


def refusal(made) -> str:
    with pytest.raises(UserError) as caught:
        build_limb(made, "small.yaml", "")
    return one_line(caught.value)


def one_line(error: UserError) -> str:
    text = str(error)
    assert "\n" not in text
    assert len(text) < 500
    return text


def test_the_base_is_good():
    limb = build_limb(content(), "small.yaml", BASE)
    assert limb == parse_limb(BASE, "small.yaml")
    assert limb.joint_names == ["shoulder", "elbow"]
    assert limb.muscle_names == ["flexor", "extensor"]
    assert [unit.name for unit in limb.muscles[0].units] == ["first", "second_1", "second_2"]
    assert limb.muscles[0].joints == (1,)
    assert (limb.muscles[0].role, limb.muscles[1].role) == (1.0, -1.0)
    assert limb.segments[0].joint_range == (-1.0, 1.5)
    assert limb.segments[1].joint_range is None
    # What is not given: hangs down, weighs, has no tendon and no aponeurosis, and starts at slack length.
    assert limb.gravity == (0.0, -9.81)
    assert limb.base_angle == -math.pi / 2
    assert limb.muscles[1].laws["tendon"].law.name == "rigid"
    assert limb.muscles[1].laws["aponeurosis"].law.name == "none"
    assert limb.muscles[0].laws["tendon"].values["length"] == 0.03
    # Thresholds by area in the order of recruitment.
    assert [unit.values["unit_threshold"] for unit in limb.muscles[0].units] == pytest.approx([0.5 / 3, 1 / 3, 0.5])


def test_the_order_of_recruitment_can_be_given():
    made = content(
        {("muscles", 0, "units"): [{"kind": "slow", "name": n, "order": o} for n, o in (("b", 2), ("a", 1))]}
    )
    assert [unit.name for unit in build_limb(made, "small.yaml", "").muscles[0].units] == ["a", "b"]


SEGMENT, MUSCLE, UNIT = ("segments", 1), ("muscles", 0), ("muscles", 0, "units", 0)
KIND, SARCOMERE = ("unit_kinds", "slow"), ("sarcomeres", "psoas")
TENDON, PATH = (*MUSCLE, "tendon"), (*MUSCLE, "path")

# Changes to BASE, then what the line must name: place, value, allowed.
CASES = {
    # Keys that nobody knows, at each depth.
    "key of the limb": ({("colour",): "red"}, "colour", "", "gravity"),
    "key of a segment": ({(*SEGMENT, "weight"): 1}, "segments[1].weight", "", "mass"),
    "key of a muscle": ({(*MUSCLE, "tendons"): {}}, "muscles[0].tendons", "", "tendon"),
    "key of a tendon": ({(*TENDON, "stifness"): 1}, "muscles[0].tendon.stifness", "", "stiffness"),
    "key of a path": ({(*PATH, "arm"): 1}, "muscles[0].path.arm", "", "moment_arm"),
    "key of a unit": ({(*UNIT, "size"): 1}, "muscles[0].units[0].size", "", "pcsa"),
    "key of a unit kind": ({(*KIND, "size"): 1}, "unit_kinds.slow.size", "", "pcsa"),
    "key of a law in a kind": ({(*KIND, "force_length", "tau"): 1}, "unit_kinds.slow.force_length.tau", "", "omega"),
    "key of a sarcomere": ({(*SARCOMERE, "k"): 1}, "sarcomeres.psoas.k", "", "atp"),
    "key of another law": (
        {(*MUSCLE, "tendon"): {"law": "rigid", "stiffness": 1}},
        "muscles[0].tendon.stiffness",
        "",
        "slack_length",
    ),
    # Keys that are missing.
    "no segments": ({("segments",): GONE}, "segments", "is missing", "a list"),
    "segments empty": ({("segments",): []}, "segments", "[]", "a list"),
    "no name": ({("name",): GONE}, "name", "is missing", "text"),
    "no mass": ({(*SEGMENT, "mass"): GONE}, "segments[1].mass", "is missing", "> 0"),
    "empty mass": ({(*SEGMENT, "mass"): None}, "segments[1].mass", "is missing", "> 0"),
    "no joint": ({(*MUSCLE, "joint"): GONE}, "muscles[0].joint", "is missing", "shoulder, elbow"),
    "no role": ({(*MUSCLE, "role"): GONE}, "muscles[0].role", "is missing", "flexor, extensor"),
    "no path": ({(*MUSCLE, "path"): GONE}, "muscles[0].path.moment_arm", "is missing", "in m"),
    "no units": ({(*MUSCLE, "units"): GONE}, "muscles[0].units", "is missing", "list"),
    "no area": ({(*KIND, "pcsa"): GONE}, "muscles[0].units[0].pcsa", "is missing", "> 0"),
    "no slack length": ({(*TENDON, "slack_length"): GONE}, "muscles[0].tendon.slack_length", "is missing", "in m"),
    # Types.
    "mass as text": ({(*SEGMENT, "mass"): "heavy"}, "segments[1].mass", "'heavy'", "number > 0"),
    "mass as boolean": ({(*SEGMENT, "mass"): True}, "segments[1].mass", "True", "number > 0"),
    "mass as list": ({(*SEGMENT, "mass"): [1.0]}, "segments[1].mass", "[1.0]", "number > 0"),
    "segments as mapping": ({("segments",): {"a": 1}}, "segments", "{'a': 1}", "list"),
    "segment as number": ({SEGMENT: 3}, "segments[1]", "3", "mapping"),
    "muscles as number": ({("muscles",): 3}, "muscles", "3", "list"),
    "tendon as number": ({TENDON: 3}, "muscles[0].tendon", "3", "mapping"),
    "kinds as list": ({("unit_kinds",): [1]}, "unit_kinds", "[1]", "mapping"),
    "kind as number": ({KIND: 1}, "unit_kinds.slow", "1", "mapping"),
    "gravity as number": ({("gravity",): 9.81}, "gravity", "9.81", "list of 2"),
    "gravity in space": ({("gravity",): [0, 0, -9.81]}, "gravity", "[0, 0, -9.81]", "list of 2"),
    "name as number": ({("name",): 5}, "name", "5", "text"),
    "key as number": ({(5,): 5}, "the file", "5", "texts"),
    "count not whole": ({(*UNIT, "count"): 1.5}, "muscles[0].units[0].count", "1.5", "integer"),
    # Numbers that cannot be.
    "mass negative": ({(*SEGMENT, "mass"): -1.0}, "segments[1].mass", "-1.0", "> 0"),
    "mass zero": ({(*SEGMENT, "mass"): 0}, "segments[1].mass", "0", "> 0"),
    "mass not a number": ({(*SEGMENT, "mass"): math.nan}, "segments[1].mass", "nan", "> 0"),
    "mass infinite": ({(*SEGMENT, "mass"): math.inf}, "segments[1].mass", "inf", "> 0"),
    "tip torque infinite": ({("tip_torque",): math.inf}, "tip_torque", "inf", "in N m"),
    "tip torque beyond all floats": ({("tip_torque",): 10**400}, "tip_torque", "1000", "in N m"),
    "gravity not a number": ({("gravity",): [0.0, math.nan]}, "gravity", "nan", "finite"),
    "gravity beyond all floats": ({("gravity",): [0, 10**400]}, "gravity", "1000", "finite"),
    "inertia zero": ({(*SEGMENT, "inertia"): 0.0}, "segments[1].inertia", "0.0", "> 0"),
    "length negative": ({(*SEGMENT, "length"): -0.1}, "segments[1].length", "-0.1", "> 0"),
    "area zero": ({(*KIND, "pcsa"): 0}, "unit_kinds.slow.pcsa", "0", "> 0 and < 1 in m^2"),
    "area zero in a unit": ({(*UNIT, "pcsa"): 0}, "muscles[0].units[0].pcsa", "0", "> 0"),
    "stiffness negative": ({(*TENDON, "stiffness"): -1e5}, "muscles[0].tendon.stiffness", "-100000.0", "> 0"),
    "damping zero": ({(*TENDON, "damping"): 0.0}, "muscles[0].tendon.damping", "0.0", "> 0"),
    "threshold one": ({(*MUSCLE, "activation_threshold"): 1.0}, "muscles[0].activation_threshold", "1.0", "< 1"),
    "no count": ({(*UNIT, "count"): 0}, "muscles[0].units[0].count", "0", ">= 1"),
    "no ATP": ({(*SARCOMERE, "atp"): 0.0}, "sarcomeres.psoas.atp", "0.0", "> 0"),
    # Numbers that contradict each other.
    "range reversed": ({("segments", 0, "range"): [1.5, -1.0]}, "segments[0].range", "[1.5, -1.0]", "lowest, highest"),
    "range empty": ({("segments", 0, "range"): [0.0, 0.0]}, "segments[0].range", "[0.0, 0.0]", "lowest, highest"),
    "range of one": ({("segments", 0, "range"): [0.0]}, "segments[0].range", "[0.0]", "list of 2"),
    "angle outside the range": ({("segments", 0, "angle"): 1.6}, "segments[0].angle", "1.6", "[-1.0, 1.5]"),
    "frequencies reversed": (
        {(*KIND, "maximum_frequency"): 4.0},
        "unit_kinds.slow.maximum_frequency",
        "4",
        "> minimum_frequency (5)",
    ),
    "frequencies equal": ({(*UNIT, "maximum_frequency"): 5.0}, "muscles[0].units[0].maximum_frequency", "5", "> min"),
    "actin too short": (
        {(*SARCOMERE, "actin_length"): 5e-7},
        "sarcomere",
        "1.44e-06",
        "below the optimal length 1e-06",
    ),
    "fibres too long": (
        {("muscles", 1, "units", 0, "series_sarcomeres"): 2e5},
        "muscles[1].units[0].series_sarcomeres",
        "200000",
        "of the joint are needed",
    ),
    "fibres too short": (
        {("muscles", 1, "units", 0, "series_sarcomeres"): 1e4},
        "muscles[1].units[0].series_sarcomeres",
        "10000",
        "of the joint are needed",
    ),
    "tendon longer than the path": (
        {(*TENDON, "slack_length"): 0.5},
        "muscles[0].tendon.slack_length",
        "0.5",
        "number < 0.1",
    ),
    "area larger than any triangle": (
        {(*MUSCLE, "aponeurosis", "area"): 0.01},
        "muscles[0].aponeurosis.area",
        "0.01",
        "number < 0.00",
    ),
    # Names.
    "joint that is not there": ({(*MUSCLE, "joint"): "knee"}, "muscles[0].joint", "'knee'", "shoulder, elbow"),
    "joint as list": ({(*MUSCLE, "joint"): ["elbow"]}, "muscles[0].joint", "['elbow']", "shoulder, elbow"),
    "role that is not there": ({(*MUSCLE, "role"): "bender"}, "muscles[0].role", "'bender'", "flexor, extensor"),
    "kind that is not there": ({(*UNIT, "kind"): "quick"}, "muscles[0].units[0].kind", "'quick'", "slow"),
    "joints twice": (
        {(*SEGMENT, "joint"): "shoulder"},
        "segments[1].joint",
        "'shoulder'",
        "name of its own is needed",
    ),
    "muscles twice": ({("muscles", 1, "name"): "flexor"}, "muscles[1].name", "'flexor'", "name of its own is needed"),
    "units twice": (
        {("muscles", 0, "units", 1): {"kind": "slow", "name": "first"}},
        "units[1].name",
        "'first'",
        "name of its own is needed",
    ),
    "units twice behind a count": (
        {("muscles", 0, "units"): [{"kind": "slow", "name": n, "count": c} for n, c in (("a", 3), ("b", 1), ("b", 1))]},
        "muscles[0].units[2].name",
        "'b'",
        "name of its own is needed",
    ),
    # Laws.
    "law that is not there": ({(*TENDON, "law"): "maxwell"}, "muscles[0].tendon.law", "'maxwell'", "rigid"),
    "law of a sarcomere that is not there": (
        {(*SARCOMERE, "law"): "hil"},
        "sarcomeres.psoas.law",
        "'hil'",
        "derenyi_vicsek",
    ),
    "sarcomere that is not there": ({(*KIND, "sarcomere"): "soas"}, "sarcomere.law", "'soas'", "derenyi_vicsek"),
    "law as number": ({(*TENDON, "law"): 3}, "muscles[0].tendon.law", "3", "text"),
    "module that is not there": (
        {(*TENDON, "law"): "no_such:law"},
        "muscles[0].tendon.law",
        "'no_such:law'",
        "imported",
    ),
    "module without the law": ({(*TENDON, "law"): "math:pi"}, "muscles[0].tendon.law", "'math:pi'", "a law is needed"),
    "module without a name": ({(*TENDON, "law"): ":x"}, "muscles[0].tendon.law", "':x'", "imported"),
    "law of another process": (
        {(*TENDON, "law"): "limb_nodes.levels.motor_unit.force_length:cheng"},
        "muscles[0].tendon.law",
        "force_length:cheng",
        "a law of tendon is needed",
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_bad_value(case):
    changes, place, value, allowed = CASES[case]
    line = refusal(content(changes))
    assert line.startswith("small.yaml: ")
    rest = line.removeprefix("small.yaml: ")
    assert place in rest.split(" ")[0] or rest.startswith(place)
    assert value in rest
    assert allowed in rest


def test_a_law_of_ones_own_beside_the_limb(tmp_path):
    (tmp_path / "my_tendon.py").write_text(
        "from limb_nodes.levels import Parameter, State, Law, equation\n"
        "@equation('own', 'tendon_velocity')\n"
        "def velocity(tendon_force, tendon_length, rest):\n"
        "    return -1e-4 * tendon_force - 10.0 * (tendon_length - rest)\n"
        "soft = Law('tendon', 'soft', (velocity,), (Parameter('rest', 'm', 'length', above=0.0),),\n"
        "    (State('tendon_length', 'tendon_velocity', 'own', 'rest', 0.01, 'm'),))\n"
        "raise_later = 3\n"
    )
    (tmp_path / "broken_law.py").write_text("x = 1/0\n")
    (tmp_path / "unmarked_law.py").write_text(
        "from limb_nodes.levels import Law\ndef velocity(): return 0.0\nsoft = Law('tendon', 'soft', (velocity,))\n"
    )
    file = tmp_path / "limb.yaml"
    file.write_text(
        BASE.replace("{law: voigt, stiffness: 1.0e+5, slack_length: 0.03}", "{law: 'my_tendon:soft', rest: 0.03}")
    )
    assert load_limb(file, allow_laws=True).muscles[0].laws["tendon"].values == {"rest": 0.03}
    file.write_text(BASE.replace("law: voigt", "law: 'broken_law:soft'"))
    with pytest.raises(UserError, match="cannot be imported: division by zero"):
        load_limb(file, allow_laws=True)
    file.write_text(BASE.replace("law: voigt", "law: 'unmarked_law:soft'"))
    with pytest.raises(UserError, match="cannot be imported: velocity is not marked; @equation is needed"):
        load_limb(file, allow_laws=True)


NO_YAML = {
    "empty": ("", "mapping"),
    "comment only": ("# nothing\n", "mapping"),
    "text": ("just words\n", "mapping"),
    "list": ("- a\n- b\n", "mapping"),
    "open bracket": ("name: [1, 2\n", "line 2: not YAML"),
    "tab": ("name: a\n\tsegments: []\n", "line 2: not YAML"),
    "key twice": ("name: a\ngravity: [0, 0]\nname: b\n", "line 3: not YAML"),
    "key twice, deeper": ("segments:\n  - {name: a,\n     mass: 1, mass: 2}\n", "line 3: not YAML"),
    "two documents": ("name: a\n---\nname: b\n", "not YAML"),
    "object": ("name: !!python/object/apply:os.system ['true']\n", "not YAML"),
    "date that is none": ("name: 2020-13-45\n", "small.yaml"),
    "number that is none": ("name: !!int abc\n", "small.yaml"),
    "list as key": ("[a, b]: 1\n", "small.yaml"),
    "control character": ("name: \x07\n", "not YAML"),
    "alias of nothing": ("name: *other\n", "line 1: not YAML"),
}


@pytest.mark.parametrize("case", NO_YAML)
def test_no_yaml(case):
    text, part = NO_YAML[case]
    with pytest.raises(UserError) as caught:
        parse_limb(text, "small.yaml")
    assert one_line(caught.value).startswith("small.yaml")
    assert part in str(caught.value)


def test_files_that_cannot_be_read(tmp_path):
    missing = tmp_path / "missing.yaml"
    with pytest.raises(UserError, match=re.escape(f"{missing}: no such file")):
        load_limb(missing)
    binary = tmp_path / "binary.yaml"
    binary.write_bytes(b"name: \xff\xfe\n")
    for path, part in ((tmp_path, ": cannot be read"), (binary, ", line 1: is not UTF-8")):
        with pytest.raises(UserError) as caught:
            load_limb(path)
        assert one_line(caught.value).startswith(f"{path}{part}")


class TestWithValues:
    def test_other_values_and_nothing_else(self):
        limb = parse_limb(BASE, "small.yaml")
        before = copy.deepcopy(limb.content)
        made = with_values(limb, {"muscles[0].tendon.stiffness": 2e5, "gravity": [0.0, -1.1], "segments[1].angle": 0.2})
        assert made.muscles[0].laws["tendon"].values["stiffness"] == 2e5
        assert made.gravity == (0.0, -1.1)
        assert made.segments[1].angle == 0.2
        assert made.segments[0] == limb.segments[0]
        assert limb.content == before
        assert limb.gravity == (0.0, -9.81)

    def test_a_place_that_is_not_in_the_file_is_added(self):
        limb = parse_limb(BASE, "small.yaml")
        made = with_values(limb, {"muscles[1].tendon.law": "voigt", "muscles[1].tendon.slack_length": 0.02})
        assert made.muscles[1].laws["tendon"].values["slack_length"] == 0.02
        assert with_values(limb, {"tip_torque": 1.0}).tip_torque == 1.0

    @pytest.mark.parametrize(
        ("place", "value", "part"),
        [
            ("segments[0].mass", -1.0, "segments[0].mass is -1.0"),
            ("segments[0].weight", 1.0, "segments[0].weight"),
            ("segments[7].mass", 1.0, "segments[7].mass is not a place"),
            ("name.first", 1.0, "name.first is not a place"),
            ("", 1.0, "is not a place"),
            ("muscles[0].units[0].pcsa", math.nan, "muscles[0].units[0].pcsa is nan"),
        ],
    )
    def test_bad_places_and_values(self, place, value, part):
        with pytest.raises(UserError) as caught:
            with_values(parse_limb(BASE, "small.yaml"), {place: value})
        assert part in one_line(caught.value)

    def test_one_of_two_that_share_an_anchor(self):
        text = BASE.replace("tendon: {law", "tendon: &t {law").replace(
            "role: extensor", "role: extensor\n    tendon: *t"
        )
        made = with_values(parse_limb(text, "small.yaml"), {"muscles[1].tendon.stiffness": 2e5})
        assert made.muscles[1].laws["tendon"].values["stiffness"] == 2e5
        assert made.muscles[0].laws["tendon"].values["stiffness"] == 1e5


@pytest.mark.parametrize("path", LIMBS, ids=lambda path: path.stem)
class TestParams:
    def test_loads(self, path):
        limb = load_limb(path)
        assert limb.name == path.stem
        assert limb.muscles
        assert parse_limb(limb.text, "again") == limb

    def test_recruitment_ends_at_the_muscles_threshold(self, path):
        for muscle in load_limb(path).muscles:
            thresholds = [unit.values["unit_threshold"] for unit in muscle.units]
            assert thresholds == sorted(thresholds)
            assert thresholds[-1] == pytest.approx(muscle.activation_threshold)


def test_all_limbs_are_there():
    assert {"reference_joint", "reference_joint_tendon", "seated_knee", "arm", "pennate_leg"} <= {p.stem for p in LIMBS}


@pytest.mark.parametrize("path", sorted(PARAMS.glob("*.yaml")), ids=lambda path: path.stem)
def test_every_number_has_unit_and_source(path):
    """`key: number  # unit; source or the word estimate`; totals of a muscle refer to a comment of their own."""
    seen = 0
    for number, line in enumerate(path.read_text().splitlines(), 1):
        code, _, comment = line.partition("#")
        value = re.search(r":\s*[\[{]?\s*[-+.]?\d", code)
        if not value:
            continue
        seen += 1
        unit, separator, source = comment.strip().partition(";")
        where = f"{path.name}:{number}: {line.strip()}"
        assert separator, f"no '# unit; source' in {where}"
        for part in unit.split(","):
            assert re.fullmatch(r"1|[A-Za-z]+(\^2)?([ /][A-Za-z()/ ]+(\^2)?)?|1/s|1/\(M s\)", part.strip()), where
        assert re.search(r"[A-Za-z]{3}|%", source), where
    assert seen or path.stem.startswith("activation")


def test_a_limb_with_other_values_carries_them_in_its_text():
    limb = load_limb(PARAMS / "seated_knee.yaml")
    place = "muscles[0].units[0].force_length.omega"
    changed = with_values(limb, {place: 0.9})
    again = parse_limb(changed.text, "again.yaml")
    for found in (changed, again):
        ours, theirs = found.muscles[0].units[0].laws["force_length"], limb.muscles[0].units[0].laws["force_length"]
        assert ours.values == {**theirs.values, "omega": 0.9}


def test_segments_have_names_of_their_own():
    limb = load_limb(PARAMS / "arm.yaml")
    with pytest.raises(UserError, match=r"segments\[1\]\.name is '.*' a second time"):
        with_values(limb, {"segments[1].name": limb.segments[0].name})
