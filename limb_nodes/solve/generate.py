"""Writes the program of a limb: one Python module of scalar code, specialised to its laws.

The text of every equation is copied from its function, together with the tangents that Newton's
method and the slopes need, so the program depends on nothing that its content hash does not
cover, and numba's cache on disk serves every later process.
"""

from __future__ import annotations

import ast
from collections.abc import Iterable, Sequence

import numpy as np

from limb_nodes.levels.equation import ScalarFunction
from limb_nodes.levels.tangent import (
    function_tree,
    global_constants,
    helper_functions,
    tangent_source,
)
from limb_nodes.model.kinds import MuscleKind, TissueKind, UnitKind
from limb_nodes.model.layout import Layout
from limb_nodes.model.system import BoundEquation
from limb_nodes.solve.data import data_type
from limb_nodes.solve.outputs import CROSSING_OUTPUTS, LENGTHS, MUSCLE_OUTPUTS, UNIT_OUTPUTS

# The arguments of all functions that are generated, one of each for every kind of muscle, motor unit or tissue.
# own: the record of the muscle, the group or (drive, observe) the motor unit; of the muscle in the functions `units_`,
#   which run over its groups. group: the record of the unit's group.
# fibre_length, activation, ...: numbers (SI), and with d_ in front their tangents.
# y: joint angles, then joint velocities; what follows is not read.
# internal, rates: internal states of the limb and, to be filled in, their rates.
# model, data: see `Layout` and `data_type`.
# out: what is filled in: drives, or a row of what is shown. crossings: the rows of all muscles' joints.
ARGUMENTS = {
    "unit_drive": "own, activation, group, model, out",
    "unit_before": "own, fibre_length, activation, internal, model, data",
    "unit_before_t": "own, fibre_length, d_fibre_length, activation, d_activation, internal, model, data",
    "unit_force": "own, fibre_velocity, d_fibre_velocity, model, data",
    "unit_force_t": "own, fibre_velocity, d_fibre_velocity, model, data",
    "unit_rates": "own, fibre_velocity, rates, model, data",
    "unit_rates_t": "own, fibre_velocity, d_fibre_velocity, model, data",
    "unit_observe": "own, fibre_length, fibre_velocity, activation, internal, group, model, out",
    "muscle_drive": "own, excitation, model, out",
    "muscle": "own, y, internal, rates, model, data",
    "muscle_t": "own, y, internal, model, data",
    "muscle_lengths": "own, y, internal, model, out",
    "tissue": "own, joint_angle, joint_velocity, model",
    "tissue_t": "own, joint_angle, d_joint_angle, joint_velocity, d_joint_velocity, model",
    "muscle_observe": "own, y, excitation, internal, model, data, out, crossings",
}

PRELUDE = "import math\n\nimport numpy as np\nfrom numba import carray, from_dtype, njit\n"
DECORATORS = """
# Never called from Python: entries for that would take a part of the time to compile.
inline = njit(error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
forced = njit(error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True, forceinline=True)
entry = njit(error_model="numpy", cache=True, nogil=True)
"""


def numbered(name: str, number: int) -> str:
    """The function `name` of one kind: unit_drive of kind 2 is unit2_drive."""
    level, _, what = name.partition("_")
    return f"{level}{number}_{what}".rstrip("_")


def call(name: str, number: int, **others: str) -> str:
    """A call of the function `name` of one kind with the variables of its arguments' names, or with others."""
    given = (others.get(argument, argument) for argument in ARGUMENTS[name].split(", "))
    return f"{numbered(name, number)}({', '.join(given)})"


def call_loop(name: str, **others: str) -> str:
    """A call of the loop of `name` over a muscle's groups."""
    return call(name, 0, **others).replace("unit0", "units", 1)


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
            self.texts.append("@inline\n" + self.text(function, active, self.names[key]))
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

    def load(self, names: list[str], used: set[str], array: str, offset: str, prefix: str = "") -> None:
        """Read those of `names` that are used from an array, from its place `offset` on. prefix: of the variables."""
        self.add(*(f"{prefix}{n} = {array}[{offset} + {i}]" for i, n in enumerate(names) if n in used))

    def load_tangents(self, names: list[str], used: set[str], array: str, offset: str) -> None:
        """The same for their tangents; the variables become active."""
        self.load(names, used, array, offset, "d_")
        self.active |= set(names) & used

    def compute(self, bound: Iterable[BoundEquation], indent: str = "") -> None:
        """Evaluate equations in order, with tangents if something active goes in."""
        for item in bound:
            function = item.equation.function
            varying = frozenset(
                argument
                for argument, symbol in zip(item.equation.arguments, item.symbols, strict=True)
                if symbol in self.active
            )
            given = []
            for argument, symbol in zip(item.equation.arguments, item.symbols, strict=True):
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

    def function(self, name: str, number: int) -> str:
        """The whole text of the function `name` of one kind."""
        return self.text(numbered(name, number), ARGUMENTS[name])

    def text(self, name: str, arguments: str) -> str:
        """The whole text of a function."""
        return "\n".join([f"@inline\ndef {name}({arguments}):", *self.lines]) + "\n"


def used_by(*stages: Iterable[BoundEquation]) -> set[str]:
    """All symbols on the right-hand sides of some stages."""
    return {symbol for stage in stages for bound in stage for symbol in bound.symbols}


def upstream(bound: list[BoundEquation], wanted: set[str]) -> list[BoundEquation]:
    """Those of some equations on which wanted variables depend, in order."""
    used, kept = set(wanted), []
    for item in reversed(bound):
        if item.defines in used:
            used.update(item.symbols)
            kept.append(item)
    return kept[::-1]


def unit_functions(equations: Equations, number: int, kind: UnitKind, looped: bool) -> list[str]:
    """Functions of one kind of motor unit. looped: whether a muscle's groups are not written out."""
    states = [state.name for state, _ in kind.system.states]
    rates = [state.rate for state, _ in kind.system.states]
    texts = [unit_drive(equations, number, kind), unit_force_of(equations, number, kind)]
    if looped:
        texts.append(unit_force(equations, number, kind))
    texts.append(unit_force_t(equations, number, kind))
    for tangent in (False, True):
        texts.append(unit_before(equations, number, kind, states, tangent))
        if states:
            texts.append(unit_rates(equations, number, kind, rates, tangent))
    texts.append(unit_observe(equations, number, kind, states))
    return texts


def unit_drive(equations: Equations, number: int, kind: UnitKind) -> str:
    """Drive stage: writes the unit's share of its group's drives."""
    body = Body(equations)
    stage = kind.stages["drive"]
    body.load(kind.columns, used_by(stage) | {"parallel_sarcomeres"}, "model.parameters", "own.parameters")
    if "parallel_sarcomeres" not in kind.columns:
        body.add("parallel_sarcomeres = 1.0")
    body.compute(stage)
    if kind.groupable:
        column = kind.columns.index("parallel_sarcomeres")
        whole = f"model.parameters[group.parameters + {column}]"
        body.add(f"out[group.drive] += force_frequency_factor * parallel_sarcomeres / {whole}")
    else:
        body.add(*(f"out[group.drive + {i}] = {name}" for i, name in enumerate(kind.drives)))
    body.add("return 0")
    return body.function("unit_drive", number)


def unit_before(equations: Equations, number: int, kind: UnitKind, states: list[str], tangent: bool) -> str:
    """Before stage: what does not need the fibre velocity goes into the scratch numbers."""
    body = Body(equations)
    stage = kind.stages["before"]
    used = used_by(stage) | set(kind.kept)
    body.load(kind.columns, used, "model.parameters", "own.parameters")
    body.load(kind.drives, used, "data.drives", "own.drive")
    body.load(states, used, "internal", "own.state")
    if tangent:
        body.load_tangents(kind.drives, used, "data.drives_t", "own.drive")
        body.load_tangents(states, used, "data.internal_t", "own.state")
        body.active |= {"fibre_length"} | (set() if kind.steady_activation else {"activation"})
    body.compute(stage)
    count = len(kind.kept)
    body.add("scratch = data.scratch")
    for i, name in enumerate(kind.kept):
        body.add(f"scratch[own.scratch + {i}] = {name}")
        if tangent:
            body.add(f"scratch[own.scratch + {count + i}] = {body.slope(name)}")
    body.add("return 0")
    return body.function("unit_before_t" if tangent else "unit_before", number)


def force_inputs(kind: UnitKind) -> dict[str, str]:
    """What a unit's force needs beside the fibre velocity, and its place for the group {own}."""
    used = used_by(upstream(kind.stages["loop"], {"fibre_force"})) | {"fibre_force"}
    places = {name: f"model.parameters[{{own}}.parameters + {i}]" for i, name in enumerate(kind.columns)}
    places |= {name: f"data.scratch[{{own}}.scratch + {i}]" for i, name in enumerate(kind.kept)}
    return {name: place for name, place in places.items() if name in used}


def unit_force_of(equations: Equations, number: int, kind: UnitKind) -> str:
    """Force and its slope in the fibre velocity from numbers, which stay in registers."""
    body = Body(equations, {"fibre_velocity"})
    body.compute(upstream(kind.stages["loop"], {"fibre_force"}))
    body.add(f"return fibre_force, {body.slope('fibre_force')}")
    return body.text(f"unit{number}_force_of", ", ".join(["fibre_velocity", "d_fibre_velocity", *force_inputs(kind)]))


def unit_force(equations: Equations, number: int, kind: UnitKind) -> str:
    """The same from the arrays."""
    body = Body(equations)
    given = [place.format(own="own") for place in force_inputs(kind).values()]
    body.add(f"return unit{number}_force_of({', '.join(['fibre_velocity', 'd_fibre_velocity', *given])})")
    return body.function("unit_force", number)


def loop_stage(equations: Equations, kind: UnitKind, outputs: set[str], tangent: bool) -> Body:
    """The equations of the loop stage that some outputs need, with what they need from the arrays."""
    body = Body(equations)
    stage = upstream(kind.stages["loop"], outputs)
    used = used_by(stage) | outputs
    body.load(kind.columns, used, "model.parameters", "own.parameters")
    body.load(kind.kept, used, "data.scratch", "own.scratch")
    if tangent:
        body.load_tangents(kind.kept, used, "data.scratch", f"own.scratch + {len(kind.kept)}")
        body.active.add("fibre_velocity")
    body.compute(stage)
    return body


def unit_force_t(equations: Equations, number: int, kind: UnitKind) -> str:
    """Force and its tangent, that of lengths, states and drives included."""
    body = loop_stage(equations, kind, {"fibre_force"}, tangent=True)
    body.add(f"return fibre_force, {body.slope('fibre_force')}")
    return body.function("unit_force_t", number)


def unit_rates(equations: Equations, number: int, kind: UnitKind, rates: list[str], tangent: bool) -> str:
    """Rates of the unit's states; the tangents go, as the rates that belong to them, into `data`."""
    body = loop_stage(equations, kind, set(rates), tangent)
    target = "data.rates" if tangent else "rates"
    for i, rate in enumerate(rates):
        body.add(f"{target}[own.state + {i}] = {rate}")
        if tangent:
            body.add(f"data.rates_t[own.state + {i}] = {body.slope(rate)}")
    body.add("return 0")
    return body.function("unit_rates_t" if tangent else "unit_rates", number)


def unit_observe(equations: Equations, number: int, kind: UnitKind, states: list[str]) -> str:
    """Everything that a unit shows, from its own numbers rather than its group's."""
    body = Body(equations)
    stages = [kind.stages[stage] for stage in ("drive", "before", "loop")]
    used = used_by(*stages)
    body.load(kind.columns, used, "model.parameters", "own.parameters")
    body.load(states, used, "internal", "group.state")
    for stage in stages:
        body.compute(stage)
    body.add("passive_force = passive_force_factor * maximum_passive_force")
    body.add(*(f"out[{i}] = {name}" for i, name in enumerate(UNIT_OUTPUTS)))
    body.add("return 0")
    return body.function("unit_observe", number)


def by_kind(record: str, lines: dict[int, list[str]], indent: str, kinds: int) -> list[str]:
    """Lines for each kind, chosen by the kind of a record. kinds: how many there are."""
    if kinds == 1:
        return [indent + line for own in lines.values() for line in own]
    chosen = []
    for place, (number, own) in enumerate(lines.items()):
        chosen.append(f"{indent}{'elif' if place else 'if'} {record}.kind == {number}:")
        chosen += [f"{indent}    {line}" for line in own]
    return chosen


def loop(name: str, kinds: dict[int, UnitKind], count: int, total: bool = False) -> str:
    """A function that runs the functions `name` of these kinds, of `count` in all, over the groups of a muscle.

    total: whether they return a force and its slope, which are summed.
    """
    start = ["    total, total_slope, force, slope = 0.0, 0.0, 0.0, 0.0"] if total else []
    each = "force, slope = {}" if total else "{}"
    calls = {number: [each.format(call(name, number, own="group"))] for number in kinds}
    lines = by_kind("group", calls, " " * 8, count)
    sums = ["        total += force", "        total_slope += slope"] if total else []
    return "\n".join(
        [
            f"@inline\ndef {name.replace('unit', 'units', 1)}({ARGUMENTS[name]}):",
            *start,
            "    for g in range(own.group, own.group_end):",
            "        group = model.groups[g]",
            *lines,
            *sums,
            f"    return {'total, total_slope' if total else '0'}\n",
        ]
    )


def group_loops(units: Sequence[UnitKind], looped: bool) -> list[str]:
    """Functions that run over the groups of a muscle. looped: whether groups of a muscle are not written out."""
    kinds, count = dict(enumerate(units)), len(units)
    moving = {number: kind for number, kind in kinds.items() if kind.system.states}
    texts = [loop("unit_before", kinds, count), loop("unit_before_t", kinds, count)]
    if looped:
        texts.append(loop("unit_force", kinds, count, total=True))
    texts.append(loop("unit_force_t", kinds, count, total=True))
    if moving:
        texts += [loop("unit_rates", moving, count), loop("unit_rates_t", moving, count)]
    return texts


def muscle_functions(equations: Equations, number: int, kind: MuscleKind, units: Sequence[UnitKind]) -> list[str]:
    """Functions of one kind of muscle. units: all kinds of motor units."""
    return [
        muscle_drive(equations, number, kind),
        muscle_primal(equations, number, kind, units),
        muscle_lengths(equations, number, kind),
        muscle_observe(equations, number, kind, units),
        muscle_tangent(equations, number, kind, units),
    ]


def muscle_drive(equations: Equations, number: int, kind: MuscleKind) -> str:
    """Drive stage: writes the muscle's drives, returns the activation if it is steady."""
    body = Body(equations)
    stage = kind.stages["drive"]
    body.load(kind.columns, used_by(stage), "model.parameters", "own.parameters")
    body.compute(stage)
    body.add(*(f"out[own.drive + {i}] = {name}" for i, name in enumerate(kind.drives)))
    body.add(f"return {'activation' if kind.steady_activation else 'excitation'}")
    return body.function("muscle_drive", number)


def load_muscle(body: Body, kind: MuscleKind, extra: set[str]) -> set[str]:
    """Read a muscle's numbers, drives and states; the names of all that is used."""
    used = used_by(*(kind.stages[stage] for stage in ("before", "loop", "after"))) | extra | {"activation"}
    body.load(kind.columns, used, "model.parameters", "own.parameters")
    body.load(kind.drives, used, "data.drives", "own.drive")
    body.load([state.name for state, _ in kind.system.states], used, "internal", "own.state")
    load_joints(body, kind, used)
    return used


def load_joints(body: Body, kind: MuscleKind, used: set[str], tangents: bool = False) -> None:
    """Read angles and velocities of the muscle's joints, as far as they are used; tangents: theirs as well."""
    for place, one in enumerate(kind.crossings):
        body.add(f"joint{one} = model.crossings[own.crossing + {place}].joint")
        for name, shift in (f"joint_angle{one}", ""), (f"joint_velocity{one}", "JOINTS + "):
            if name in used:
                body.add(f"{name} = y[{shift}joint{one}]")
                if tangents:
                    body.add(f"d_{name} = data.joints_t[{shift}joint{one}]")
                    body.active.add(name)


def solve_muscle(body: Body, kind: MuscleKind, units: Sequence[UnitKind]) -> None:
    """From the activation to the torque and the rates of the states."""
    body.compute(kind.stages["before"])
    body.add(call_loop("unit_before"))
    gather(body, kind, units)
    if kind.closes_loop:
        newton(body, kind, units)
    else:
        body.add(*force_lines(kind, units, "0.0"), "total_fibre_force = total")
    body.compute(kind.stages["loop"])
    body.compute(kind.stages["after"])
    body.add("data.scratch[own.scratch] = total_fibre_force", "data.scratch[own.scratch + 1] = slope")
    for i, (state, _) in enumerate(kind.system.states):
        body.add(f"rates[own.state + {i}] = {state.rate}")
    if any(unit.system.states for unit in units):
        body.add(call_loop("unit_rates"))


def muscle_primal(equations: Equations, number: int, kind: MuscleKind, units: Sequence[UnitKind]) -> str:
    """Adds to the torque about each joint, and tells the rates of the states."""
    body = Body(equations)
    load_muscle(body, kind, set())
    if kind.steady_activation:
        body.add("activation = 0.0")
    solve_muscle(body, kind, units)
    body.add(*(f"data.torque[joint{one}] += muscle_torque{one}" for one in kind.crossings), "return 0")
    return body.function("muscle", number)


def muscle_observe(equations: Equations, number: int, kind: MuscleKind, units: Sequence[UnitKind]) -> str:
    """Everything that a muscle shows."""
    body = Body(equations)
    load_muscle(body, kind, set(MUSCLE_OUTPUTS) | {f"moment_arm{one}" for one in kind.crossings})
    if kind.steady_activation:
        body.add("activation = excitation")
        steady = kind.stages["drive"]
        body.load(kind.columns, used_by(steady), "model.parameters", "own.parameters")
        body.compute(steady)
    body.add("rates = data.rates")
    solve_muscle(body, kind, units)
    for place, one in enumerate(kind.crossings):
        body.add(f"shown = crossings[own.crossing + {place}]")
        body.add(*(f"shown[{i}] = {name}{one}" for i, name in enumerate(CROSSING_OUTPUTS)))
    show(body, kind, MUSCLE_OUTPUTS)
    return body.function("muscle_observe", number)


def muscle_lengths(equations: Equations, number: int, kind: MuscleKind) -> str:
    """The lengths of a muscle, which need no force."""
    body = Body(equations)
    stage = upstream(kind.stages["before"], set(LENGTHS))
    used = used_by(stage) | set(LENGTHS)
    body.load(kind.columns, used, "model.parameters", "own.parameters")
    body.load([state.name for state, _ in kind.system.states], used, "internal", "own.state")
    load_joints(body, kind, used)
    body.compute(stage)
    show(body, kind, LENGTHS)
    return body.function("muscle_lengths", number)


def show(body: Body, kind: MuscleKind, outputs: Sequence[str]) -> None:
    """Fill in outputs; what a muscle does not have is 0."""
    defined = {bound.defines for bound in kind.system.equations} | {state.name for state, _ in kind.system.states}
    defined |= {"total_fibre_force"}
    for i, name in enumerate(outputs):
        body.add(f"out[{i}] = {name if name in defined else '0.0'}")
    body.add("return 0")


def gather(body: Body, kind: MuscleKind, units: Sequence[UnitKind]) -> None:
    """Read what the forces of the muscle's groups need from arrays, once."""
    for group, number in enumerate(kind.groups):
        body.add(f"group{group} = model.groups[own.group + {group}]")
        for name, place in force_inputs(units[number]).items():
            body.add(f"{name}_{group} = {place.format(own=f'group{group}')}")


def force_lines(kind: MuscleKind, units: Sequence[UnitKind], velocity_slope: str) -> list[str]:
    """Lines that set `total` and its `slope`: the force of all groups, those few by their gathered numbers."""
    if not kind.groups:
        return [f"total, slope = {call_loop('unit_force', d_fibre_velocity=velocity_slope)}"]
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
    is unique and lies between any F and total(F). The search starts at the last root.
    """
    inner = Body(body.equations, {"total_fibre_force"})
    inner.compute(kind.stages["loop"])
    body.add(
        "total_fibre_force = data.scratch[own.scratch]",
        "if not abs(total_fibre_force) < 1e300:",
        "    total_fibre_force = 0.0",
        "d_total_fibre_force = 1.0",
        "slope = 0.0",
        "low, high = -math.inf, math.inf",
        "step = step_before = math.inf",
        "squaring = found = False",
        "for _ in range(200):",
        *inner.lines,
        *(f"    {line}" for line in force_lines(kind, units, inner.slope("fibre_velocity"))),
        "    if found:",
        "        break",
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
        "    found = abs(step) <= 4e-16 * abs(total_fibre_force)",
        "    if quick:",
        "        found = found or abs(residual) <= 1e-9 * abs(total_fibre_force)",
        # Two of its steps tell the factor of the square, and with it the step that would follow.
        "        if squaring and abs(step) ** 3 <= 1e-14 * abs(total_fibre_force) * step_before * step_before:",
        "            found = True",
        "    squaring = quick",
        # Beside a weak damper little changes of the force are much of velocity: the slope must be that of the root.
        f"    if found and slope > -100.0 and abs(step * {inner.slope('fibre_velocity')}) < 1e-6:",
        "        break",
    )


def muscle_tangent(equations: Equations, number: int, kind: MuscleKind, units: Sequence[UnitKind]) -> str:
    """Derivative of torques and rates in a direction, at the force that `muscle` has left in the scratch numbers."""
    body = Body(equations)
    used = load_muscle(body, kind, set())
    body.load_tangents(kind.drives, used, "data.drives_t", "own.drive")
    body.load_tangents([state.name for state, _ in kind.system.states], used, "data.internal_t", "own.state")
    load_joints(body, kind, used, tangents=True)
    if kind.steady_activation:
        body.add("activation = 0.0")
    body.compute(kind.stages["before"])
    tangents = {"d_fibre_length": body.slope("fibre_length"), "d_activation": body.slope("activation")}
    body.add(call_loop("unit_before_t", **tangents), "total_fibre_force = data.scratch[own.scratch]")
    force = f"_, d_total_fibre_force = {call_loop('unit_force_t')}"
    body.active.add("total_fibre_force")
    if kind.closes_loop:
        body.add("d_total_fibre_force = 0.0")
        body.compute(kind.stages["loop"])
        body.add(force, "d_total_fibre_force = d_total_fibre_force / (1.0 - data.scratch[own.scratch + 1])")
        body.compute(kind.stages["loop"])
    else:
        if "fibre_velocity" not in body.active:
            body.add("d_fibre_velocity = 0.0")
        body.add(force)
        body.compute(kind.stages["loop"])
    body.compute(kind.stages["after"])
    for i, (state, _) in enumerate(kind.system.states):
        body.add(f"data.rates[own.state + {i}] = {state.rate}")
        body.add(f"data.rates_t[own.state + {i}] = {body.slope(state.rate)}")
    if any(unit.system.states for unit in units):
        body.add(call_loop("unit_rates_t", d_fibre_velocity=body.slope("fibre_velocity")))
    body.add(
        *(f"data.torque_t[joint{one}] += {body.slope(f'muscle_torque{one}')}" for one in kind.crossings), "return 0"
    )
    return body.function("muscle_t", number)


def tissue_function(equations: Equations, number: int, kind: TissueKind, tangent: bool) -> str:
    """The moment of a tissue, or its derivative in a direction."""
    body = Body(equations, ("joint_angle", "joint_velocity") if tangent else ())
    stage = kind.stages["loop"]
    body.load(kind.columns, used_by(stage), "model.parameters", "own.parameters")
    body.compute(stage)
    body.add(f"return {body.slope('passive_moment') if tangent else 'passive_moment'}")
    return body.function("tissue_t" if tangent else "tissue", number)


def dispatcher(name: str, kinds: int) -> str:
    """A function that calls the function `name` of the kind of its first argument."""
    result = "0.0" if name in ("muscle_drive", "tissue", "tissue_t") else "0"
    lines = by_kind("own", {number: [f"return {call(name, number)}"] for number in range(kinds)}, "    ", kinds)
    return "\n".join([f"@forced\ndef {name}({ARGUMENTS[name]}):", *lines, f"    return {result}\n"])


def record_text(kind: np.dtype[np.void]) -> str:
    """The type of a record as text."""
    fields = []
    for name in kind.names or ():
        field = kind[name]
        base = record_text(field.base) if field.base.names else f'"{field.base.str}"'
        fields.append(f'("{name}", {base}, {field.shape})')
    return f"np.dtype([{', '.join(fields)}])"


def program(layout: Layout, imports: str, entries: str) -> str:
    """The text of a limb's module.

    imports: of what the entry points need. entries: their source; they call what is generated here.
    """
    equations = Equations()
    texts: list[str] = []
    looped = any(not kind.groups for kind in layout.muscle_kinds)
    for number, unit_kind in enumerate(layout.unit_kinds):
        texts += unit_functions(equations, number, unit_kind, looped)
    if layout.muscles:
        texts += group_loops(layout.unit_kinds, looped)
    for number, muscle_kind in enumerate(layout.muscle_kinds):
        texts += muscle_functions(equations, number, muscle_kind, layout.unit_kinds)
    for number, tissue_kind in enumerate(layout.tissue_kinds):
        texts += [tissue_function(equations, number, tissue_kind, tangent) for tangent in (False, True)]
    for name in ("tissue", "tissue_t"):
        texts.append(dispatcher(name, len(layout.tissue_kinds)))
    for name in ("muscle", "muscle_t", "muscle_lengths", "muscle_observe", "muscle_drive"):
        texts.append(dispatcher(name, len(layout.muscle_kinds)))
    for name in ("unit_drive", "unit_observe"):
        texts.append(dispatcher(name, len(layout.unit_kinds)))
    constants: dict[str, object] = {
        "JOINTS": layout.joints,
        "MUSCLES": layout.muscles,
        "UNITS": layout.units,
        "TISSUES": layout.tissues,
        "STATES": layout.states,
        "DRIVES": layout.drives,
        "LENGTHS": len(LENGTHS),
        "FIBRE_LENGTH": MUSCLE_OUTPUTS.index("fibre_length"),
        "FIBRE_VELOCITY": MUSCLE_OUTPUTS.index("fibre_velocity"),
        "ACTIVATION": MUSCLE_OUTPUTS.index("activation"),
        **dict(sorted(equations.constants.items())),
    }
    lines = [f"{name} = {value!r}" for name, value in constants.items()]
    lines.append(f"MODEL = from_dtype({record_text(layout.model.kind)})")
    lines.append(f"DATA = from_dtype({record_text(data_type(layout))})")
    head = "\n".join([PRELUDE, imports, DECORATORS, *lines])
    return head + "\n\n\n" + "\n\n".join([*equations.texts, *texts, entries])
