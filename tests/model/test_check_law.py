"""Laws are checked when a limb is loaded: what is refused, in which words, and what is not."""

import math
import random
from pathlib import Path

import pytest

from limb_nodes.errors import UserError
from limb_nodes.levels import REGISTRY, Parameter
from limb_nodes.levels.sarcomere import PARAMETERS as FILAMENTS
from limb_nodes.model import ChosenLaw, load_limb, with_values
from limb_nodes.model.check_law import Same, fault
from limb_nodes.model.curve_checks import kink_fault
from limb_nodes.model.probe import Probe, given

LIMB = (Path(__file__).parents[2] / "params" / "reference_joint_tendon.yaml").read_text(encoding="utf-8")

UNIT_LAWS = """
import math
import numpy as np
from limb_nodes.levels import Parameter, law

@law("force_length", Parameter("width", "1", "width", 0.5, above=0.0))
def bell(fibre_length_norm, width):
    return math.exp(-(((fibre_length_norm - 1.0) / width) ** 2))

@law("force_length")
def negative(fibre_length_norm):
    return 1.5 - fibre_length_norm

@law("force_length")
def root(fibre_length_norm):
    return math.sqrt(1.5 - fibre_length_norm)

@law("force_length")
def power(fibre_length_norm):
    return (1.5 - fibre_length_norm) ** 0.5

@law("force_length")
def pole(fibre_length_norm):
    return 1.0 / (fibre_length_norm - 1.0) ** 2

@law("force_length")
def array(fibre_length_norm):
    return np.exp(-fibre_length_norm)

@law("force_length")
def loop(fibre_length_norm):
    total = 0.0
    for _ in range(3):
        total += fibre_length_norm
    return total

@law("force_length")
def unknown_name(fibre_length_norm):
    return fibre_length_norm * STIFFNESS

@law("force_length")
def unknown_variable(fibre_size):
    return fibre_size

@law("force_length")
def nothing(fibre_length_norm):
    pass

@law("passive_force")
def falling(fibre_length_norm):
    return 2.0 - fibre_length_norm

@law("force_frequency")
def offset(frequency_norm):
    return 0.1 + frequency_norm

@law("force_frequency")
def hump(frequency_norm):
    return math.sin(2.5 * frequency_norm)

@law("recruitment")
def reversed_order(activation):
    return 10.0 * (1.0 - activation)
"""

SARCOMERES = """
import math
from limb_nodes.levels import Equation, Law, Parameter, State

FORCE = Parameter("force", "N", "isometric force", 1e-12, above=0.0)

def isometric(force):
    return force

def make(function, **more):
    defined = Equation("F0", "maximum_sarcomere_force", isometric), Equation("F", "sarcomere_force", function)
    return Law("sarcomere", function.__name__, defined, (FORCE,), **more)

def kinked_force(sarcomere_velocity, force):
    velocity = sarcomere_velocity / 2e-6
    return force * (1.0 - velocity) if velocity > 0.0 else force * (1.0 - 1.01 * velocity)

def jumping_force(sarcomere_velocity, force):
    velocity = sarcomere_velocity / 2e-6
    return force * (1.0 - velocity) if velocity > 0.0 else force * (1.001 - velocity)

def rising_force(sarcomere_velocity, force):
    velocity = sarcomere_velocity / 2e-6
    return force * (1.0 - velocity + 0.5 * velocity * velocity)

def root_force(sarcomere_velocity, force):
    return force * math.sqrt(1.0 - sarcomere_velocity / 2e-5)

def steep_force(sarcomere_velocity, force):
    return force * (1.0 - math.atan(sarcomere_velocity / 1e-8))

kinked, jumping, rising, root, steep = (
    make(f) for f in (kinked_force, jumping_force, rising_force, root_force, steep_force)
)
rooted_within_its_range = make(root_force, ranges={"sarcomere_velocity": (-2e-6, 2e-6)})

def lagging_force(lagged, force):
    return force * lagged

def lagged_rate(lagged, sarcomere_velocity):
    return math.log(sarcomere_velocity) - lagged

def start(force):
    return 1.0

equations = (
    Equation("F0", "maximum_sarcomere_force", isometric),
    Equation("F", "sarcomere_force", lagging_force),
    Equation("rate", "lagged_rate", lagged_rate),
    Equation("start", "start", start),
)
lagging = Law("sarcomere", "lagging", equations, (FORCE,), (State("lagged", "lagged_rate", "1", "start", 1.0),))
stateless = Law("sarcomere", "stateless", equations, (FORCE,))
forceless = Law("sarcomere", "forceless", equations[:1], (FORCE,))
rateless = Law("sarcomere", "rateless", equations[:2], (FORCE,), (State("lagged", "lagged_rate", "1", "force", 1.0),))
"""

MUSCLE_LAWS = """
from limb_nodes.levels import Equation, Law, Parameter, State

def pushing_velocity(tendon_force, tendon_length, length):
    return (-tendon_force + 1e5 * (tendon_length - length)) / 1e4

LENGTH = Parameter("length", "m", "length", 0.03)
pushing = Law(
    "tendon", "pushing", (Equation("v", "tendon_velocity", pushing_velocity),), (LENGTH,),
    (State("tendon_length", "tendon_velocity", "2.31", "length", 1e-2),),
)

def length(joint_angle): return 0.2 - 0.02 * joint_angle
def velocity(joint_velocity): return -0.02 * joint_velocity
def arm(joint_angle): return 0.02

inconsistent = Law("path", "inconsistent", (
    Equation("l", "muscle_tendon_length", length), Equation("v", "muscle_tendon_velocity", velocity),
    Equation("r", "moment_arm", arm)))

def downward(excitation): return 1.0 - excitation
inverted = Law("activation_dynamics", "inverted", (Equation("a", "activation", downward),))
"""

ANY_PYTHON = """
import math
import numpy as np
from limb_nodes.levels import Law, Parameter, equation

class Bell:
    def __init__(self, width):
        self.width = width

    def __call__(self, length):
        return math.exp(-((length - 1.0) / self.width) ** 2)

WIDTH = Parameter("width", "1", "width", 0.5, above=0.0)

@equation("grid", "mean")
def mean(width):
    lengths = np.linspace(0.0, 2.0, 201)
    return np.mean([Bell(width)(length) for length in lengths])

@equation("mean square", "square")
def square(mean, optimal_sarcomere_length):
    total = 0
    for part in {"a": mean, "b": mean}.values():
        total += 0.5 * part ** 2
    return np.float32(total) if optimal_sarcomere_length > 0.0 else None

@equation("bell", "force_length_factor")
def factor(fibre_length_norm, square, width):
    return square * math.exp(-(((fibre_length_norm - 1.0) / width) ** 2))

@equation("mean of a length", "mean")
def mean_of_length(width, fibre_length_norm):
    lengths = np.linspace(0.0, 2.0, 201)
    return np.mean([Bell(width)(length) for length in lengths])

@equation("mean square of a length", "square")
def looping_square(mean, optimal_sarcomere_length):
    total = 0
    for part in {"a": mean, "b": mean}.values():
        total += 0.5 * part ** 2
    return total

@equation("mean of a length", "mean")
def scalar_mean_of_length(width, fibre_length_norm):
    return width * fibre_length_norm

@equation("no number", "mean")
def text(width):
    return str(width)

free = Law("force_length", "free", (mean, square, factor), (WIDTH,))
direct = Law("force_length", "direct", (mean_of_length, square, factor), (WIDTH,))
chained = Law("force_length", "chained", (scalar_mean_of_length, looping_square, factor), (WIDTH,))
worded = Law("force_length", "worded", (text, square, factor), (WIDTH,))
"""

KIND = "unit_kinds.slow"
PSOAS = "sarcomeres.psoas"


@pytest.fixture(scope="module")
def limb(tmp_path_factory):
    folder = tmp_path_factory.mktemp("laws")
    (folder / "limb.yaml").write_text(LIMB, encoding="utf-8")
    for name, text in (
        ("unit_laws", UNIT_LAWS),
        ("sarcomeres_", SARCOMERES),
        ("muscle_laws", MUSCLE_LAWS),
        ("any_python", ANY_PYTHON),
    ):
        (folder / f"{name}.py").write_text(text, encoding="utf-8")
    return load_limb(folder / "limb.yaml", allow_laws=True)


def said(limb, place: str, law: str) -> str:
    """What is said about a law at a place, without the file and the place."""
    with pytest.raises(UserError) as caught:
        with_values(limb, {place: {"law": law}}, allow_laws=True)
    text = str(caught.value)
    assert "\n" not in text
    start = f"{limb.file}: {place}.law is "
    assert text.startswith(start), text
    return text[len(start) :]


@pytest.mark.parametrize(
    ("key", "law", "words"),
    [
        (
            "force_length",
            "negative",
            "force_length_factor is -0.01667 at fibre_length_norm 1.51667; a number >= 0 is needed",
        ),
        (
            "force_length",
            "root",
            "is not a number at fibre_length_norm 1.51667; a finite number is needed",
        ),
        (
            "force_length",
            "power",
            "is not a number at fibre_length_norm 1.51667; a finite number is needed",
        ),
        (
            "force_length",
            "pole",
            "is not a number at fibre_length_norm 1; a finite number is needed",
        ),
        (
            "force_length",
            "array",
            "it cannot be compiled: array, line 28: np.exp is not allowed; functions of math are",
        ),
        ("force_length", "loop", "it cannot be compiled: loop, line 33: For is not allowed in a law"),
        ("force_length", "unknown_name", "line 39: STIFFNESS is not allowed in a law"),
        ("force_length", "unknown_variable", "uses fibre_size; a law of force_length is given fibre_length_norm, "),
        ("force_length", "nothing", "equation nothing returns None, not a number"),
        ("passive_force", "falling", "falls between fibre_length_norm 0 and 0.0166667; a law that rises is needed"),
        ("force_frequency", "offset", "force_frequency_factor is 0.1 at stimulation_frequency 0 Hz; 0 is needed"),
        (
            "force_frequency",
            "hump",
            "between stimulation_frequency 11.3333 and 11.5 Hz; a law that rises is needed",
        ),
    ],
)
def test_unit_law_is_refused_with_the_place(limb, key, law, words):
    assert words in said(limb, f"{KIND}.{key}", f"unit_laws:{law}")


@pytest.mark.parametrize(
    ("law", "words"),
    [
        (
            "kinked",
            "sarcomere_force has a kink at sarcomere_velocity 0 m/s: its slope is -5.05e-07 below and -5e-07 above",
        ),
        ("jumping", "sarcomere_force jumps from 1.001e-12 over 1.001e-12 to 1e-12 at sarcomere_velocity 0 m/s"),
        (
            "rising",
            "sarcomere_force rises between sarcomere_velocity 1.8e-06 and 2.25e-06 m/s; a law that falls is needed",
        ),
        ("root", "sarcomere_force is not a number at sarcomere_velocity 2.025e-05 m/s; a finite number is needed"),
        ("lagging", "lagged_rate is not a number at lagged 1, sarcomere_velocity -2.7e-05 m/s"),
        ("stateless", "equation F uses lagged; a law of sarcomere is given sarcomere_length"),
        ("forceless", "it does not define sarcomere_force, which a law of sarcomere owes"),
        ("rateless", "it does not define lagged_rate, the rate of its state lagged"),
    ],
)
def test_sarcomere_law_is_refused_with_the_place(limb, law, words):
    assert words in said(limb, PSOAS, f"sarcomeres_:{law}")


@pytest.mark.parametrize(
    ("key", "law", "words"),
    [
        ("tendon", "pushing", "tendon_velocity rises between tendon_length"),
        ("path", "inconsistent", "but the length shortens by 0.02 m/s"),
        (
            "activation_dynamics",
            "inverted",
            "falls between excitation 0 and 0.05; a law that rises is needed",
        ),
    ],
)
def test_muscle_law_is_refused_with_the_place(limb, key, law, words):
    assert words in said(limb, f"muscles[1].{key}", f"muscle_laws:{law}")


def test_recruitment_law_is_refused(limb):
    words = said(limb, "muscles[0].recruitment", "unit_laws:reversed_order")
    assert "stimulation_frequency falls between activation 0 and 0.0166667" in words


@pytest.mark.parametrize(
    ("place", "law"),
    [
        (f"{KIND}.force_length", "unit_laws:bell"),
        # Very steep, yet smooth.
        (PSOAS, "sarcomeres_:steep"),
        # Not a number only outside its declared range.
        (PSOAS, "sarcomeres_:rooted_within_its_range"),
    ],
)
def test_law_is_accepted(limb, place, law):
    with_values(limb, {place: {"law": law}}, allow_laws=True)


def test_an_equation_of_parameters_alone_may_be_any_python(limb):
    law = (
        with_values(limb, {f"{KIND}.force_length": {"law": "any_python:free"}}, allow_laws=True)
        .muscles[0]
        .units[0]
        .laws["force_length"]
    )
    probe = Probe(law, given(law), {"optimal_sarcomere_length": 2.7e-6})
    grid = [math.exp(-(((0.01 * i - 1.0) / 0.5) ** 2)) for i in range(201)]
    assert probe.start["mean"] == pytest.approx(sum(grid) / 201, rel=1e-12)
    assert probe.at(fibre_length_norm=1.0)["force_length_factor"] == pytest.approx(probe.start["mean"] ** 2, rel=1e-6)


@pytest.mark.parametrize(
    ("law", "words"),
    [
        # The same code in an equation that uses a variable, at once or through another equation.
        ("direct", "it cannot be compiled: mean_of_length, line 34: np.mean is not allowed; functions of math are"),
        ("chained", "it cannot be compiled: looping_square, line 39: For is not allowed in a law"),
        ("worded", "equation no number returns '0.5', not a number"),
    ],
)
def test_an_equation_that_uses_a_variable_may_not(limb, law, words):
    assert words in said(limb, f"{KIND}.force_length", f"any_python:{law}")


@pytest.mark.parametrize("bend", [-1e-2, 1e-2, 0.5])
def test_kink_is_found_among_curvature(bend):
    def curve(x: float) -> float:
        return math.exp(-3.0 * x) - (bend * x if x > 0.0 else 0.0)

    assert "kink" in kink_fault("force", "velocity", curve, 1.0, "")
    assert kink_fault("force", "velocity", lambda x: math.exp(-3.0 * x), 1.0, "") == ""


CONTEXT = {
    **{parameter.name: parameter.default for parameter in FILAMENTS},
    "minimum_frequency": 5.0,
    "maximum_frequency": 30.0,
    "role": -1.0,
    "lowest_angle": -2.0,
    "highest_angle": 2.5,
    "optimal_length": 0.1,
}


def some_value(parameter: Parameter, chance: random.Random) -> float:
    """A value that is allowed, not far from the default or from what muscles have."""
    if isinstance(parameter.default, float):
        value = parameter.default * chance.uniform(0.7, 1.4)
    else:
        value = {"N/m^2": 2e5, "m^2": 1e-4, "N": 500.0}.get(parameter.unit, 0.05) * chance.uniform(0.7, 1.4)
    return value if parameter.accepts(value) else float(parameter.default or 0.0)


LAWS = [law for laws in REGISTRY.values() for law in laws.values()]


@pytest.mark.parametrize("law", LAWS, ids=lambda law: f"{law.process}-{law.name}")
def test_shipped_laws_pass_with_sensible_values(law):
    chance = random.Random(law.name)
    for _ in range(5):
        shared = FILAMENTS if law.process == "sarcomere" else ()
        values = {parameter.name: some_value(parameter, chance) for parameter in (*law.parameters, *shared)}
        for parameter in law.parameters:
            if isinstance(parameter.default, str):
                values[parameter.name] = values[parameter.default]
        assert fault(Same(ChosenLaw(law, values, "here")), tuple(CONTEXT.items())) == ""
