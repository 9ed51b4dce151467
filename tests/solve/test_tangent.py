"""Forward differentiation of laws: every equation that comes with the program, and every construct."""

import math
from pathlib import Path

import numpy as np
import pytest

from limb_nodes.levels import CONTRACTS, REGISTRY, motor_unit, muscle, sarcomere
from limb_nodes.levels.tangent import UnsupportedCode, tangent_source
from limb_nodes.model import load_limb, with_values
from limb_nodes.model.system import muscle_system, tissue_system, unit_system
from limb_nodes.solve.whole import WholeModel

PARAMS = Path(__file__).parents[2] / "params"
LAWS = [law for process in REGISTRY.values() for law in process.values()]


class Tangents:
    """Tangents of functions and of their helpers, compiled by Python."""

    def __init__(self) -> None:
        self.space: dict = {"math": math}
        self.known: dict = {}

    def name(self, function) -> str:
        name = f"plain_{id(function)}"
        self.space[name] = function
        return name

    def tangent(self, function, active: frozenset[str]) -> str:
        key = (function, active)
        if key not in self.known:
            self.known[key] = f"tangent_{len(self.known)}"
            source = tangent_source(function, active, self.known[key], self.tangent, self.name)
            numbers = {k: v for k, v in function.__globals__.items() if isinstance(v, int | float)}
            self.space.update(numbers)
            exec(source, self.space)
        return self.known[key]

    def __call__(self, function, values: dict[str, float], direction: dict[str, float]) -> tuple[float, float]:
        """Value and derivative at arguments, in a direction given for some of them."""
        arguments = []
        for name, value in values.items():
            arguments += [value, direction[name]] if name in direction else [value]
        return self.space[self.tangent(function, frozenset(direction))](*arguments)


def differences(function, values: dict[str, float], direction: dict[str, float], step: float) -> float:
    """Central difference of sixth order."""

    def at(part: float) -> float:
        return function(*(v + part * step * direction.get(name, 0.0) for name, v in values.items()))

    return (45 * (at(1) - at(-1)) - 9 * (at(2) - at(-2)) + (at(3) - at(-3))) / (60 * step)


def agrees(tangents: Tangents, function, values: dict[str, float], direction: dict[str, float]) -> bool | None:
    """Whether a tangent is the slope; None where a kink or the end of the domain lies close by."""
    try:
        fine, coarse = (differences(function, values, direction, step) for step in (1e-4, 2e-4))
        plain = function(*values.values())
    except (ValueError, ZeroDivisionError, OverflowError):
        return None
    if any(isinstance(number, complex) or not math.isfinite(number) for number in (fine, coarse, plain)):
        return None
    size = max(abs(fine), abs(coarse), 1e-4 * abs(plain), 1e-280)
    if abs(fine - coarse) > 1e-6 * size:
        return None
    value, slope = tangents(function, values, direction)
    assert value == pytest.approx(plain, rel=1e-12, abs=1e-300)
    return abs(slope - fine) <= 3e-6 * size


# Required parameters, and the inputs of the two systems, from limbs as they are.
RANGES = {
    "fibre_length": (0.05, 0.17),
    "fibre_velocity": (-0.08, 0.08),
    "activation": (0.05, 1.0),
    "excitation": (0.05, 1.0),
    "joint_angle": (-1.2, 1.2),
    "joint_velocity": (-4.0, 4.0),
    "total_fibre_force": (1.0, 90.0),
}
NUMBERS = {
    "role": 1.0,
    "series_sarcomeres": 42000.0,
    "parallel_sarcomeres": 1e14,
    "minimum_frequency": 5.0,
    "maximum_frequency": 15.0,
    "pcsa": 1e-4,
    "maximum_passive_force": 30.0,
    "unit_threshold": 0.1,
    "unit_rank": 0.5,
    "path__moment_arm": 0.0215,
    "path__proximal_distance": 0.1,
    "path__distal_distance": 0.03,
    "tendon__slack_length": 0.03,
    "tendon__maximum_force": 100.0,
    "tissue__stiffness": 30.0,
    "tissue__stop_angle": 0.1,
    "tissue__upper_angle": 1.0,
    "tissue__upper_growth": 4.0,
    "tissue__lower_angle": -0.5,
    "tissue__lower_growth": 3.0,
    "aponeurosis__slack_length": 0.06,
    "aponeurosis__stiffness": 1e6,
    "aponeurosis__area": 1.2e-3,
    "aponeurosis__thickness": 0.012,
    "aponeurosis__angle": 0.3,
}


def system_around(law):
    """The system of a unit or muscle that has this law and, for the rest, the defaults."""
    owner = CONTRACTS[law.process].owner
    if owner == "joint":
        return tissue_system(law), {law.process: law}
    laws = {
        process: REGISTRY[process][contract.absent or contract.default]
        for process, contract in CONTRACTS.items()
        if contract.owner == owner
    }
    laws[law.process] = law
    return (unit_system if owner == "motor_unit" else muscle_system)(laws), laws


def parameters_of(laws) -> dict[str, float]:
    found = {}
    for process, law in laws.items():
        shared = sarcomere.PARAMETERS if process == "sarcomere" else ()
        own = (*shared, *law.parameters)
        for parameter in own:
            name = f"{process}__{parameter.name}"
            if name in NUMBERS:
                found[name] = NUMBERS[name]
            elif isinstance(parameter.default, int | float):
                found[name] = float(parameter.default)
            elif isinstance(parameter.default, str):
                found[name] = found[f"{process}__{parameter.default}"]
            else:
                pytest.fail(f"give {name} a typical value in NUMBERS")
    return found


@pytest.mark.parametrize("law", LAWS, ids=lambda law: f"{law.process}:{law.name}")
def test_tangents_of_a_registered_law(law):
    """Each equation in each argument that can vary and in a mixed direction, at values that belong together."""
    system, laws = system_around(law)
    roots = system.dependence()
    rng = np.random.default_rng(7)
    tangents, tried, left_out = Tangents(), 0, 0
    constants = {**{k: v for k, v in NUMBERS.items() if "__" not in k}, **parameters_of(laws)}
    for _ in range(25):
        values = dict(constants)
        values |= {name: rng.uniform(*RANGES[name]) for name in system.inputs}
        waiting = list(system.ordered())
        # States may start from what the law computes from its parameters.
        for state, process in system.states:
            low, high = laws[process].ranges.get(state.name, (None, None))
            initial = constants.get(f"{process}__{state.initial}")
            if low is None and initial:
                low, high = 1.001 * initial, 1.05 * initial
            elif low is None:
                low, high = 0.1, 0.3
            values[state.name] = rng.uniform(low, high)
        for bound in waiting:
            function = bound.equation.function
            names = bound.equation.arguments
            given = {name: values[symbol] for name, symbol in zip(names, bound.symbols, strict=True)}
            values[bound.defines] = function(*given.values())
            if bound.process != law.process:
                continue
            # Relative to its size, so that quantities of all magnitudes can be mixed.
            varying = [n for n, symbol in zip(names, bound.symbols, strict=True) if roots[symbol]]
            sizes = {name: abs(given[name]) * rng.uniform(0.5, 2.0) for name in varying if given[name]}
            directions = [{name: size} for name, size in sizes.items()]
            if len(sizes) > 1:
                directions.append({name: size * rng.choice([-1, 1]) for name, size in sizes.items()})
            for direction in directions:
                good = agrees(tangents, function, given, direction)
                tried += good is not None
                left_out += good is None
                assert good is not False, f"equation {bound.equation.number} in {sorted(direction)} at {given}"
    assert tried >= 3 * left_out


LEVELS = [*motor_unit.EQUATIONS, *muscle.EQUATIONS, *sarcomere.EQUATIONS]


@pytest.mark.parametrize("equation", LEVELS, ids=lambda equation: equation.number)
def test_tangents_of_the_levels(equation):
    rng, tangents = np.random.default_rng(3), Tangents()
    for _ in range(20):
        # Any numbers will do, in rising order so that fibre lengths are as they should.
        values = dict(zip(equation.uses, np.sort(rng.uniform(0.5, 3.0, len(equation.uses))), strict=True))
        for name in equation.uses:
            assert agrees(tangents, equation.function, values, {name: 1.0}) is not False


SCALE = 2.5


def helper(x, y):
    return x * y + SCALE


def each_function(x):
    return (
        math.exp(x)
        + math.expm1(2 * x)
        + math.log(x)
        + math.log1p(x)
        + math.sqrt(x)
        + math.sin(3 * x)
        + math.cos(2 * x)
        + math.tan(x)
        + math.asin(x)
        + math.acos(0.5 * x)
        + math.atan(4 * x)
        + math.sinh(x)
        + math.cosh(x)
        + math.tanh(2 * x)
        + math.fabs(x - 2)
        + math.erf(x)
    )


def two_arguments(x, y):
    return math.atan2(x, y) + math.hypot(x, y) * math.pow(x, 2.5)


def powers(x, y):
    return x**y + y**3 + 2**x + x**-1.5


def branches(x, y):
    z = x
    if x > y:
        z = x * x
        z += y
    elif x > 0.3:
        z = -z
    else:
        pass
    return z if z > 0.1 else z - x / y


def ends(x, y):
    return min(x, y) * max(x, 2 * y) + abs(x - y) - +x


def helpers(x, y):
    a = helper(x, 2.0)
    b: float = helper(a, y)
    return helper(helper(x, y), SCALE) - b


def late(x, y):
    """A variable becomes active in one branch only."""
    z = 1.0
    if y > 0.5:
        z = x
    w = z * y
    return w


@pytest.mark.parametrize("function", [each_function, two_arguments, powers, branches, ends, helpers, late])
def test_constructs(function):
    rng = np.random.default_rng(1)
    names = function.__code__.co_varnames[: function.__code__.co_argcount]
    tangents, tried = Tangents(), 0
    for _ in range(200):
        values = {name: rng.uniform(0.05, 0.95) for name in names}
        for direction in ({names[0]: 1.0}, {names[-1]: 1.0}, {name: rng.uniform(-1, 1) for name in names}):
            good = agrees(tangents, function, values, direction)
            assert good is not False, (values, direction)
            tried += good is True
    assert tried > 400


def loops(x):
    for _ in range(3):
        x = x * x
    return x


def containers(x):
    return [x][0]


def foreign(x):
    return np.sin(x)


def unknown(x):
    return print(x)


def keyword(x):
    return helper(x=x, y=x)


def gamma(x):
    return math.gamma(x)


@pytest.mark.parametrize("function", [loops, containers, foreign, unknown, keyword, gamma])
def test_code_outside_the_subset_is_refused_by_name(function):
    with pytest.raises(UnsupportedCode, match=function.__name__):
        Tangents()(function, {"x": 0.5}, {"x": 1.0})


LOADED = """
import numpy as np
from limb_nodes.levels import Law, Parameter, equation

@equation("table", "slack")
def slack(tenths):
    return float(np.sum([0.1 for _ in range(int(tenths))]))

@equation("parabola", "passive_force_factor")
def parabola(fibre_length_norm, slack):
    stretch = max(0.0, fibre_length_norm - slack)
    return (stretch / (2.0 - slack)) ** 2

tabulated = Law("passive_force", "tabulated", (slack, parabola), (Parameter("tenths", "1", "tenths", 8.0),))
"""


def test_an_equation_of_parameters_alone_is_not_compiled(tmp_path):
    """It may use what compiled code may not; its law then moves the limb as one that has the number itself."""
    (tmp_path / "loaded.py").write_text(LOADED, encoding="utf-8")
    (tmp_path / "limb.yaml").write_text((PARAMS / "reference_joint.yaml").read_text(encoding="utf-8"), encoding="utf-8")
    limb = load_limb(tmp_path / "limb.yaml", allow_laws=True)
    ends = []
    for law in ({"law": "loaded:tabulated"}, {"law": "quadratic", "slack_length": 0.8}, {"law": "quadratic"}):
        changed = with_values(limb, {"unit_kinds.slow.passive_force": law}, allow_laws=True)
        ends.append(WholeModel(changed).simulate(np.full((11, 2), 0.5), 100.0).angle[-1, 0])
    assert ends[0] == pytest.approx(ends[1], rel=1e-12)
    assert ends[2] != pytest.approx(ends[1], rel=1e-6)
