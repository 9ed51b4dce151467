"""Links of README and docs lead somewhere, pictures are there, and the reference is as the code."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path
from types import ModuleType

import pytest

from limb_nodes.errors import UserError
from limb_nodes.model import parse_limb

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md", *sorted(DOCS.rglob("*.md"))]
LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)|(?:src|href)=\"([^\"]+)\"")


def generator() -> ModuleType:
    """docs/generate.py as a module."""
    spec = importlib.util.spec_from_file_location("docs_generate", DOCS / "generate.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def without_code(text: str) -> str:
    """A page without its blocks of code."""
    return re.sub(r"^```.*?^```$", "", text, flags=re.DOTALL | re.MULTILINE)


def anchors(page: Path) -> set[str]:
    """The anchors that the headings of a page have."""
    headings = re.findall(r"^#+ (.*)$", without_code(page.read_text(encoding="utf-8")), re.MULTILINE)
    plain = [re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).strip().lower() for heading in headings]
    return {re.sub(r"[^\w\- ]", "", heading).replace(" ", "-") for heading in plain}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_links_lead_somewhere(page: Path) -> None:
    for groups in LINK.findall(without_code(page.read_text(encoding="utf-8"))):
        link = groups[0] or groups[1]
        if link.startswith(("http://", "https://")):
            continue
        name, _, anchor = link.partition("#")
        target = (page.parent / name).resolve() if name else page
        assert target.exists(), f"{page.relative_to(ROOT)}: {link}"
        assert not anchor or anchor in anchors(target), f"{page.relative_to(ROOT)}: {link} has no such heading"


def test_every_page_can_be_reached_from_the_readme() -> None:
    reached, waiting = set(), [ROOT / "README.md"]
    while waiting:
        page = waiting.pop()
        if page in reached or page.suffix != ".md":
            continue
        reached.add(page)
        for groups in LINK.findall(without_code(page.read_text(encoding="utf-8"))):
            name = (groups[0] or groups[1]).partition("#")[0]
            if name and not name.startswith("http"):
                waiting.append((page.parent / name).resolve())
    assert set(DOCS.rglob("*.md")) <= reached


def test_every_picture_is_used() -> None:
    text = "".join(page.read_text(encoding="utf-8") for page in PAGES)
    assert [picture.name for picture in (DOCS / "images").iterdir() if picture.name not in text] == []


@pytest.mark.parametrize("name", generator().PAGES)
def test_the_reference_is_as_the_code(name: str) -> None:
    text = (DOCS / "reference" / f"{name}.md").read_text(encoding="utf-8")
    hint = f"docs/reference/{name}.md differs from the code: run `python -m docs.generate`"
    assert generator().filled(text) == text, hint


LIMB = """
name: limb
{}
segments: [{{name: a, mass: 1, length: 1, com_distance: 0.5, inertia: 0.1 {}}}]
muscles:
  - name: m
    joint: a
    role: flexor
    path: {{moment_arm: 0.03, proximal_distance: 0.1, distal_distance: 0.05}}
    {}
    units: [{{series_sarcomeres: 42000, parallel_sarcomeres: 1e13, minimum_frequency: 5, maximum_frequency: 15,
             pcsa: 1e-4, maximum_passive_force: 1 {}}}]
"""
WRONG = {"The limb": ("wrong: 1", "", "", ""), "Segments": ("", ", wrong: 1", "", "")}
WRONG |= {"Muscles": ("", "", "wrong: 1", ""), "Motor units": ("", "", "", ", wrong: 1")}


@pytest.mark.parametrize("heading", WRONG)
def test_the_reference_has_every_key_that_the_loader_takes(heading: str) -> None:
    with pytest.raises(UserError) as refused:
        parse_limb(LIMB.format(*WRONG[heading]), "limb.yaml")
    taken = set(re.search(r"allowed: (.*)", str(refused.value))[1].split(", "))  # type: ignore[index]
    page = (DOCS / "reference" / "yaml.md").read_text(encoding="utf-8")
    sections = dict(re.findall(r"^## ([^\n]*)\n(.*?)(?=^## |\Z)", page, re.DOTALL | re.MULTILINE))
    level = {"Muscles": "muscle", "Motor units": "motor unit"}.get(heading)
    keys = set(re.findall(r"^\| `(\w+)`", sections[heading], re.MULTILINE))
    keys |= {
        key for key, of in re.findall(r"^\| `(\w+)` \| ([\w ]+) \|", sections["Laws"], re.MULTILINE) if of == level
    }
    assert keys == taken
