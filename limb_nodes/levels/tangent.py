"""Forward-mode differentiation of equations by rewriting their source.

From ``def f(a, b): ...`` and the set of arguments that vary, `tangent_source` makes
``def f__t(a, d_a, b): ...`` that returns the pair (value, directional derivative). The code it
takes is that of a law (see `limb_nodes.levels.contracts`): scalar arithmetic, comparisons, `if`,
`math` functions and calls of other such functions. At a kink the derivative is that of the branch
taken.
"""

from __future__ import annotations

import ast
import inspect
import math
import textwrap
from collections.abc import Callable
from typing import Any

from limb_nodes.levels.equation import ScalarFunction


class UnsupportedCode(Exception):
    """Code outside the subset, with the function and the line."""


# Derivative of math.NAME(x) in terms of x ({x}) and the function's value ({y}).
DERIVATIVES = {
    "exp": "{y}",
    "expm1": "({y} + 1.0)",
    "log": "1.0 / {x}",
    "log1p": "1.0 / (1.0 + {x})",
    "sqrt": "0.5 / {y}",
    "sin": "math.cos({x})",
    "cos": "-math.sin({x})",
    "tan": "(1.0 + {y} * {y})",
    "asin": "1.0 / math.sqrt(1.0 - {x} * {x})",
    "acos": "-1.0 / math.sqrt(1.0 - {x} * {x})",
    "atan": "1.0 / (1.0 + {x} * {x})",
    "sinh": "math.cosh({x})",
    "cosh": "math.sinh({x})",
    "tanh": "(1.0 - {y} * {y})",
    "fabs": "math.copysign(1.0, {x})",
    "erf": "2.0 / math.sqrt(math.pi) * math.exp(-{x} * {x})",
}


def function_tree(function: ScalarFunction) -> ast.FunctionDef:
    """The syntax tree of a plain function, without decorators, annotations and docstring."""
    try:
        source = function.__dict__.get("text") or textwrap.dedent(inspect.getsource(function))
    except (OSError, TypeError):
        raise UnsupportedCode(f"{function!r}: its source cannot be read") from None
    tree = ast.parse(source).body[0]
    if not isinstance(tree, ast.FunctionDef):
        raise UnsupportedCode(f"{function.__name__}: a plain function is needed")
    arguments = tree.args
    if arguments.vararg or arguments.kwarg or arguments.kwonlyargs or arguments.defaults:
        raise UnsupportedCode(f"{function.__name__}: plain arguments without defaults are needed")
    tree.decorator_list = []
    tree.returns = None
    for argument in arguments.args:
        argument.annotation = None
    if ast.get_docstring(tree) is not None:
        tree.body = tree.body[1:]
    return tree


def helper_functions(function: ScalarFunction) -> dict[str, ScalarFunction]:
    """Plain functions that a function calls by a global name, by that name."""
    helpers: dict[str, ScalarFunction] = {}
    for node in ast.walk(function_tree(function)):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            target = function.__globals__.get(node.func.id)
            if inspect.isfunction(target):
                helpers[node.func.id] = target
    return helpers


def global_constants(function: ScalarFunction) -> dict[str, float]:
    """Numbers that a function reads by a global name, by that name."""
    tree = function_tree(function)
    local = {argument.arg for argument in tree.args.args}
    names = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
    return {
        name: function.__globals__[name]
        for name in sorted(names - local)
        if isinstance(function.__globals__.get(name), int | float)
    }


def refuse_unsupported(function: ScalarFunction) -> None:
    """Raise UnsupportedCode if a function, or one that it calls, is outside the subset."""
    seen: set[ScalarFunction] = set()
    waiting = [function]

    def later(helper: ScalarFunction, _: frozenset[str] = frozenset()) -> str:
        waiting.append(helper)
        return helper.__name__

    while waiting:
        each = waiting.pop()
        if each in seen:
            continue
        seen.add(each)
        tree = function_tree(each)
        local = {argument.arg for argument in tree.args.args}
        tangent_source(each, frozenset(local), each.__name__, later, later)
        waiting += helper_functions(each).values()
        local |= {node.id for node in ast.walk(tree) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)}
        known = local | set(helper_functions(each)) | set(global_constants(each)) | {"abs", "min", "max"}
        for node in ast.walk(tree):
            if isinstance(node, ast.Name) and node.id not in known and each.__globals__.get(node.id) is not math:
                raise UnsupportedCode(f"{each.__name__}, {line_of(each, node)}: {node.id} is not allowed in a law")


def line_of(function: ScalarFunction, node: ast.AST) -> str:
    """The line of the function's file in which a node of its tree stands."""
    return f"line {function.__code__.co_firstlineno + getattr(node, 'lineno', 1) - 1}"


def tangent_source(
    function: ScalarFunction,
    active: frozenset[str],
    name: str,
    call_tangent: Callable[[ScalarFunction, frozenset[str]], str],
    names: Callable[[ScalarFunction], str],
) -> str:
    """Source of the tangent of a function with respect to its arguments in `active`.

    name: the new function's name. call_tangent(helper, its active arguments) and names(helper)
    give the names under which a helper's tangent and the helper itself are to be called.
    The new function takes, for every argument in `active`, the argument and then its tangent.
    """
    return Tangent(function, active, call_tangent, names).source(name)


class Tangent:
    """One rewriting; statements are collected in three-address form."""

    def __init__(
        self,
        function: ScalarFunction,
        active: frozenset[str],
        call_tangent: Callable[[ScalarFunction, frozenset[str]], str],
        names: Callable[[ScalarFunction], str],
    ) -> None:
        self.function = function
        self.tree = function_tree(function)
        self.arguments = [argument.arg for argument in self.tree.args.args]
        self.active = set(active)
        self.call_tangent = call_tangent
        self.names = names
        self.count = 0
        self.lines: list[str] = []

    def source(self, name: str) -> str:
        """The whole text; names become active until nothing changes."""
        while True:
            before = len(self.active)
            self.count, self.lines = 0, []
            self.block(self.tree.body, 1)
            if len(self.active) == before:
                break
        given = []
        for argument in self.arguments:
            given += [argument, f"d_{argument}"] if argument in self.active else [argument]
        return "\n".join([f"def {name}({', '.join(given)}):", *self.lines]) + "\n"

    def fail(self, node: ast.AST, what: str) -> Any:
        raise UnsupportedCode(f"{self.function.__name__}, {line_of(self.function, node)}: {what}")

    def emit(self, depth: int, text: str) -> None:
        self.lines.append("    " * depth + text)

    def fresh(self) -> str:
        self.count += 1
        return f"_{self.count}"

    def block(self, body: list[ast.stmt], depth: int) -> None:
        for statement in body:
            self.statement(statement, depth)

    def statement(self, node: ast.stmt, depth: int) -> None:
        if isinstance(node, ast.Return) and node.value is not None:
            value, slope = self.expression(node.value, depth)
            self.emit(depth, f"return {self.returned(value, slope)}")
        elif isinstance(node, ast.Assign) and len(node.targets) == 1 and isinstance(node.targets[0], ast.Name):
            self.assign(node.targets[0].id, node.value, depth)
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name) and node.value:
            self.assign(node.target.id, node.value, depth)
        elif isinstance(node, ast.AugAssign) and isinstance(node.target, ast.Name):
            left = ast.Name(node.target.id, ast.Load())
            self.assign(node.target.id, ast.BinOp(left, node.op, node.value), depth)
        elif isinstance(node, ast.If):
            self.emit(depth, f"if {self.plain(node.test)}:")
            self.block(node.body, depth + 1)
            if node.orelse:
                self.emit(depth, "else:")
                self.block(node.orelse, depth + 1)
        elif isinstance(node, ast.Pass):
            self.emit(depth, "pass")
        elif not (isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)):
            self.fail(node, f"{type(node).__name__} is not allowed in a law")

    def returned(self, value: str, slope: str) -> str:
        """What the new function returns."""
        return f"{value}, {slope or '0.0'}"

    def assign(self, target: str, value: ast.expr, depth: int) -> None:
        text, slope = self.expression(value, depth)
        if slope:
            self.active.add(target)
        self.emit(depth, f"{target} = {text}")
        if target in self.active:
            self.emit(depth, f"d_{target} = {slope or '0.0'}")

    def plain(self, node: ast.expr) -> str:
        """A condition or an inactive expression, with helpers under their new names."""
        renamed = ast.parse(ast.unparse(node), mode="eval")
        for part in ast.walk(renamed):
            if isinstance(part, ast.Call) and isinstance(part.func, ast.Name):
                target = self.function.__globals__.get(part.func.id)
                if inspect.isfunction(target):
                    part.func.id = self.names(target)
        return ast.unparse(renamed)

    def varies(self, node: ast.expr) -> bool:
        return any(isinstance(n, ast.Name) and n.id in self.active for n in ast.walk(node))

    def keep(self, text: str, depth: int) -> str:
        name = self.fresh()
        self.emit(depth, f"{name} = {text}")
        return name

    def expression(self, node: ast.expr, depth: int) -> tuple[str, str]:
        """Text of value and derivative of an expression; the derivative is '' if it is zero."""
        if not self.varies(node):
            return f"({self.plain(node)})", ""
        if isinstance(node, ast.Name):
            return node.id, f"d_{node.id}"
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.UAdd):
            value, slope = self.expression(node.operand, depth)
            sign = "-" if isinstance(node.op, ast.USub) else "+"
            return f"({sign}{value})", f"({sign}{slope})"
        if isinstance(node, ast.BinOp):
            return self.binary(node, depth)
        if isinstance(node, ast.IfExp):
            return self.conditional(node.test, node.body, node.orelse, depth)
        if isinstance(node, ast.Call) and not node.keywords:
            return self.call(node, depth)
        self.fail(node, f"{ast.unparse(node)} is not allowed in a law")
        raise AssertionError

    def binary(self, node: ast.BinOp, depth: int) -> tuple[str, str]:
        x, dx = self.expression(node.left, depth)
        y, dy = self.expression(node.right, depth)
        x, y = self.keep(x, depth), self.keep(y, depth)
        terms: list[str]
        if isinstance(node.op, ast.Add):
            value, terms = f"{x} + {y}", [dx, dy]
        elif isinstance(node.op, ast.Sub):
            value, terms = f"{x} - {y}", [dx, f"-{dy}" if dy else ""]
        elif isinstance(node.op, ast.Mult):
            value = f"{x} * {y}"
            terms = [f"{dx} * {y}" if dx else "", f"{x} * {dy}" if dy else ""]
        elif isinstance(node.op, ast.Div):
            # One division for value and slope: the processor takes as long for it as for a dozen of the others.
            inverse = self.keep(f"1.0 / {y}", depth)
            quotient = self.keep(f"{x} * {inverse}", depth)
            terms = [f"{dx} * {inverse}" if dx else "", f"-{quotient} * {dy} * {inverse}" if dy else ""]
            value = quotient
        elif isinstance(node.op, ast.Pow):
            power = self.keep(f"{x} ** {y}", depth)
            terms = [
                f"{y} * {x} ** ({y} - 1.0) * {dx}" if dx else "",
                f"{power} * math.log({x}) * {dy}" if dy else "",
            ]
            value = power
        else:
            self.fail(node, f"{ast.unparse(node)} is not allowed in a law")
        slope = " + ".join(term for term in terms if term)
        return self.keep(value, depth), self.keep(slope, depth)

    def conditional(self, test: ast.expr, body: ast.expr, orelse: ast.expr, depth: int) -> tuple[str, str]:
        value, slope = self.fresh(), self.fresh()
        for head, branch in ((f"if {self.plain(test)}:", body), ("else:", orelse)):
            self.emit(depth, head)
            text, derivative = self.expression(branch, depth + 1)
            self.emit(depth + 1, f"{value} = {text}")
            self.emit(depth + 1, f"{slope} = {derivative or '0.0'}")
        return value, slope

    def call(self, node: ast.Call, depth: int) -> tuple[str, str]:
        if isinstance(node.func, ast.Attribute):
            module = node.func.value
            if not (isinstance(module, ast.Name) and self.module(module.id) is math):
                self.fail(node, f"{ast.unparse(node.func)} is not allowed; functions of math are")
            return self.math_call(node.func.attr, node, depth)
        assert isinstance(node.func, ast.Name)
        name = node.func.id
        if name == "abs" and len(node.args) == 1:
            return self.math_call("fabs", node, depth)
        if name in ("min", "max") and len(node.args) == 2:
            pairs = [self.expression(argument, depth) for argument in node.args]
            (x, dx), (y, dy) = [(self.keep(v, depth), d) for v, d in pairs]
            value, slope = self.fresh(), self.fresh()
            self.emit(depth, f"{value} = {name}({x}, {y})")
            sign = "<=" if name == "min" else ">="
            self.emit(depth, f"{slope} = ({dx or '0.0'}) if {x} {sign} {y} else ({dy or '0.0'})")
            return value, slope
        target: Any = self.function.__globals__.get(name)
        if not inspect.isfunction(target):
            self.fail(node, f"{name} is not allowed in a law")
        arguments, given, varying = [], [], set()
        parameters = list(inspect.signature(target).parameters)
        for parameter, argument in zip(parameters, node.args, strict=True):
            value, slope = self.expression(argument, depth)
            arguments.append(self.keep(value, depth))
            given.append(arguments[-1])
            if slope:
                given.append(slope)
                varying.add(parameter)
        return self.helper(target, arguments, given, frozenset(varying), depth)

    def helper(
        self, target: ScalarFunction, arguments: list[str], given: list[str], varying: frozenset[str], depth: int
    ) -> tuple[str, str]:
        """A call of another function; given: its arguments and, behind those in `varying`, their tangents."""
        both = self.keep(f"{self.call_tangent(target, varying)}({', '.join(given)})", depth)
        return f"{both}[0]", f"{both}[1]"

    def math_call(self, name: str, node: ast.Call, depth: int) -> tuple[str, str]:
        pairs = [self.expression(argument, depth) for argument in node.args]
        kept = [(self.keep(value, depth), slope) for value, slope in pairs]
        value = self.keep(f"math.{name}({', '.join(text for text, _ in kept)})", depth)
        if name == "atan2" and len(kept) == 2:
            (y, dy), (x, dx) = kept
            slope = f"(({dy or '0.0'}) * {x} - ({dx or '0.0'}) * {y}) / ({x} * {x} + {y} * {y})"
        elif name == "hypot" and len(kept) == 2:
            (x, dx), (y, dy) = kept
            slope = f"(({dx or '0.0'}) * {x} + ({dy or '0.0'}) * {y}) / {value}"
        elif name == "pow" and len(kept) == 2 and not kept[1][1]:
            (x, dx), (y, _) = kept
            slope = f"{y} * math.pow({x}, {y} - 1.0) * {dx}"
        elif name == "copysign" and len(kept) == 2 and not kept[0][1]:
            return value, "0.0"
        elif name in DERIVATIVES and len(kept) == 1:
            x, dx = kept[0]
            slope = f"({DERIVATIVES[name].format(x=x, y=value)}) * {dx}"
        else:
            self.fail(node, f"math.{name} is not allowed of an argument that varies")
        return value, self.keep(slope, depth)

    def module(self, name: str) -> Any:
        return self.function.__globals__.get(name)
