"""Somebody's files: limbs and bags that name code, in every way, given to every command that takes them."""

from __future__ import annotations

import py_compile
import random
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import product
from typing import Any

from mcap.writer import Writer as McapWriter

from limb_nodes.bags.types import make_message
from limb_nodes.bags.write import BagWriter
from tests.faults.ground import LAW, PARAMS, SOURCE, Attempt, Ground, done, either, limb_with, refused, tried
from tests.faults.trial import Trial

KIND = "code of somebody's limb or bag"


@dataclass(frozen=True)
class Way:
    """A way to have a limb name code: `law` in its file; `files` of code below the trial's folder."""

    name: str
    law: str
    files: tuple[str, ...] = ()
    prepare: Callable[[Ground], None] = lambda ground: None


def link(ground: Ground) -> None:
    """The law's file is a link."""
    ground.plant("elsewhere.py")
    (ground.folder / "there" / "evil.py").symlink_to(ground.folder / "elsewhere.py")


def install(ground: Ground) -> None:
    """The law is installed."""
    ground.environment["PYTHONPATH"] += f":{ground.folder / 'site'}"


def compile_only(ground: Ground) -> None:
    """There is bytecode alone."""
    source = ground.folder / "there" / "evil.py"
    ground.plant("there/evil.py")
    py_compile.compile(str(source), cfile=f"{source}c")
    source.unlink()


WAYS = (
    Way("beside the limb", "evil:bell", ("there/evil.py",)),
    Way("beside the limb, named as a file", "evil.py:bell", ("there/evil.py",)),
    Way("in the working folder", "evil:bell", ("here/evil.py",)),
    Way("a package beside", "lab.evil:bell", ("there/lab/__init__.py", "there/lab/evil.py")),
    Way("a package without __init__", "lab.evil:bell", ("there/lab/evil.py",)),
    Way("the __init__ of a package", "lab:bell", ("here/lab/__init__.py",)),
    Way("installed", "evil:bell", ("site/evil.py",), install),
    Way("in an installed package", "lab.evil:bell", ("site/lab/__init__.py", "site/lab/evil.py"), install),
    Way("a link", "evil:bell", (), link),
    Way("bytecode", "evil:bell", (), compile_only),
    Way("a name of this package", "limb_nodes.evil:bell", ("there/limb_nodes/evil.py", "here/limb_nodes/evil.py")),
    Way("a name of a package in use", "numpy.evil:bell", ("there/numpy/__init__.py", "there/numpy/evil.py")),
    Way("a name of Python's", "sched:bell", ("there/sched.py", "here/sched.py")),
    Way("an absolute path", "{there}/evil:bell", ("there/evil.py",)),
    Way("a path upwards", "../there/evil:bell", ("there/evil.py",)),
    Way("dots in front", "..there.evil:bell", ("there/evil.py", "here/there/evil.py")),
)
RUN = ("run", "../there/limb.yaml", "--activation", SOURCE, "--duration", "0.1", "--out", "out")
TAKE_LIMB = {
    "simulate": ("simulate", *RUN[1:6]),
    "run": RUN,
    "run --processes": (*RUN, "--processes"),
    "curves": ("curves", "../there/limb.yaml", "-o", "out.png"),
    "muscle": ("muscle", "../there/limb.yaml", "flexor", "--activation", "0.5"),
    "structure": ("structure", "../there/limb.yaml"),
    "verify": ("verify", "--whole", "--case", "3.6-range", "--limbs", "../there"),
}
BAG = "../there/bag"
OPEN_BAG = {
    "plot": ("plot", BAG, "-o", "out.png"),
    "export": ("export", BAG, "-o", "out.csv"),
    "recover": ("recover", BAG, "-o", "out"),
    "trust --show": ("trust", BAG, "--show"),
    "trust": ("trust", BAG),
    "emg": ("emg", BAG, "--topic", "activation", "-o", "out"),
    "play": ("play", BAG, "--topic", "activation", "--wait", "0.1"),
    "simulate": ("simulate", str(PARAMS / "reference_joint.yaml"), "--activation", BAG, "--duration", "0.05"),
}
RERUN = ("rerun", BAG, "--out", "out")
NODES = ("activation_input", "muscle_stack", "limb_dynamics", "recorder")


def name_code(ground: Ground, way: Way) -> str:
    """Plant, and write the limb; its text."""
    ground.plant(*way.files)
    way.prepare(ground)
    text = limb_with(way.law.format(there=ground.folder / "there"))
    for name in ("limb", "reference_joint", "reference_joint_tendon"):
        ground.plant(f"there/{name}.yaml", text=text)
    return text


def take_limb(way: Way, command: str, ground: Ground) -> bool:
    """A command is given a limb that names code: one line."""
    name_code(ground, way)
    return refused(*ground.limb(*TAKE_LIMB[command]))


def take_limb_as_node(way: Way, node: str, ground: Ground) -> bool:
    """A node is given it: one line."""
    name_code(ground, way)
    start = f"import sys; sys.path.pop(0); from limb_nodes.nodes.{node} import main; main()"
    return refused(*ground.run("-c", start, "--ros-args", "-p", f"limb:={ground.folder}/there/limb.yaml"))


def write_bag(ground: Ground, info: dict[str, Any]) -> None:
    """A small bag of a run; info: what is in its run_info beside the usual."""
    parameters = {"muscle_stack": {"state_every": 1, "publish_muscle_state": False}}
    with BagWriter(ground.folder / "there" / "bag", {"rate": 100.0, "parameters": parameters, **info}) as bag:
        for tick in range(11):
            stamp = tick * 10_000_000
            values = {"tick": tick, "last_tick": 10, "name": ["flexor", "extensor"], "activation": [0.5, 0.1]}
            bag.write("activation", stamp, make_message("limb_msgs/msg/MuscleActivation", stamp, **values))
            state = {"name": ["joint"], "position": [0.1], "velocity": [0.0]}
            bag.write("joint_states", stamp, make_message("sensor_msgs/msg/JointState", stamp, **state))


def open_bag(way: Way, command: str, ground: Ground) -> bool:
    """A bag's limb names code: in the bag, beside the file that it is said to come from, in the working folder."""
    text = name_code(ground, way)
    laws = {name.partition("/")[2]: ground.evil for name in way.files}
    write_bag(ground, {"limb": text, "limb_file": str(ground.folder / "there" / "limb.yaml"), "laws": laws})
    if command == "rerun":
        return refused(*ground.limb(*RERUN))
    return either(*ground.limb(*OPEN_BAG[command]))


def unpack_outside(name: str, ground: Ground) -> bool:
    """A bag's law lies outside of the folder of its limb: one line, and nothing is written there."""
    place = name.format(home=ground.folder / "home")
    write_bag(ground, {"limb": limb_with("evil:bell"), "limb_file": "..", "laws": {place: ground.evil}})
    before = set(ground.folder.rglob("*.py"))
    return refused(*ground.limb(*RERUN)) and set(ground.folder.rglob("*.py")) == before


def generate_reader(schema: tuple[str, str, str], command: str, ground: Ground) -> bool:
    """A reader is generated from what a bag says of a type, which holds code. schema: encoding, name, definition."""
    code = f"open({str(ground.mark)!r},'w')"
    encoding, name, text = (part.replace("CODE", code) for part in schema)
    (ground.folder / "there" / "bag").mkdir()
    with (ground.folder / "there" / "bag" / "bag.mcap").open("wb") as file:
        writer = McapWriter(file)
        writer.start(profile="ros2", library="trial")
        channel = writer.register_channel("/activation", "cdr", writer.register_schema(name, encoding, text.encode()))
        writer.add_message(channel, 0, b"\0\1\0\0" + bytes(64), 0)
        writer.finish()
    return either(*ground.limb(*OPEN_BAG[command]))


TYPE = "limb_msgs/msg/MuscleActivation"
SCHEMAS = (
    ("ros2msg", TYPE, "float64[] activation\nstring name 'x'\nstring A='\"\"\"+str(CODE)+\"\"\"'"),
    ("ros2msg", TYPE, "float64[] a=CODE"),
    ("ros2msg", TYPE, "float64[] a\nint8 A=CODE"),
    ("ros2msg", TYPE, "float64 a\n" + "=" * 80 + "\nMSG: lab/msg/B: CODE #\nfloat64 b"),
    ("ros2msg", TYPE, "float64[CODE] a"),
    ("ros2msg", TYPE, 'lab/"),CODE,("[] a'),
    ("ros2msg", f"{TYPE}:\n    CODE\n", "float64 a"),
    ("ros2msg", f"{TYPE}\nCODE", "float64 a"),
    ("ros2msg", 'lab/msg/A"""\nCODE\n"""', "float64 a"),
    ("ros2idl", "lab/msg/A", 'module lab { module msg { struct A { @default (value=CODE) double a; }; }; };'),
    ("ros2idl", "lab/msg/A", 'module a { const string X = "\\"+CODE+\\""; struct A { double a; }; };'),
    ("ros2idl", "lab/msg/A", "module lab { module msg { struct A { double a[CODE]; }; }; };"),
    ("ros2idl", "lab/msg/A", "module lab { module msg { struct A { lab::CODE a; }; }; };"),
)  # fmt: skip


# With consent: exactly what was trusted runs.


def trust_then(change: Callable[[Ground], None], ground: Ground) -> bool:
    """Trusted code is changed afterwards: one line."""
    ground.plant("there/law.py", text=f"import helper\n{LAW}")
    ground.plant("there/helper.py", text="x = 1\n")
    ground.plant("there/limb.yaml", text=limb_with("law:bell"))
    if not (done(*ground.limb("trust", "../there/limb.yaml")) and done(*ground.limb(*TAKE_LIMB["structure"]))):
        return False
    change(ground)
    return refused(*ground.limb(*TAKE_LIMB["structure"]))


def loosen(path: str, mode: int) -> Callable[[Ground], None]:
    """Let others write to where trust is kept."""
    return lambda ground: (ground.folder / "home" / ".local" / "state" / path).chmod(mode)


def link_trust(ground: Ground) -> None:
    """Trust is kept behind a link."""
    file = ground.folder / "home" / ".local" / "state" / "limb_nodes" / "trusted_laws"
    file.rename(ground.folder / "tmp" / "list")
    file.symlink_to(ground.folder / "tmp" / "list")


CHANGES: dict[str, Callable[[Ground], None]] = {
    "the law": lambda ground: ground.plant("there/law.py"),
    "what it imports": lambda ground: ground.plant("there/helper.py"),
    "what it imports becomes a package": lambda ground: ground.plant("there/helper/__init__.py"),
    "a blank": lambda ground: ground.plant("there/helper.py", text="x = 1 \n"),
    "its list, which others may write": loosen("limb_nodes/trusted_laws", 0o622),
    "its list's folder, which a group may write": loosen("limb_nodes", 0o770),
    "its list's folder's folder, which others may write": loosen(".", 0o777),
    "its list, now a link": link_trust,
}


def plant_bytecode(ground: Ground) -> bool:
    """Bytecode of other code lies beside a trusted law, as if Python had written it: the law runs, not this."""
    ground.plant("there/law.py", text=LAW)
    ground.plant("there/limb.yaml", text=limb_with("law:bell"))
    law, evil = ground.folder / "there" / "law.py", ground.folder / "evil.py"
    ground.plant("evil.py")
    mode = py_compile.PycInvalidationMode.UNCHECKED_HASH
    py_compile.compile(str(evil), cfile=py_compile.compile(str(law)), invalidation_mode=mode)
    return done(*ground.limb(*TAKE_LIMB["structure"], "--allow-laws"))


def import_unlisted(how: str, ground: Ground) -> bool:
    """Trusted code imports, by a name that stands nowhere, another file beside it: one line."""
    ground.plant("there/law.py", text=f"{how}\n{LAW}")
    ground.plant("there/evil.py")
    ground.plant("there/limb.yaml", text=limb_with("law:bell"))
    return refused(*ground.limb(*TAKE_LIMB["structure"], "--allow-laws"))


def attempts() -> Iterator[tuple[str, Attempt]]:
    """All of them."""
    for way, command in product(WAYS, TAKE_LIMB):
        yield f"limb {command}, the law is {way.name}", partial(take_limb, way, command)
    for way, node in product(WAYS[:3], NODES):
        yield f"node {node}, the law is {way.name}", partial(take_limb_as_node, way, node)
    for way, command in product(WAYS, (*OPEN_BAG, "rerun")):
        yield f"limb {command} of a bag, the law is {way.name}", partial(open_bag, way, command)
    for place in ("../evil.py", "{home}/evil.py", "a/../../evil.py", "\0.py", ".", "", "a" * 300 + ".py"):
        yield f"limb rerun, a law at {place[:20]!r}", partial(unpack_outside, place)
    for schema, command in product(SCHEMAS, ("plot", "export", "recover", "emg")):
        yield (
            f"limb {command}, a type {schema[1][:20]!r} defined as {schema[2][:40]!r}",
            partial(generate_reader, schema, command),
        )
    for what, change in CHANGES.items():
        yield f"trusted, then changed: {what}", partial(trust_then, change)
    yield "bytecode beside a trusted law", plant_bytecode
    for how in ("__import__('ev' + 'il')", "import importlib; importlib.import_module('ev' + 'il')"):
        yield f"a law with {how}", partial(import_unlisted, how)


COUNT = len(list(attempts()))


def trials(count: int, seed: int) -> Iterator[Trial]:
    """Some or all of them, in an order by the seed."""
    every = list(attempts())
    random.Random(seed).shuffle(every)
    return tried(every[:count])
