"""The whole-model solve against scipy's, and what it shows against the equations."""

import re
from ctypes import c_char
from pathlib import Path

import numpy as np
import pytest
from numba.np.numpy_support import as_dtype
from scipy.integrate import solve_ivp

from limb_nodes import solve
from limb_nodes.model import layout
from limb_nodes.solve.held import slope_rows
from limb_nodes.solve.outputs import CROSSING_OUTPUTS, MUSCLE_OUTPUTS, UNIT_OUTPUTS
from limb_nodes.solve.pieces import pieces, straight

LIMBS = ["reference_joint", "reference_joint_tendon", "seated_knee", "arm", "pennate_leg"]


class Program:
    """The right-hand side of a model under an input, as a function of time and state."""

    def __init__(self, model, excitation: np.ndarray, rate: float) -> None:
        self.model = model
        self.drives = model.drives(excitation)
        self.u = pieces(self.drives)
        self.rates = model.right_hand_side(self.u, 1.0 / rate)

    def __call__(self, t: float, y: np.ndarray) -> np.ndarray:
        return self.rates(t, y)


def tight(model, excitation: np.ndarray, rate: float) -> np.ndarray:
    """States [T, n] by scipy; the input bends at the samples, so each stretch between two is solved by itself."""
    program = Program(model, excitation, rate)
    states = [model.initial_state()]
    step = None
    for row in range(len(excitation) - 1):
        span = (row / rate, (row + 1) / rate)
        # Stiff limbs and soft ones: the step that served last is the first guess.
        found = solve_ivp(program, span, states[-1], "DOP853", rtol=1e-12, atol=1e-13, first_step=step)
        assert found.success
        states.append(found.y[:, -1])
        step = min(0.5 / rate, found.t[1] - found.t[0])
    return np.array(states)


@pytest.mark.parametrize("name", LIMBS)
def test_angles_are_within_1e_6_of_a_tight_solve(name, model_named, waves):
    rate, model = 200.0, model_named(name, free=True)
    time = np.arange(81) / rate
    excitation = waves(time, len(model.limb.muscles))
    found = model.simulate(excitation, rate, method="explicit")
    expected = tight(model, excitation, rate)
    n = model.layout.joints
    assert np.ptp(found.angle, axis=0).min() > 0.05
    np.testing.assert_allclose(found.angle, expected[:, :n], rtol=0, atol=1e-6)
    np.testing.assert_allclose(found.velocity, expected[:, n : 2 * n], rtol=0, atol=2e-5)
    np.testing.assert_allclose(found.internal, expected[:, 2 * n :], rtol=0, atol=1e-7)


def unit_columns(limb) -> list[slice]:
    """Columns of each muscle's units."""
    ends = np.cumsum([len(muscle.units) for muscle in limb.muscles])
    return [slice(end - len(muscle.units), end) for end, muscle in zip(ends, limb.muscles, strict=True)]


@pytest.mark.parametrize("name", LIMBS)
def test_the_loop_is_closed_and_groups_are_the_sum_of_their_units(name, model_named, waves):
    """total(v_F(F)) = F to round-off: units one by one, at the fibre velocity that the force allows."""
    rate, model = 500.0, model_named(name)
    limb = model.limb
    excitation = waves(np.arange(201) / rate, len(limb.muscles))
    found = model.simulate(excitation, rate)
    seen = found.muscle
    for m, columns in enumerate(unit_columns(limb)):
        muscle = limb.muscles[m]
        force = seen["total_fibre_force"][:, m]
        assert force.max() > 1.0
        np.testing.assert_allclose(found.unit["fibre_force"][:, columns].sum(axis=1), force, rtol=1e-11, atol=1e-9)
        # The velocity from the force: tendon by 2.30, aponeurosis by 2.32, fibres by 2.35.
        theta, muscle_length = seen["pennation_angle"][:, m], seen["muscle_length"][:, m]
        beta = np.arcsin(seen["fibre_length"][:, m] * np.sin(theta) / muscle_length)
        pull = np.maximum(0.0, force * np.cos(theta) / np.cos(beta))
        lengthening = np.zeros(force.size)
        if muscle.laws["tendon"].law.states:
            t = muscle.laws["tendon"].values
            stretch = np.maximum(0.0, seen["tendon_length"][:, m] - t["slack_length"])
            lengthening = (pull - t["stiffness"] * stretch) / t["damping"]
        spread = np.zeros(force.size)
        if muscle.laws["aponeurosis"].law.states:
            a = muscle.laws["aponeurosis"].values
            stretch = np.maximum(0.0, seen["aponeurosis_length"][:, m] - a["slack_length"])
            spread = (force * np.cos(theta) - a["stiffness"] * stretch**2) / a["viscosity"]
            area = seen["aponeurosis_length"][:, m] * seen["fibre_length"][:, m] * np.sin(theta)
            np.testing.assert_allclose(area, a["area"], rtol=1e-12)
            assert theta.min() > 0.2
        shortening = seen["muscle_tendon_velocity"][:, m] + lengthening
        velocity = spread * np.cos(theta - beta) / np.cos(beta) + shortening * np.cos(theta) / np.cos(beta)
        scale = np.abs(velocity).max() + 1e-3
        np.testing.assert_allclose(seen["tendon_velocity"][:, m], lengthening, rtol=0, atol=1e-10 * (1 + scale))
        np.testing.assert_allclose(seen["aponeurosis_velocity"][:, m], spread, rtol=0, atol=1e-10 * (1 + scale))
        np.testing.assert_allclose(seen["fibre_velocity"][:, m], velocity, rtol=0, atol=1e-10 * (1 + scale))
        np.testing.assert_allclose(seen["muscle_force"][:, m], pull, rtol=1e-12, atol=1e-9)
        role, arm = muscle.role, muscle.laws["path"].values["moment_arm"]
        np.testing.assert_allclose(seen["muscle_torque"][:, m], role * pull * arm, rtol=1e-12, atol=1e-10)


@pytest.mark.parametrize("name", ["reference_joint_tendon", "seated_knee", "pennate_leg"])
def test_the_loop_is_closed_anywhere(name, model_named):
    """At states far from any movement too: fast joints, stretched and slack tendons, any activation."""
    rng, model = np.random.default_rng(5), model_named(name)
    limb, layout = model.limb, model.layout
    n, count = layout.joints, 3000
    ranges = np.array([segment.joint_range or (-1.5, 1.5) for segment in limb.segments])
    states = np.column_stack(
        [
            rng.uniform(*ranges.T, (count, n)),
            rng.normal(size=(count, n)) * rng.choice([0.0, 1.0, 10.0], (count, 1)),
            layout.initial_states * rng.uniform(0.99, 1.04, (count, layout.states)),
        ]
    )
    muscle = np.zeros((count, layout.muscles, len(MUSCLE_OUTPUTS)))
    unit = np.zeros((count, layout.units, len(UNIT_OUTPUTS)))
    excitation = rng.uniform(0.0, 1.0, (count, layout.muscles))
    crossing = np.zeros((count, layout.crossings, len(CROSSING_OUTPUTS)))
    data = model.new_data(1.0)
    model.program.observe_all(states, excitation, layout.model.address, data.address, muscle, crossing, unit)
    total, each = muscle[:, :, MUSCLE_OUTPUTS.index("total_fibre_force")], unit[:, :, UNIT_OUTPUTS.index("fibre_force")]
    for m, columns in enumerate(unit_columns(limb)):
        solved = np.isfinite(total[:, m])
        assert solved.mean() > 0.9
        np.testing.assert_allclose(each[solved, columns].sum(axis=1), total[solved, m], rtol=1e-9, atol=1e-6)


@pytest.mark.parametrize("name", ["reference_joint_tendon", "seated_knee", "pennate_leg"])
def test_internal_states_move_at_the_velocities_that_are_shown(name, model_named, waves):
    rate, model = 2000.0, model_named(name, free=True)
    found = model.simulate(waves(np.arange(201) / rate, len(model.limb.muscles)), rate, tolerance=1e-11)
    for index, state in enumerate(found.state_names):
        muscle, quantity = state.rsplit(".", 1)
        shown = quantity.removesuffix("_length") + "_velocity"
        velocity = found.muscle[shown][:, model.limb.muscle_names.index(muscle)]
        steps = np.diff(found.internal[:, index])
        # Simpson's rule over pairs of samples.
        moved = (velocity[:-2:2] + 4 * velocity[1:-1:2] + velocity[2::2]) / (3 * rate)
        np.testing.assert_allclose(steps[::2] + steps[1::2], moved, rtol=0, atol=2e-8)


PERIOD = 1e-3


def total_torque(model, y: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Torque about each joint and its slopes [2 + 2 n, n]."""
    out = np.empty((2 + 2 * model.layout.joints, model.layout.joints))
    data = model.new_data(PERIOD)
    model.program.torque_slopes(y, u, model.layout.model.address, data.address, out)
    return out


@pytest.mark.parametrize("name", [name for name in LIMBS if name != "seated_knee"])
def test_slopes_of_the_torque(name, model_named, waves):
    """Slopes in angle, velocity and time, through the closed loop, against differences of the torque."""
    model = model_named(name, free=True)
    n, count, rate = model.layout.joints, len(model.limb.muscles), 1 / PERIOD
    excitation = waves(np.arange(101) / rate, count)
    found = model.simulate(excitation, rate)
    program = Program(model, excitation, rate)
    checked = 0
    for row in (20, 55, 90):
        y = np.concatenate([found.angle[row], found.velocity[row], found.internal[row]])
        u = np.ascontiguousarray(program.u[row : row + 1])
        slopes = total_torque(model, y, u)
        rates = program(row / rate, y)

        def torque(change: np.ndarray, later: float = 0.0, y=y, u=u) -> np.ndarray:
            drive = u.reshape(-1, 4) @ (later * rate) ** np.arange(4)
            return total_torque(model, y + change, straight(drive, drive))[0]

        def difference(change: np.ndarray, per: float, torque=torque) -> np.ndarray:
            near = torque(change, per) - torque(-change, -per)
            far = torque(2 * change, 2 * per) - torque(-2 * change, -2 * per)
            return (8 * near - far) / 12

        for block, slopes_of in enumerate(slope_rows(slopes)):
            for j in range(n):
                step = 1e-5
                found_slopes = difference(step * np.eye(y.size)[block * n + j], 0.0) / step
                np.testing.assert_allclose(slopes_of[:, j], found_slopes, rtol=1e-5, atol=1e-6)
                checked += 1
        drift = np.concatenate([np.zeros(2 * n), rates[2 * n :]])
        step = 1e-5
        np.testing.assert_allclose(slopes[1], difference(step * drift, step) / step, rtol=1e-4, atol=1e-5)
    assert checked == 6 * n


NO_NUMBA = """
from numba import from_dtype

def njit(*a, **k):
    return lambda f: f

carray = None
"""


def record_at(address: int, kind) -> np.record:
    """The record of a numba type at an address, for Python."""
    dtype = as_dtype(kind)
    return np.frombuffer((c_char * dtype.itemsize).from_address(address), dtype).view(np.recarray)[0]


def interpreted(model) -> dict:
    """The program of a model without compilation: its text, run by Python."""
    text = Path(model.program.__file__).read_text()
    text, count = re.subn(r"^from numba import .*$", NO_NUMBA, text, count=1, flags=re.MULTILINE)
    assert count == 1
    space: dict = {}
    exec(compile(text, model.program.__file__, "exec"), space)
    space["record_at"] = record_at
    for name, value in space.items():
        # Functions that compiled code alone may call.
        if getattr(value, "targetoptions", {}).get("no_cpython_wrapper"):
            space[name] = value.py_func
    return space


@pytest.mark.parametrize("name", ["reference_joint", "pennate_leg"])
def test_compiled_equals_interpreted(name, model_named, waves):
    rate, model = 500.0, model_named(name)
    count, layout = len(model.limb.muscles), model.layout
    excitation = waves(np.arange(51) / rate, count)
    found = model.simulate(excitation, rate)
    program, space = Program(model, excitation, rate), interpreted(model)
    drives = np.zeros_like(program.drives)
    space["drives"](excitation, layout.model.address, drives)
    np.testing.assert_allclose(drives, program.drives, rtol=1e-13, atol=0)
    for row in (0, 25, 50):
        y = np.concatenate([found.angle[row], found.velocity[row], found.internal[row]])
        out = np.empty(y.size)
        data = model.new_data(1 / rate)
        space["rates"](row / rate, y, program.u, layout.model.address, data.address, out)
        np.testing.assert_allclose(out, program(row / rate, y), rtol=1e-9, atol=1e-9)
        u = np.ascontiguousarray(program.u[:1])
        slopes = np.empty((2 + 2 * layout.joints, layout.joints))
        data = model.new_data(PERIOD)
        space["torque_slopes"](y, u, layout.model.address, data.address, slopes)
        np.testing.assert_allclose(slopes, total_torque(model, y, u), rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize("name", ["reference_joint", "reference_joint_tendon", "pennate_leg"])
def test_many_groups_in_a_loop_and_few_written_out_are_alike(name, model_named, waves, monkeypatch):
    written = model_named(name)
    monkeypatch.setattr(layout, "MOST_WRITTEN_OUT", 0)
    looped = model_named(name)
    assert all(kind.groups for kind in written.layout.muscle_kinds)
    assert not any(kind.groups for kind in looped.layout.muscle_kinds)
    inputs = pieces(written.drives(waves(np.arange(11) / 10.0, written.layout.muscles)))
    both = []
    for model in (written, looped):
        y, data, program = model.initial_state(), model.new_data(0.1), interpreted(model)
        out = np.empty((10, y.size))
        for row in range(10):
            program["rates"](0.1 * row, y, inputs, model.layout.model.address, data.address, out[row])
            y = y + 1e-3 * out[row]
        both.append(out)
    np.testing.assert_allclose(both[0], both[1], rtol=1e-12, atol=1e-12 * np.abs(both[0]).max())


def test_limbs_of_one_structure_share_a_program(model_named):
    name = "muscles[0].tendon.stiffness"
    one, two = model_named("reference_joint_tendon"), model_named("reference_joint_tendon", {name: 3e5})
    assert one.program is two.program
    excitation = np.full((101, 2), 0.95)
    assert np.abs(one.simulate(excitation, 100.0).angle - two.simulate(excitation, 100.0).angle).max() > 1e-4


def test_the_rate_of_the_input_is_that_of_the_output(model_named, sine_cosine):
    model = model_named("reference_joint")
    for rate in (50.0, 1000.0):
        found = model.simulate(sine_cosine(np.arange(11) / rate), rate)
        np.testing.assert_allclose(found.time, np.arange(11) / rate)
    held = np.full((2001, 2), 0.9)
    coarse, fine = model.simulate(held[:201], 100.0), model.simulate(held, 1000.0)
    np.testing.assert_allclose(coarse.angle, fine.angle[::10], atol=2e-8)


def test_accelerations_are_those_of_the_motion(model_named, sine_cosine):
    found = model_named("reference_joint").simulate(sine_cosine(np.arange(1001) / 1000), 1000.0)
    rise = (found.velocity[2:, 0] - found.velocity[:-2, 0]) * 500
    middle = found.acceleration[1:-1, 0]
    bend = np.abs(np.diff(found.acceleration[:, 0], 2))
    # But where a unit starts to fire, the acceleration jumps.
    smooth = bend < np.quantile(bend, 0.95)
    np.testing.assert_allclose(rise[smooth], middle[smooth], atol=0.02 * np.abs(middle).max())


@pytest.mark.parametrize("name", LIMBS)
def test_every_function_of_a_program_is_called(name, model_named):
    """What no limb calls is not generated: a function is named a second time, or is an entry for other modules."""
    text = Path(model_named(name).program.__file__).read_text()
    entries = set(re.findall(r"@(?:entry|callback\(\*FUNCTION\))\ndef (\w+)", text))
    functions = re.findall(r"^def (\w+)", text, flags=re.MULTILINE)
    assert len(functions) > 40
    assert [one for one in functions if one not in entries and len(re.findall(rf"\b{one}\b", text)) < 2] == []
    used = "".join(path.read_text() for path in Path(solve.__file__).parent.glob("*.py"))
    assert [one for one in entries if not re.search(rf"program\.{one}\b", used) and f"    {one}(" not in text] == []
