"""The compiled program of a limb, kept on disk between processes."""

from __future__ import annotations

import hashlib
import importlib.util
import inspect
import os
import sys
import tempfile
from functools import cache
from importlib import resources
from types import ModuleType

import numba

from limb_nodes.model import chain as model_chain
from limb_nodes.model.layout import Layout
from limb_nodes.solve import chain, held
from limb_nodes.solve.cache import cache_folder
from limb_nodes.solve.generate import program

IMPORTS = (
    "from limb_nodes.model.chain import HIGHEST, LOWEST\n"
    "from limb_nodes.solve.chain import acceleration, bias_slopes, impact, reaction, solve_free\n"
    "from limb_nodes.solve.held import held_torque, linear_torque\n"
    "from limb_nodes.solve.pointer import callback, record_at\n"
    "from limb_nodes.solve.problem import FUNCTION\n"
)
# Modules whose functions become a part of every program.
COMPILED_IN = (model_chain, chain, held)


@cache
def static_sources() -> tuple[str, str]:
    """Text of the entry points, and a text that changes with all other code that is compiled in."""
    entries = resources.files("limb_nodes.solve").joinpath("entries.py.in").read_text("utf-8")
    return entries, "".join(inspect.getsource(module) for module in COMPILED_IN) + numba.__version__


def compiled(layout: Layout) -> ModuleType:
    """The module of a limb's program; limbs of the same structure share one."""
    entries, other = static_sources()
    text = program(layout, IMPORTS, entries)
    name = "limb_program_" + hashlib.sha256((text + other).encode()).hexdigest()[:20]
    if name in sys.modules:
        return sys.modules[name]
    path = cache_folder() / f"{name}.py"
    if not path.exists():
        # Written aside and renamed, so that no other process reads half a file.
        handle, temporary = tempfile.mkstemp(dir=path.parent, suffix=".tmp")
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
        os.replace(temporary, path)
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module
