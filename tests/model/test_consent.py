"""Consent to code that a limb names: what is asked for, what is remembered, and that nothing else runs."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

import pytest

from limb_nodes import cli
from limb_nodes.errors import FieldError, UserError
from limb_nodes.foundation.private import private_folder
from limb_nodes.model import load_limb, outline, with_values
from limb_nodes.model.consent import trust
from limb_nodes.model.user_code import NO_CODE, named_modules, user_code
from tests.faults.ground import LAW, limb_with


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty working folder, and a place of its own for what is trusted."""
    (tmp_path / "work").mkdir()
    monkeypatch.chdir(tmp_path / "work")
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    return tmp_path


def write(folder: Path, law: str, **files: str) -> Path:
    """A limb with a law, and files beside it."""
    folder.mkdir(exist_ok=True)
    for name, text in files.items():
        path = folder / f"{name.replace('__in__', '/')}.py"
        path.parent.mkdir(exist_ok=True)
        path.write_text(text, encoding="utf-8")
    (folder / "limb.yaml").write_text(limb_with(law), encoding="utf-8")
    return folder / "limb.yaml"


def code(limb: Path):
    """The code that a limb names."""
    return user_code({"law": limb.read_text(encoding="utf-8").split("law: '")[1].split("'")[0]}, str(limb))


def test_the_line_names_each_file_and_its_hash(place):
    limb = write(place / "a", "mine:bell", mine=f"import helper\n{LAW}", helper="x = 1\n", other="y = 2\n")
    with pytest.raises(FieldError) as refused:
        load_limb(limb)
    line = str(refused.value)
    assert line.startswith(f"{limb}: allow_laws is not given")
    assert "\n" not in line
    for name in ("mine", "helper"):
        path = place / "a" / f"{name}.py"
        assert f"{path} (sha256 {hashlib.sha256(path.read_bytes()).hexdigest()})" in line
    assert "other" not in line


def test_trust_is_in_what_the_files_hold(place):
    limb = write(place / "a", "mine:bell", mine=f"import helper\n{LAW}", helper="x = 1\n")
    trust(code(limb), str(limb))
    assert load_limb(limb).code.sources.keys() == {"helper.py", "mine.py"}
    copy = write(place / "b", "mine:bell", mine=f"import helper\n{LAW}", helper="x = 1\n")
    load_limb(copy)
    write(place / "b", "mine:bell", helper="x = 1 \n")
    for changed in (copy, write(place / "c", "his:bell", his=f"import helper\n{LAW}", helper="x = 1\n")):
        with pytest.raises(FieldError):
            load_limb(changed)


def test_what_runs_is_what_was_read(place):
    limb = write(place / "a", "mine:bell", mine=LAW)
    read = code(limb)
    (place / "a" / "mine.py").write_text("raise SystemExit('this must not run')\n")
    law = read.load("mine").bell
    assert law(1.0, 0.8) == 1.0
    # Compiled code comes from the source, which is the one that was read.
    from limb_nodes.levels.tangent import function_tree

    assert function_tree(law.equations[-1].function).name == "bell"


def test_imports_are_followed_without_running_any(place):
    stop = "raise SystemExit('this must not run')\n"
    limb = write(
        place / "a",
        "lab.mine:bell",
        lab__in____init__=f"from . import constants\n{stop}",
        lab__in__mine=f"import math, numpy\nfrom .more import *\nfrom lab import shape\ndef f(): import late\n{stop}",
        lab__in__more=f"from ..nowhere import x\n{stop}",
        lab__in__constants=stop,
        lab__in__shape="this is no Python (",
        late=stop,
        math=stop,
        numpy=stop,
        unused=stop,
    )  # fmt: skip
    assert sorted(code(limb).modules) == [
        "lab", "lab.constants", "lab.mine", "lab.more", "lab.shape", "late",
    ]  # fmt: skip


def test_values_that_name_code_ask_too(place):
    limb = load_limb(write(place / "a", "cheng", mine=LAW))
    values = {"unit_kinds.slow.force_length": {"law": "mine:bell"}}
    with pytest.raises(FieldError):
        with_values(limb, values)
    assert with_values(limb, values, allow_laws=True).code.sources == {"mine.py": LAW}


def test_an_outline_runs_nothing(place):
    text = limb_with("mine:bell")
    write(place / "work", "mine:bell", mine="raise SystemExit('this must not run')\n")
    limb = outline(text, "limb.yaml")
    assert (limb.joint_names, limb.muscle_names, limb.code) == (["joint"], ["flexor", "extensor"], NO_CODE)
    assert limb.muscles[0].laws["path"].values["moment_arm"] > 0.0


def test_names_of_modules_are_found_wherever_a_law_can_stand():
    content = {
        "name": "a:b",
        "unit_kinds": {"k": {"tendon": {"law": "one:x"}, "path": "two.py:x", "law": ["three:x", {"law": "four:x"}]}},
        "muscles": [{"sarcomere": {"law": "five:x"}, "units": [{"recruitment": "six:x"}]}],
    }
    content["again"] = content
    assert set(named_modules(content)) == {"one", "two", "four", "five", "six"}


@pytest.mark.parametrize("text", ["x" * (2**20 + 1), "\udcff"])
def test_what_can_be_no_law_is_one_line(place, text):
    limb = write(place / "a", "mine:bell", mine="")
    (place / "a" / "mine.py").write_bytes(text.encode("utf-8", "surrogateescape"))
    with pytest.raises(UserError, match=r"mine\.py: (has more than|cannot be read)"):
        load_limb(limb)


def test_shown_code_cannot_hide(place, capsys):
    limb = write(place / "a", "mine:bell", mine="x = 1  # \x1b[2K \u202e übrig\n")
    assert cli.main(["trust", str(limb), "--show"]) == 0
    assert r"x = 1  # \x1b[2K \u202e übrig" in capsys.readouterr().out
    with pytest.raises(FieldError):
        load_limb(limb)


@pytest.mark.parametrize("mode", [0o707, 0o770, 0o722])
def test_a_list_of_trust_that_others_may_write_counts_for_nothing(place, mode):
    limb = write(place / "a", "mine:bell", mine=LAW)
    trust(code(limb), str(limb))
    (place / "state" / "limb_nodes").chmod(mode)
    with pytest.raises(FieldError):
        load_limb(limb)
    with pytest.raises(UserError, match="is not yours alone"):
        trust(code(limb), str(limb))


def test_a_folder_is_private_or_is_not(tmp_path):
    umask = os.umask(0o002)
    try:
        made = private_folder(tmp_path / "a" / "b" / "c")
    finally:
        os.umask(umask)
    assert made == tmp_path / "a" / "b" / "c"
    assert [folder.stat().st_mode & 0o777 for folder in (made, made.parent)] == [0o700, 0o700]
    (tmp_path / "link").symlink_to(made)
    assert private_folder(tmp_path / "link") is None
    (tmp_path / "way").symlink_to(made.parent)
    assert private_folder(tmp_path / "way" / "c") == made
    (tmp_path / "file").write_text("")
    assert private_folder(tmp_path / "file") is None
    assert private_folder(Path("relative")) is None
    made.parent.chmod(0o777)
    assert private_folder(made) is None
    made.parent.chmod(0o1777)
    assert private_folder(made) == made
    if os.geteuid() == 0:
        os.chown(made.parent, 65534, 65534)
        assert private_folder(made) is None
