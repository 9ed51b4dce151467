"""Writes the program of a limb: one Python module of scalar code, specialised to its laws.

The text of every equation is copied from its function, together with the tangents that Newton's
method and the slopes need, so the program depends on nothing that its content hash does not
cover, and numba's cache on disk serves every later process.
"""

from __future__ import annotations

import ast
from collections.abc import Iterable, Sequence

from limb_nodes.levels.equation import ScalarFunction
from limb_nodes.levels.tangent import (
    function_tree,
    global_constants,
    helper_functions,
    tangent_source,
)
from limb_nodes.model.layout import GROUP_INDEX, MUSCLE_INDEX, UNIT_INDEX, Layout, MuscleKind, UnitKind
from limb_nodes.model.system import BoundEquation
from limb_nodes.solve.outputs import MUSCLE_OUTPUTS, UNIT_OUTPUTS

# Never called from Python: entries for that would take a part of the time to compile.
INLINE = '@njit(error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)\n'
# With many arrays among its arguments, a call takes as long as an exponential.
FORCED = INLINE.replace(")\n", ", forceinline=True)\n")


class Equations:
    """The copies of equation functions and of their tangents."""

    def __init__(self) -> None:
        self.names: dict[tuple[ScalarFunction, frozenset[str]], str] = {}
        self.texts: list[str] = []
        self.constants: dict[str, float] = {}

    def name(self, function: ScalarFunction, active: frozenset[str] = frozenset()) -> str:
        """The name of a function's copy, or of its tangent with respect to `active`."""
        key = (function, active)
        if key not in self.names:
            self.names[key] = f"e{len(self.names)}_{function.__name__}"
            self.texts.append(INLINE + self.text(function, active, self.names[key]))
        return self.names[key]

    def text(self, function: ScalarFunction, active: frozenset[str], name: str) -> str:
        """The source of a copy."""
        self.constants.update(global_constants(function))
        if active:
            return tangent_source(function, active, name, self.name, self.name)
        helpers = {local: self.name(helper) for local, helper in helper_functions(function).items()}
        tree = function_tree(function)
        tree.name = name
        for node in ast.walk(tree):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
                node.func.id = helpers.get(node.func.id, node.func.id)
        return ast.unparse(ast.fix_missing_locations(tree)) + "\n"


class Body:
    """The lines of one function, and which of its variables carry a tangent."""

    def __init__(self, equations: Equations, active: Iterable[str] = ()) -> None:
        self.equations = equations
        self.active = set(active)
        self.lines: list[str] = []

    def add(self, *lines: str) -> None:
        """Append lines of the function's body."""
        self.lines += [f"    {line}" for line in lines]

    def load(self, names: list[str], used: set[str], source: str) -> None:
        """Read those of `names` that are used from an array, `source` + position."""
        self.add(*(f"{n} = {source}{i}]" for i, n in enumerate(names) if n in used))

    def load_tangents(self, names: list[str], used: set[str], source: str) -> None:
        """The same for their tangents; the variables become active."""
        self.add(*(f"d_{n} = {source}{i}]" for i, n in enumerate(names) if n in used))
        self.active |= set(names) & used

    def compute(self, bound: Iterable[BoundEquation], indent: str = "") -> None:
        """Evaluate equations in order, with tangents where something active goes in."""
        for item in bound:
            function = item.equation.function
            varying = frozenset(
                argument
                for argument, symbol in zip(item.equation.uses, item.symbols, strict=True)
                if symbol in self.active
            )
            given = []
            for argument, symbol in zip(item.equation.uses, item.symbols, strict=True):
                given += [symbol, f"d_{symbol}"] if argument in varying else [symbol]
            call = f"{self.equations.name(function, varying)}({', '.join(given)})"
            if varying:
                self.active.add(item.defines)
                self.add(f"{indent}{item.defines}, d_{item.defines} = {call}")
            else:
                self.add(f"{indent}{item.defines} = {call}")

    def slope(self, name: str) -> str:
        """The tangent of a variable as text."""
        return f"d_{name}" if name in self.active else "0.0"

    def function(self, name: str, arguments: str) -> str:
        """The whole text."""
        return "\n".join([f"{INLINE}def {name}({arguments}):", *self.lines]) + "\n"


def used_by(*stages: Iterable[BoundEquation]) -> set[str]:
    """All symbols on the right-hand sides of some stages."""
    return {symbol for stage in stages for bound in stage for symbol in bound.symbols}


def upstream(bound: list[BoundEquation], wanted: set[str]) -> list[BoundEquation]:
    """Those of some equations on which wanted variables depend, in order."""
    needed, kept = set(wanted), []
    for item in reversed(bound):
        if item.defines in needed:
            needed.update(item.symbols)
            kept.append(item)
    return kept[::-1]


def unit_functions(equations: Equations, number: int, kind: UnitKind) -> list[str]:
    """Functions of one kind of motor unit."""
    states = [state.name for state, _ in kind.system.states]
    rates = [state.rate for state, _ in kind.system.states]
    texts = [unit_drive(equations, number, kind)]
    texts += unit_force(equations, number, kind)
    texts.append(unit_loop(equations, number, kind, ["fibre_force"], "force", True))
    for tangent in (False, True):
        texts.append(unit_before(equations, number, kind, states, tangent))
        if states:
            texts.append(unit_loop(equations, number, kind, rates, "rates", tangent))
    texts.append(unit_observe(equations, number, kind, states))
    return texts


def unit_drive(equations: Equations, number: int, kind: UnitKind) -> str:
    """Drive stage: writes the unit's share of its group's drives."""
    body = Body(equations)
    stage = kind.stages["drive"]
    body.load(kind.columns, used_by(stage) | {"parallel_sarcomeres"}, "p[o + ")
    if "parallel_sarcomeres" not in kind.columns:
        body.add("parallel_sarcomeres = 1.0")
    body.compute(stage)
    if kind.groupable:
        column = kind.columns.index("parallel_sarcomeres")
        body.add(f"out[do] += force_frequency_factor * parallel_sarcomeres / p[group + {column}]")
    else:
        body.add(*(f"out[do + {i}] = {name}" for i, name in enumerate(kind.drives)))
    body.add("return 0")
    return body.function(f"unit{number}_drive", "activation, p, o, group, do, out")


def unit_before(equations: Equations, number: int, kind: UnitKind, states: list[str], tangent: bool) -> str:
    """Before stage: what does not need the fibre velocity goes into w."""
    body = Body(equations)
    stage = kind.stages["before"]
    used = used_by(stage) | set(kind.kept)
    body.load(kind.columns, used, "p[o + ")
    body.load(kind.drives, used, "d[do + ")
    body.load(states, used, "x[xo + ")
    if tangent:
        body.load_tangents(kind.drives, used, "d_t[do + ")
        body.load_tangents(states, used, "x_t[xo + ")
        body.active |= {"fibre_length"} | (set() if kind.steady_activation else {"activation"})
    body.compute(stage)
    count = len(kind.kept)
    for i, name in enumerate(kind.kept):
        body.add(f"w[wo + {i}] = {name}")
        if tangent:
            body.add(f"w[wo + {count + i}] = {body.slope(name)}")
    body.add("return 0")
    if tangent:
        arguments = "fibre_length, d_fibre_length, activation, d_activation, p, o, x, x_t, xo, d, d_t, do, w, wo"
        return body.function(f"unit{number}_before_t", arguments)
    return body.function(f"unit{number}_before", "fibre_length, activation, p, o, x, xo, d, do, w, wo")


def force_inputs(kind: UnitKind) -> dict[str, str]:
    """What a unit's force needs beside the fibre velocity, and where it stands in p and w."""
    used = used_by(upstream(kind.stages["loop"], {"fibre_force"})) | {"fibre_force"}
    places = {name: f"p[{{o}} + {i}]" for i, name in enumerate(kind.columns)}
    places |= {name: f"w[{{wo}} + {i}]" for i, name in enumerate(kind.kept)}
    return {name: place for name, place in places.items() if name in used}


def unit_force(equations: Equations, number: int, kind: UnitKind) -> list[str]:
    """Force and its slope in the fibre velocity: from numbers, which stay in registers, and from arrays."""
    body = Body(equations, {"fibre_velocity"})
    body.compute(upstream(kind.stages["loop"], {"fibre_force"}))
    body.add(f"return fibre_force, {body.slope('fibre_force')}")
    places = force_inputs(kind)
    given = ", ".join(["fibre_velocity", "d_fibre_velocity", *places])
    arrays = Body(equations)
    found = (place.format(o="o", wo="wo") for place in places.values())
    arrays.add(f"return unit{number}_force_of({', '.join(['fibre_velocity', 'd_fibre_velocity', *found])})")
    return [
        body.function(f"unit{number}_force_of", given),
        arrays.function(f"unit{number}_force", "fibre_velocity, d_fibre_velocity, p, o, w, wo"),
    ]


def unit_loop(
    equations: Equations,
    number: int,
    kind: UnitKind,
    outputs: list[str],
    name: str,
    tangent: bool,
) -> str:
    """Loop stage, for the force or the rates, from arrays."""
    body = Body(equations)
    stage = upstream(kind.stages["loop"], set(outputs))
    used = used_by(stage) | set(outputs)
    body.load(kind.columns, used, "p[o + ")
    body.load(kind.kept, used, "w[wo + ")
    if tangent:
        count = len(kind.kept)
        body.load_tangents([""] * count + kind.kept, used, "w[wo + ")
    if tangent:
        body.active.add("fibre_velocity")
    body.compute(stage)
    if name == "force":
        body.add(f"return fibre_force, {body.slope('fibre_force')}")
        return body.function(f"unit{number}_force_t", "fibre_velocity, d_fibre_velocity, p, o, w, wo")
    for i, rate in enumerate(outputs):
        body.add(f"dx[xo + {i}] = {rate}")
        if tangent:
            body.add(f"dx_t[xo + {i}] = {body.slope(rate)}")
    body.add("return 0")
    if tangent:
        return body.function(
            f"unit{number}_rates_t",
            "fibre_velocity, d_fibre_velocity, p, o, w, wo, dx, dx_t, xo",
        )
    return body.function(f"unit{number}_rates", "fibre_velocity, p, o, w, wo, dx, xo")


def unit_observe(equations: Equations, number: int, kind: UnitKind, states: list[str]) -> str:
    """Everything that a unit shows, from its own numbers rather than its group's."""
    body = Body(equations)
    stages = [kind.stages[stage] for stage in ("drive", "before", "loop")]
    used = used_by(*stages)
    body.load(kind.columns, used, "p[o + ")
    body.load(states, used, "x[xo + ")
    for stage in stages:
        body.compute(stage)
    body.add("passive_force = passive_force_factor * maximum_passive_force")
    body.add(*(f"out[oo + {i}] = {name}" for i, name in enumerate(UNIT_OUTPUTS)))
    body.add("return 0")
    return body.function(f"unit{number}_observe", "fibre_length, fibre_velocity, activation, p, o, x, xo, out, oo")


def dispatch(name: str, count: int, call: str, indent: str) -> list[str]:
    """Lines that call function `name` of the kind in variable `kind`; {n} is its number."""
    lines = []
    for number in range(count):
        head = "if" if number == 0 else "elif"
        if count > 1:
            lines.append(f"{indent}{head} kind == {number}:")
            lines.append(f"{indent}    {call.format(name=name.format(n=number))}")
        else:
            lines.append(f"{indent}{call.format(name=name.format(n=number))}")
    return lines


def group_loops(layout: Layout) -> list[str]:
    """Functions that run over the groups of a muscle."""
    kinds = layout.unit_kinds
    groups = layout.muscles * len(MUSCLE_INDEX)
    head = [
        "    for g in range(first, last):",
        f"        r = {groups} + g * {len(GROUP_INDEX)}",
        "        kind, o, xo, do, wo = k[r], k[r + 1], k[r + 2], k[r + 3], k[r + 4]",
    ]
    texts = []
    for suffix, given, call in (
        (
            "",
            "fibre_length, activation, first, last, p, k, x, d, w",
            "{name}(fibre_length, activation, p, o, x, xo, d, do, w, wo)",
        ),
        (
            "_t",
            "fibre_length, d_fibre_length, activation, d_activation, first, last, p, k, x, x_t, d, d_t, w",
            "{name}(fibre_length, d_fibre_length, activation, d_activation, p, o, x, x_t, xo, d, d_t, do, w, wo)",
        ),
    ):
        lines = dispatch(f"unit{{n}}_before{suffix}", len(kinds), call, " " * 8)
        texts.append("\n".join([f"{INLINE}def units_before{suffix}({given}):", *head, *lines, "    return 0"]))
        lines = dispatch(
            f"unit{{n}}_force{suffix}",
            len(kinds),
            "force, slope = {name}(fibre_velocity, d_fibre_velocity, p, o, w, wo)",
            " " * 8,
        )
        texts.append(
            "\n".join(
                [
                    f"{INLINE}def units_force{suffix}(fibre_velocity, d_fibre_velocity, first, last, p, k, w):",
                    "    total = 0.0",
                    "    total_slope = 0.0",
                    "    force = 0.0",
                    "    slope = 0.0",
                    *head,
                    *lines,
                    "        total += force",
                    "        total_slope += slope",
                    "    return total, total_slope",
                ]
            )
        )
    for suffix, given, arguments in (
        ("", "fibre_velocity, first, last, p, k, w, dx", "fibre_velocity, p, o, w, wo, dx, xo"),
        (
            "_t",
            "fibre_velocity, d_fibre_velocity, first, last, p, k, w, dx, dx_t",
            "fibre_velocity, d_fibre_velocity, p, o, w, wo, dx, dx_t, xo",
        ),
    ):
        lines = []
        for number, kind in enumerate(kinds):
            if kind.system.states:
                lines += [
                    f"        if kind == {number}:",
                    f"            unit{number}_rates{suffix}({arguments})",
                ]
        body = [*head, *lines] if lines else []
        texts.append("\n".join([f"{INLINE}def units_rates{suffix}({given}):", *body, "    return 0"]))
    return [text + "\n" for text in texts]


MUSCLE_HEAD = "o, xo, do, first, last, wo = k[i + 2], k[i + 3], k[i + 4], k[i + 5], k[i + 6], k[i + 7]"


def muscle_functions(equations: Equations, number: int, kind: MuscleKind, units: Sequence[UnitKind]) -> list[str]:
    """Functions of one kind of muscle. units: all kinds of motor units."""
    return [
        muscle_drive(equations, number, kind),
        muscle_primal(equations, number, kind, units, observe=False),
        muscle_primal(equations, number, kind, units, observe=True),
        muscle_tangent(equations, number, kind),
    ]


def muscle_drive(equations: Equations, number: int, kind: MuscleKind) -> str:
    """Drive stage: writes the muscle's drives, returns the activation where it is steady."""
    body = Body(equations)
    stage = kind.stages["drive"]
    body.load(kind.columns, used_by(stage), "p[o + ")
    body.compute(stage)
    body.add(*(f"out[do + {i}] = {name}" for i, name in enumerate(kind.drives)))
    body.add(f"return {'activation' if kind.steady_activation else 'excitation'}")
    return body.function(f"muscle{number}_drive", "excitation, p, o, do, out")


def load_muscle(body: Body, kind: MuscleKind, extra: set[str]) -> list[str]:
    """Read a muscle's numbers, drives and states; the names of the states."""
    states = [state.name for state, _ in kind.system.states]
    used = used_by(*(kind.stages[stage] for stage in ("before", "loop", "after"))) | extra
    used |= {"activation"}
    body.add(MUSCLE_HEAD)
    body.load(kind.columns, used, "p[o + ")
    body.load(kind.drives, used, "d[do + ")
    body.load(states, used, "x[xo + ")
    return states


def muscle_primal(equations: Equations, number: int, kind: MuscleKind, units: Sequence[UnitKind], observe: bool) -> str:
    """Torque, and the rates of the states; with `observe` also all outputs."""
    body = Body(equations)
    extra = set(MUSCLE_OUTPUTS) if observe else set()
    states = load_muscle(body, kind, extra)
    if kind.steady_activation:
        body.add("activation = 0.0" if not observe else "activation = excitation")
        if observe:
            steady = kind.stages["drive"]
            body.load(kind.columns, used_by(steady), "p[o + ")
            body.compute(steady)
    body.compute(kind.stages["before"])
    body.add("units_before(fibre_length, activation, first, last, p, k, x, d, w)")
    gather(body, kind, units)
    if kind.closes_loop:
        newton(body, kind, units)
    else:
        body.add(*force_lines(kind, units, "0.0"), "total_fibre_force = total")
    body.compute(kind.stages["loop"])
    body.compute(kind.stages["after"])
    body.add("w[wo] = total_fibre_force", "w[wo + 1] = slope")
    for i, (state, _) in enumerate(kind.system.states):
        body.add(f"dx[xo + {i}] = {state.rate}")
    body.add("units_rates(fibre_velocity, first, last, p, k, w, dx)")
    if observe:
        defined = {bound.defines for bound in kind.system.equations} | set(states)
        defined |= {"total_fibre_force"}
        for i, name in enumerate(MUSCLE_OUTPUTS):
            body.add(f"out[oo + {i}] = {name if name in defined else '0.0'}")
        body.add("return muscle_torque")
        return body.function(
            f"muscle{number}_observe",
            "i, joint_angle, joint_velocity, excitation, p, k, x, d, w, dx, out, oo",
        )
    body.add("return muscle_torque")
    return body.function(f"muscle{number}", "i, joint_angle, joint_velocity, p, k, x, d, w, dx")


def gather(body: Body, kind: MuscleKind, units: Sequence[UnitKind]) -> None:
    """Read what the forces of the muscle's groups need from arrays, once."""
    for group, number in enumerate(kind.groups):
        body.add(f"r = GROUPS + (first + {group}) * GROUP_RECORD", "o_group, wo_group = k[r + 1], k[r + 4]")
        for name, place in force_inputs(units[number]).items():
            body.add(f"{name}_{group} = {place.format(o='o_group', wo='wo_group')}")


def force_lines(kind: MuscleKind, units: Sequence[UnitKind], velocity_slope: str) -> list[str]:
    """Lines that set `total` and its `slope`: the force of all groups, those few by their gathered numbers."""
    if not kind.groups:
        return [f"total, slope = units_force(fibre_velocity, {velocity_slope}, first, last, p, k, w)"]
    lines = []
    for group, number in enumerate(kind.groups):
        given = ", ".join(f"{name}_{group}" for name in force_inputs(units[number]))
        lines.append(f"force{group}, slope{group} = unit{number}_force_of(fibre_velocity, {velocity_slope}, {given})")
    for name, part in ("total", "force"), ("slope", "slope"):
        lines.append(f"{name} = " + " + ".join(f"{part}{group}" for group in range(len(kind.groups))))
    return lines


def newton(body: Body, kind: MuscleKind, units: Sequence[UnitKind]) -> None:
    """Find the total fibre force F that the fibres exert at the velocity that F allows.

    The force falls with the fibre velocity, which rises with F: total(F) never rises, so the root
    is unique and lies between any F and total(F). The last root found is where the search starts.
    """
    inner = Body(body.equations, {"total_fibre_force"})
    inner.compute(kind.stages["loop"])
    body.add(
        "total_fibre_force = w[wo]",
        "if not abs(total_fibre_force) < 1e300:",
        "    total_fibre_force = 0.0",
        "d_total_fibre_force = 1.0",
        "slope = 0.0",
        "low, high = -math.inf, math.inf",
        "step = step_before = math.inf",
        "squaring = False",
        "for _ in range(200):",
        *inner.lines,
        *(f"    {line}" for line in force_lines(kind, units, inner.slope("fibre_velocity"))),
        "    residual = total - total_fibre_force",
        "    if not (residual > 0.0 or residual < 0.0):",
        # Solved, or not a number, which the force then says.
        "        total_fibre_force = total",
        "        break",
        "    low = max(low, min(total_fibre_force, total))",
        "    high = min(high, max(total_fibre_force, total))",
        "    newton = residual / (1.0 - slope)",
        # Newton's steps may cross the root to and fro without coming nearer: those that do not
        # shrink by half over two steps give way to bisection.
        "    quick = low <= total_fibre_force + newton <= high and 2.0 * abs(newton) <= step_before",
        "    step_before = abs(step)",
        "    step = newton if quick else 0.5 * (low + high) - total_fibre_force",
        "    total_fibre_force += step",
        # Newton's method squares the relative error: behind such a step only rounding is left.
        "    if abs(step) <= (1e-9 if quick else 4e-16) * abs(total_fibre_force):",
        "        break",
        # Two of its steps tell the factor of the square, and with it the step that would follow.
        "    if quick and squaring and abs(step) ** 3 <= 1e-14 * abs(total_fibre_force) * step_before * step_before:",
        "        break",
        "    squaring = quick",
    )


def muscle_tangent(equations: Equations, number: int, kind: MuscleKind) -> str:
    """Derivative of torque and rates in a direction, at the force that `muscle` found."""
    body = Body(equations)
    states = load_muscle(body, kind, set())
    used = used_by(*(kind.stages[stage] for stage in ("before", "loop", "after"))) | {"activation"}
    body.load_tangents(kind.drives, used, "d_t[do + ")
    body.load_tangents(states, used, "x_t[xo + ")
    body.active |= {"joint_angle", "joint_velocity"}
    if kind.steady_activation:
        body.add("activation = 0.0")
    body.compute(kind.stages["before"])
    body.add(
        f"units_before_t(fibre_length, {body.slope('fibre_length')}, activation, "
        f"{body.slope('activation')}, first, last, p, k, x, x_t, d, d_t, w)"
    )
    body.add("total_fibre_force = w[wo]")
    force = "_, d_total_fibre_force = units_force_t(fibre_velocity, d_fibre_velocity, first, last, p, k, w)"
    body.active.add("total_fibre_force")
    if kind.closes_loop:
        body.add("d_total_fibre_force = 0.0")
        body.compute(kind.stages["loop"])
        body.add(force, "d_total_fibre_force = d_total_fibre_force / (1.0 - w[wo + 1])")
        body.compute(kind.stages["loop"])
    else:
        if "fibre_velocity" not in body.active:
            body.add("d_fibre_velocity = 0.0")
        body.add(force)
        body.compute(kind.stages["loop"])
    body.compute(kind.stages["after"])
    for i, (state, _) in enumerate(kind.system.states):
        body.add(f"dx[xo + {i}] = {state.rate}")
        body.add(f"dx_t[xo + {i}] = {body.slope(state.rate)}")
    velocity_slope = body.slope("fibre_velocity")
    body.add(
        f"units_rates_t(fibre_velocity, {velocity_slope}, first, last, p, k, w, dx, dx_t)",
        f"return muscle_torque, {body.slope('muscle_torque')}",
    )
    return body.function(
        f"muscle{number}_t",
        "i, joint_angle, d_joint_angle, joint_velocity, d_joint_velocity, p, k, x, x_t, d, d_t, w, dx, dx_t",
    )


def program(layout: Layout, entries: str) -> str:
    """The text of a limb's module.

    entries: source of the entry points, which call what is generated here.
    """
    equations = Equations()
    texts: list[str] = []
    for number, unit_kind in enumerate(layout.unit_kinds):
        texts += unit_functions(equations, number, unit_kind)
    if layout.muscles:
        texts += group_loops(layout)
    for number, muscle_kind in enumerate(layout.muscle_kinds):
        texts += muscle_functions(equations, number, muscle_kind, layout.unit_kinds)
    texts.append(dispatchers(layout))
    groups = layout.muscles * len(MUSCLE_INDEX)
    constants = {
        "N": layout.joints,
        "M": layout.muscles,
        "S": layout.states,
        "D": layout.drives,
        "W": layout.work,
        "P": layout.parameters.size,
        "K": layout.index.size,
        "MUSCLE_RECORD": len(MUSCLE_INDEX),
        "GROUPS": groups,
        "GROUP_RECORD": len(GROUP_INDEX),
        "UNITS": groups + layout.groups * len(GROUP_INDEX),
        "UNIT_RECORD": len(UNIT_INDEX),
        "UNIT_COUNT": layout.units,
        "MUSCLE_OUTPUTS": len(MUSCLE_OUTPUTS),
        "UNIT_OUTPUTS": len(UNIT_OUTPUTS),
        "FIBRE_LENGTH": MUSCLE_OUTPUTS.index("fibre_length"),
        "FIBRE_VELOCITY": MUSCLE_OUTPUTS.index("fibre_velocity"),
        "ACTIVATION": MUSCLE_OUTPUTS.index("activation"),
        "STEADY": 1 if all(kind.steady_activation for kind in layout.muscle_kinds) else 0,
    }
    lines = [f"{name} = {value}" for name, value in constants.items()]
    lines += [f"{name} = {value!r}" for name, value in sorted(equations.constants.items())]
    head = "import math\n\nimport numpy as np\nfrom numba import carray, njit\n\n"
    return head + "\n".join(lines) + "\n\n\n" + "\n\n".join([*equations.texts, *texts, entries])


def dispatchers(layout: Layout) -> str:
    """Functions that call the right kind of unit or muscle."""
    muscles, units = len(layout.muscle_kinds), len(layout.unit_kinds)
    parts = []
    for name, target, count, given, back in (
        ("muscle", "muscle{n}", muscles, "i, q, v, p, k, x, d, w, dx", "0.0"),
        (
            "muscle_t",
            "muscle{n}_t",
            muscles,
            "i, q, d_q, v, d_v, p, k, x, x_t, d, d_t, w, dx, dx_t",
            "0.0, 0.0",
        ),
        (
            "muscle_observe",
            "muscle{n}_observe",
            muscles,
            "i, q, v, excitation, p, k, x, d, w, dx, out, oo",
            "0.0",
        ),
        ("muscle_drive", "muscle{n}_drive", muscles, "excitation, p, o, do, out", "0.0"),
        ("unit_drive", "unit{n}_drive", units, "activation, p, o, group, do, out", "0"),
        (
            "unit_observe",
            "unit{n}_observe",
            units,
            "length, velocity, activation, p, o, x, xo, out, oo",
            "0",
        ),
    ):
        lines = dispatch(target, count, "return {name}(" + given + ")", "    ")
        parts.append("\n".join([f"{FORCED}def {name}(kind, {given}):", *lines, f"    return {back}"]) + "\n")
    return "\n\n".join(parts)
