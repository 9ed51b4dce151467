"""Compiled functions that only other compiled functions call.

They have no entry from Python, which would take a part of the time to compile: to call one from there
ends the process. They are kept on disk as a part of their callers.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import njit

OPTIONS: dict[str, Any] = {"error_model": "numpy", "no_cpython_wrapper": True, "no_cfunc_wrapper": True}


def inner(function: Callable[..., Any]) -> Any:
    """The compiled function."""
    return njit(**OPTIONS)(function)
