"""The equations of a limb with rigid tendons as plain Python, as one would write them for scipy.

Numbers stand in the text of the function, the equations are called as they are in `levels`;
nothing is compiled.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.model.layout import UnitKind, muscle_values, unit_values
from limb_nodes.model.system import BoundEquation
from limb_nodes.solve.whole import WholeModel

Rates = Callable[[float, Sequence[float]], list[float]]


class Writer:
    """Collects lines of a function and the equations that it calls."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.names: dict[str, Any] = {}

    def compute(self, stage: list[BoundEquation], numbers: dict[str, float], suffix: str) -> None:
        """Lines that evaluate equations in order."""
        for bound in stage:
            function = bound.equation.function
            name = f"f{len(self.names)}"
            self.names[name] = function
            given = ", ".join(repr(numbers[s]) if s in numbers else f"{s}{suffix}" for s in bound.symbols)
            self.lines.append(f"    {bound.defines}{suffix} = {name}({given})")


def right_hand_side(model: WholeModel, inputs: FloatArray, period: float) -> Rates:
    """Rates of the reference joint's state as a function of time and state.

    inputs: pieces of the drives. Raises ValueError for limbs of another kind.
    """
    limb, layout = model.limb, model.layout
    if len(limb.segments) != 1 or layout.states:
        raise ValueError("only one joint with rigid tendons is written out")
    writer = Writer()
    total = []
    for m, muscle in enumerate(limb.muscles):
        kind = layout.muscle_kinds[layout.index[8 * m]]
        values = muscle_values(muscle, kind)
        suffix = f"_{m}"
        writer.lines += [f"    joint_angle{suffix} = y[0]", f"    joint_velocity{suffix} = y[1]"]
        writer.compute(kind.stages["before"], values, suffix)
        forces = []
        for u, unit in enumerate(muscle.units):
            law = {name: chosen.law for name, chosen in unit.laws.items()}
            unit_kind = next(k for k in layout.unit_kinds if k.laws == law)
            own = unit_values(unit, unit_kind)
            drive = int(layout.index[8 * m + 4])
            writer.lines.append(f"    force_frequency_factor_{m}_{u} = drive({drive + u})")
            forces.append(unit_lines(writer, unit_kind, own, m, u))
        writer.lines.append(f"    total_fibre_force{suffix} = {' + '.join(forces)}")
        writer.compute(kind.stages["loop"] + kind.stages["after"], values, suffix)
        total.append(f"muscle_torque{suffix}")
    segment = limb.segments[0]
    moment = segment.mass * segment.com_distance
    inertia = segment.inertia + segment.mass * segment.com_distance**2
    text = [
        "def rates(t, y):",
        "    position = t * RATE",
        "    row = min(max(int(position), 0), LAST)",
        "    part = position - row",
        "    piece = PIECES[row]",
        "    def drive(j):",
        "        a, b, c, d = piece[j]",
        "        return a + part * (b + part * (c + part * d))",
        *writer.lines,
        f"    angle = {limb.base_angle!r} + y[0]",
        f"    gravity = {moment!r} * (cos(angle) * {limb.gravity[1]!r} - sin(angle) * {limb.gravity[0]!r})",
        f"    return [y[1], ({' + '.join(total)} + gravity + {limb.tip_torque!r}) / {inertia!r}]",
    ]
    import math

    table = [[tuple(piece) for piece in row] for row in inputs.reshape(len(inputs), -1, 4).tolist()]
    space: dict[str, Any] = {
        **writer.names,
        "RATE": 1.0 / period,
        "LAST": len(table) - 1,
        "PIECES": table,
        "cos": math.cos,
        "sin": math.sin,
    }
    exec("\n".join(text), space)
    found: Rates = space["rates"]
    return found


def unit_lines(writer: Writer, kind: UnitKind, numbers: dict[str, float], m: int, u: int) -> str:
    """Lines that evaluate one motor unit; the name of its force."""
    suffix = f"_{m}_{u}"
    for name in ("fibre_length", "fibre_velocity"):
        writer.lines.append(f"    {name}{suffix} = {name}_{m}")
    writer.compute(kind.stages["before"] + kind.stages["loop"], numbers, suffix)
    return f"fibre_force{suffix}"


def largest_difference(model: WholeModel, rates: Rates, inputs: FloatArray, period: float) -> float:
    """How far the plain rates are from the compiled ones at some states, relative to their size."""
    worst = 0.0
    out = np.empty(2)
    layout = model.layout
    for row in range(0, len(inputs), max(1, len(inputs) // 50)):
        state = np.array([0.5 + 0.3 * np.sin(row), 2.0 * np.cos(row)])
        context = model.context(0.0, period)
        model.program.rates(row * period, state, layout.parameters, layout.index, inputs, context, out)
        plain = np.array(rates(row * period, state.tolist()))
        worst = max(worst, float(np.abs(plain - out).max() / max(1.0, np.abs(out).max())))
    return worst
