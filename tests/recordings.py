"""Where recorded data lie, which the project does not hold: CONTRIBUTING.md says what and where it is public."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

BESIDE = Path(__file__).resolve().parents[2] / "shared" / "data"


def recorded(name: str) -> Path:
    """A file or folder where LIMB_DATA says, else in ../shared/data; the test is skipped if it is not there."""
    path = Path(os.environ.get("LIMB_DATA") or BESIDE) / name
    if not path.exists():
        pytest.skip(f"no recording {path}; CONTRIBUTING.md says where it is from")
    return path
