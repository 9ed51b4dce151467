"""`pip install` takes all packages of ROS 2 from one distribution, the one that LIMB_ROS names."""

from __future__ import annotations

import importlib.util
from importlib.metadata import PackageNotFoundError, requires, version
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from packaging.requirements import Requirement

tomllib = pytest.importorskip("tomllib", reason="Python 3.10 reads no TOML")

ROOT = Path(__file__).resolve().parents[2]
SETTINGS = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["scikit-build"]["metadata"]["dependencies"]
DISTRIBUTIONS = SETTINGS["distributions"]


@pytest.fixture
def provider(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The module that pip's build calls, without the variable."""
    monkeypatch.delenv("LIMB_ROS", raising=False)
    place = ROOT / SETTINGS["provider-path"] / f"{SETTINGS['provider']}.py"
    spec = importlib.util.spec_from_file_location(place.stem, place)
    assert spec is not None and spec.loader is not None  # noqa: PT018
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def required(provider: ModuleType) -> tuple[Any, Any]:
    """What is required to build and to run."""
    return (
        provider.get_requires_for_dynamic_metadata(SETTINGS),
        provider.dynamic_metadata("dependencies", SETTINGS, {}),
    )


@pytest.mark.parametrize("name", DISTRIBUTIONS)
def test_the_variable_chooses(name: str, provider: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LIMB_ROS", name)
    tables = DISTRIBUTIONS[name]
    assert required(provider) == (tables["build"], [*tables["run"], *SETTINGS["common"]])


def test_jazzy_is_the_default(provider: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    without = required(provider)
    for name in "", "jazzy":
        monkeypatch.setenv("LIMB_ROS", name)
        assert required(provider) == without


def test_another_name_is_refused(provider: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LIMB_ROS", "humble")
    for call in (lambda: provider.get_requires_for_dynamic_metadata(SETTINGS), lambda: required(provider)):
        with pytest.raises(SystemExit, match=r"^LIMB_ROS is 'humble'; jazzy or kilted is needed$"):
            call()


def test_the_installed_packages_are_of_one_distribution() -> None:
    try:
        listed = requires("limb-nodes") or []
    except PackageNotFoundError:
        pytest.skip("limb-nodes is not installed in this environment")
    needed = [Requirement(text) for text in listed]
    ros = {item.name: item for item in needed if item.name.startswith("ros-")}
    (name,) = [
        name for name, tables in DISTRIBUTIONS.items() if {Requirement(t) for t in tables["run"]} == {*ros.values()}
    ]
    for item in [*map(Requirement, DISTRIBUTIONS[name]["run"]), *needed]:
        if item.marker is None:
            assert item.specifier.contains(version(item.name)), item
