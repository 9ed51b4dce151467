"""YAML is read or refused within little time and memory, whatever it is."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import pytest

import limb_nodes
from limb_nodes.bags.read import BagReader
from limb_nodes.bags.write import BagWriter
from limb_nodes.errors import UserError
from limb_nodes.foundation.yaml_text import MOST_BYTES, MOST_LEVELS, MOST_VALUES, parse_yaml, read_yaml
from limb_nodes.model import load_limb, parse_limb
from limb_nodes.signals.waveform import read_waveforms

LIMBS = sorted((Path(__file__).resolve().parents[2] / "params").glob("*.yaml"))


def aliases(levels: int, many: int, first: str = "[1]", each: str = "[{}]") -> str:
    """YAML in which every level repeats the one before."""
    lines = [f"a0: &a0 {first}"]
    for level in range(1, levels):
        lines.append(f"a{level}: &a{level} " + each.format(", ".join([f"*a{level - 1}"] * many)))
    return "\n".join(lines)


TOO_MUCH = {
    "aliases of aliases": (aliases(9, 10), "line 6: has more than 30000 values"),
    "aliases that are merged": (aliases(9, 10, "{x: 1}", "{{<<: [{}]}}"), "line 5: has more than 30000 values"),
    "an alias, often": ("- &a [" + "1, " * 200 + "]\n- [" + "*a, " * 200 + "]", "line 2: has more than 30000 values"),
    "an alias within what it names": ("a: &a\n  b: [*a]", "line 2: an alias stands within what it names"),
    "a long list": ("a:\n" + "- 1\n" * MOST_VALUES, f"line {MOST_VALUES + 1}: has more than 30000 values"),
    "a very long list": ("[" + "1," * (MOST_BYTES // 2 - 2) + "]", "line 1: has more than 30000 values"),
    "10 MB": ("- 1\n" * 2_500_000, "has more than 1048576 bytes"),
    "levels in brackets": ("[" * 2000 + "]" * 2000, "line 1: has more than 50 levels"),
    "levels by indentation": ("\n".join(" " * level + "a:" for level in range(99)), "line 50: has more than 50 levels"),
    "levels of keys": ("? " * 2000, "line 1: has more than 50 levels"),
    "an integer": ("a:\n  " + "1" * 50_000, "line 2: has more than 400 digits"),
    "a hexadecimal integer": ("0x" + "f" * 50_000, "line 1: has more than 400 digits"),
    "a fraction": ("1." + "0" * 50_000, "line 1: has more than 400 digits"),
    "a tagged integer": ("!!int '" + "1" * 50_000 + "'", "line 1: has more than 400 digits"),
}
NO_YAML = ["!!int ''", "!!bool x", "!!float x", "2001-99-99", "!!omap [1]", "!!set [a]", "a\0b", "\ud800", "*a", "a: ["]


@pytest.mark.parametrize("case", TOO_MUCH)
def test_too_much_is_refused_with_file_line_and_limit(case: str) -> None:
    text, part = TOO_MUCH[case]
    with pytest.raises(UserError) as caught:
        parse_yaml(text, "some.yaml")
    assert str(caught.value).startswith("some.yaml")
    assert part in str(caught.value)


def test_aliases_take_no_memory() -> None:
    tracemalloc.start()
    try:
        with pytest.raises(UserError):
            parse_yaml(aliases(9, 10), "some.yaml")
        assert tracemalloc.get_traced_memory()[1] < 2e6
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("text", NO_YAML)
def test_what_is_no_yaml_is_refused_in_one_line(text: str) -> None:
    with pytest.raises(UserError, match=r"^some\.yaml.*: not YAML: [^\n]*$"):
        parse_yaml(text, "some.yaml")


def test_what_is_just_within_the_limits_is_read() -> None:
    assert len(parse_yaml("- 1\n" * (MOST_VALUES - 1), "some.yaml")) == MOST_VALUES - 1
    nested = parse_yaml("[" * MOST_LEVELS + "]" * MOST_LEVELS, "some.yaml")
    for _ in range(MOST_LEVELS - 1):
        (nested,) = nested
    assert nested == []
    assert parse_yaml(aliases(4, 10), "some.yaml")["a1"] == [[1]] * 10
    assert parse_yaml("a: &x 1\nb: &x 2\nc: *x", "some.yaml")["c"] == 2


def test_a_byte_order_mark_is_no_part_of_the_text_and_utf_16_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "some.yaml"
    file.write_text("a: 1\n", encoding="utf-8-sig")
    assert read_yaml(file) == ({"a": 1}, "a: 1\n")
    file.write_text("a: 1\n", encoding="utf-16")
    with pytest.raises(UserError, match=r"line 1: is not UTF-8"):
        read_yaml(file)


def test_what_has_no_end_is_not_read_to_its_end() -> None:
    with pytest.raises(UserError, match="has more than 1048576 bytes"):
        read_yaml(Path("/dev/zero"))


def test_the_limits_are_far_from_the_limbs_that_are_shipped() -> None:
    for file in LIMBS:
        text = file.read_text(encoding="utf-8")
        many = "\n".join(f"a{copy}:\n  " + text.replace("\n", "\n  ") for copy in range(30))
        assert len(parse_yaml(many, "some.yaml")) == 30


def test_every_file_of_yaml_is_read_within_the_limits(tmp_path: Path) -> None:
    """A limb, a limb's text, waveforms, a bag's metadata and what the recorder wrote down of a run."""
    bomb = aliases(9, 10)
    file = tmp_path / "bomb.yaml"
    file.write_text(bomb, encoding="utf-8")
    bag = tmp_path / "bag"
    bag.mkdir()
    (bag / "metadata.yaml").write_text(bomb, encoding="utf-8")
    for read, given in ((load_limb, file), (read_waveforms, file), (BagReader, bag)):
        with pytest.raises(UserError, match="line 6: has more than 30000 values"):
            read(given)
    with pytest.raises(UserError, match="line 6: has more than 30000 values"):
        parse_limb(bomb, "text")
    with BagWriter(tmp_path / "run", bomb):
        pass
    with BagReader(tmp_path / "run") as reader, pytest.raises(UserError, match="line 6: has more than 30000 values"):
        reader.run_info()


def test_no_other_place_reads_yaml() -> None:
    package = Path(limb_nodes.__file__).parent
    users = {file.name for file in package.rglob("*.py") if "YAML(" in file.read_text(encoding="utf-8")}
    # The others write it.
    assert users == {"yaml_text.py", "write.py", "verify.py"}
