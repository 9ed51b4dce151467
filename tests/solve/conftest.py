"""Limbs that several tests solve; limbs of one structure share a compiled program."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from limb_nodes.model import load_limb, with_values
from limb_nodes.solve.whole import WholeModel

PARAMS = Path(__file__).parents[2] / "params"


@pytest.fixture(scope="session")
def limb_named():
    """A limb of params/ by name, with other values; `free` leaves the joint ranges out."""
    read = cache(load_limb)

    def limb(name: str, values: dict | None = None, free: bool = False):
        given = read(PARAMS / f"{name}.yaml")
        ranges = {f"segments[{k}].range": None for k in range(len(given.segments))} if free else {}
        return with_values(given, {**ranges, **(values or {})})

    return limb


@pytest.fixture(scope="session")
def model_named(limb_named):
    """The same, ready to be solved."""

    def model(name: str, values: dict | None = None, free: bool = False) -> WholeModel:
        return WholeModel(limb_named(name, values, free))

    return model


@pytest.fixture(scope="session")
def waves():
    """Excitations [T, muscles] that differ from muscle to muscle, within [0, 1]."""

    def make(time: np.ndarray, muscles: int, mean: float = 0.5, amplitude: float = 0.4) -> np.ndarray:
        return mean + amplitude * np.sin(2 * np.pi * time[:, np.newaxis] + np.arange(muscles))

    return make


@pytest.fixture(scope="session")
def sine_cosine():
    """Flexor sine, extensor cosine, their negative half-waves left out [T, 2]."""

    def make(time: np.ndarray) -> np.ndarray:
        return np.clip(np.column_stack([np.sin(2 * np.pi * time), np.cos(2 * np.pi * time)]), 0.0, 1.0)

    return make
