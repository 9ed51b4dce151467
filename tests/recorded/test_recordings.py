"""Recordings are found if they are there, and else a test that needs one is skipped with the reason."""

from pathlib import Path

import pytest

from tests.recordings import BESIDE, recorded


def test_in_the_folder_of_the_environment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "cat").mkdir()
    (tmp_path / "cat" / "jump.txt").touch()
    monkeypatch.setenv("LIMB_DATA", str(tmp_path))
    assert recorded("cat/jump.txt") == tmp_path / "cat" / "jump.txt"
    with pytest.raises(pytest.skip.Exception, match=f"no recording {tmp_path}/dog; CONTRIBUTING"):
        recorded("dog")


@pytest.mark.parametrize("value", [None, ""])
def test_beside_the_project(value: str | None, monkeypatch: pytest.MonkeyPatch) -> None:
    if value is None:
        monkeypatch.delenv("LIMB_DATA", raising=False)
    else:
        monkeypatch.setenv("LIMB_DATA", value)
    assert Path(__file__).parents[2].resolve().parent / "shared" / "data" == BESIDE
    with pytest.raises(pytest.skip.Exception, match=str(BESIDE / "dog")):
        recorded("dog")
