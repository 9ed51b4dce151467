"""A law from the user's own file: ten lines of Python, two of YAML, and a limb that runs again elsewhere."""

import math
from pathlib import Path

import numpy as np
import pytest

from limb_nodes.errors import UserError
from limb_nodes.model import load_limb
from limb_nodes.solve.whole import WholeModel

LIMB = (Path(__file__).parents[2] / "params" / "reference_joint.yaml").read_text(encoding="utf-8")
MY_LAW = '''
import math
from limb_nodes.levels import Parameter, law

@law("force_length", Parameter("width", "1", "width of the bell", 0.5, above=0.0))
def gaussian(fibre_length_norm, width):
    """Force-length factor (1): a bell around the optimal length."""
    return math.exp(-(((fibre_length_norm - 1.0) / width) ** 2))
'''
CHOICE = "    force_length:\n      law: my_law:gaussian\n"


def write(folder: Path, law: str = MY_LAW, **more: str) -> Path:
    """The reference joint with a law from beside its file."""
    start = LIMB.index("    force_length:")
    end = LIMB.index("    force_frequency:")
    folder.mkdir(exist_ok=True)
    (folder / "limb.yaml").write_text(LIMB[:start] + CHOICE + LIMB[end:], encoding="utf-8")
    (folder / "my_law.py").write_text(law, encoding="utf-8")
    for name, text in more.items():
        (folder / f"{name}.py").write_text(text, encoding="utf-8")
    return folder / "limb.yaml"


def loaded(path: Path):
    """A limb whose laws may run."""
    return load_limb(path, allow_laws=True)


def chosen(limb):
    return limb.muscles[0].units[0].laws["force_length"]


def test_law_from_a_users_file_runs(tmp_path):
    assert len(MY_LAW.strip().splitlines()) < 10
    limb = loaded(write(tmp_path))
    assert chosen(limb).values == {"width": 0.5}
    movement = WholeModel(limb).simulate(np.full((201, 2), 0.9), 200.0)
    norm = movement.unit["fibre_length_norm"]
    assert np.ptp(norm) > 0.01
    assert movement.unit["force_length_factor"] == pytest.approx(np.exp(-(((norm - 1.0) / 0.5) ** 2)), rel=1e-12)


def test_limb_loads_again_from_the_recorded_sources(tmp_path):
    limb = loaded(write(tmp_path / "one"))
    sources = limb.code.sources
    assert sources == {"my_law.py": MY_LAW}
    again = tmp_path / "again"
    again.mkdir()
    (again / "limb.yaml").write_text(limb.text, encoding="utf-8")
    for name, text in sources.items():
        (again / name).write_text(text, encoding="utf-8")
    assert chosen(loaded(again / "limb.yaml")).law(1.5, 0.5) == pytest.approx(math.exp(-1.0))


def test_modules_of_theirs_are_among_the_sources(tmp_path):
    law = "from helper import bell\n" + MY_LAW.replace(
        "math.exp(-(((fibre_length_norm - 1.0) / width) ** 2))", "bell(fibre_length_norm, width)"
    )
    helper = "import math\n\ndef bell(x, width):\n    return math.exp(-(((x - 1.0) / width) ** 2))\n"
    sources = loaded(write(tmp_path, law, helper=helper)).code.sources
    assert sources == {"helper.py": helper, "my_law.py": law}


def test_limbs_without_own_laws_have_no_sources():
    assert load_limb(Path(__file__).parents[2] / "params" / "arm.yaml").code.sources == {}


def test_two_limbs_with_modules_of_the_same_name(tmp_path):
    wide = MY_LAW.replace("** 2", "** 4")
    first, second = loaded(write(tmp_path / "one")), loaded(write(tmp_path / "two", wide))
    assert chosen(first).law(2.0, 0.5) == pytest.approx(math.exp(-4.0))
    assert chosen(second).law(2.0, 0.5) == pytest.approx(math.exp(-16.0))


def test_an_edited_law_is_read_again(tmp_path):
    path = write(tmp_path)
    before = chosen(loaded(path)).law
    assert chosen(loaded(path)).law is before
    write(tmp_path, MY_LAW.replace("** 2", "** 4"))
    assert chosen(loaded(path)).law(2.0, 0.5) == pytest.approx(math.exp(-16.0))


@pytest.mark.parametrize(
    ("law", "words"),
    [
        ("import nowhere_to_be_found\n", "it cannot be imported: No module named 'nowhere_to_be_found'"),
        ("def gaussian(:\n", "it cannot be imported: "),
        ("gaussian = 3\n", "a law is needed, which gaussian in my_law ("),
        (MY_LAW.replace("force_length", "passive_force"), "a law of passive_force; a law of force_length is needed"),
    ],
)
def test_a_broken_module_is_one_line(tmp_path, law, words):
    path = write(tmp_path, law)
    with pytest.raises(UserError) as caught:
        loaded(path)
    assert str(caught.value).startswith(f"{path}: unit_kinds.slow.force_length.law is 'my_law:gaussian'")
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_name_that_python_has_is_pythons(tmp_path):
    path = write(tmp_path, json=MY_LAW)
    path.write_text(path.read_text(encoding="utf-8").replace("my_law:", "json:"), encoding="utf-8")
    with pytest.raises(UserError, match=r"a law is needed, which gaussian in json \(.*json/__init__.py\) is not"):
        load_limb(path)
