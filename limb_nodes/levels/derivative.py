"""Derivatives of equations as equations: functions again, which are read, compiled and differentiated like others."""

from __future__ import annotations

import ast
import math
from functools import lru_cache
from typing import Any

from limb_nodes.levels.equation import ScalarFunction
from limb_nodes.levels.tangent import Tangent, function_tree


def written(name: str, text: str, **known: ScalarFunction | float) -> ScalarFunction:
    """The function `name` of a text, which may use the functions and numbers `known`."""
    space: dict[str, Any] = {"math": math, **known}
    exec(compile(text, f"<{name}>", "exec"), space)
    function: ScalarFunction = space[name]
    # Whoever rewrites it cannot read its text from a file.
    function.__dict__["text"] = text
    return function


@lru_cache(maxsize=256)
def partial_derivative(function: ScalarFunction, argument: str) -> ScalarFunction:
    """The derivative of an equation's function with respect to one of its arguments, a function of the same arguments.

    Raises UnsupportedCode if the function is not one that laws may have.
    """
    arguments = [one.arg for one in function_tree(function).args.args]
    given = ", ".join(f"{one}, 1.0" if one == argument else one for one in arguments)
    text = f"def derivative({', '.join(arguments)}):\n    return directional({given})\n"
    return written("derivative", text, directional=directional_derivative(function, frozenset({argument})))


@lru_cache(maxsize=256)
def directional_derivative(function: ScalarFunction, active: frozenset[str]) -> ScalarFunction:
    """The derivative of a function in a direction; takes, behind every argument in `active`, its part of that."""
    known: dict[str, ScalarFunction] = {}

    def call_derivative(helper: ScalarFunction, varying: frozenset[str]) -> str:
        known[name := f"slope{len(known)}_{helper.__name__}"] = directional_derivative(helper, varying)
        return name

    def call(helper: ScalarFunction) -> str:
        # Two of different modules may have one name.
        known[name := f"value{len(known)}_{helper.__name__}"] = helper
        return name

    tree = ast.parse(Derivative(function, active, call_derivative, call).source("directional"))
    # What is differentiated once more has tangents of its own.
    for node in ast.walk(tree):
        if isinstance(node, ast.arg):
            node.arg = renamed(node.arg)
        elif isinstance(node, ast.Name):
            node.id = renamed(node.id)
    constants = {name: value for name, value in function.__globals__.items() if isinstance(value, int | float)}
    return written("directional", ast.unparse(tree) + "\n", **known, **constants)


def renamed(name: str) -> str:
    """The name of a variable that the first differentiation has made."""
    if name.startswith("d_"):
        return f"slope_of{name[1:]}"
    return f"part{name}" if name.startswith("_") else name


class Derivative(Tangent):
    """A rewriting that returns the derivative alone, as do the helpers' that it calls."""

    def returned(self, value: str, slope: str) -> str:
        return slope or "0.0"

    def helper(
        self, target: ScalarFunction, arguments: list[str], given: list[str], varying: frozenset[str], depth: int
    ) -> tuple[str, str]:
        value = self.keep(f"{self.names(target)}({', '.join(arguments)})", depth)
        return value, self.keep(f"{self.call_tangent(target, varying)}({', '.join(given)})", depth)
