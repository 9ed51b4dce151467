"""Schedules of faults in a simulated run: trial i of seed s is schedule s + i, so that each can be tried alone."""

from __future__ import annotations

import functools
import random
from collections.abc import Iterator
from pathlib import Path

from limb_nodes.exchange.past import CHECKPOINTS
from limb_nodes.exchange.stream import RECORDER_LAG
from limb_nodes.foundation.topics import NODES, RECORDED
from limb_nodes.model import load_limb
from tests.faults.forged import FORGERS
from tests.faults.simulated import (
    ALONE,
    PARENT,
    PROGRESS,
    RESPAWN,
    SILENCE,
    Fault,
    Run,
    Schedule,
    Setting,
    recorded,
    waves,
)
from tests.faults.trial import Trial

KIND = "schedules of faults, simulated"
COUNT = 10_000

LIMB = Path(__file__).resolve().parents[2] / "params" / "reference_joint_tendon.yaml"
FINAL = 30
READERS = {
    "activation": ("muscle_stack", "recorder"),
    "limb_state": ("activation_input", "muscle_stack"),
    "joint_torque": ("limb_dynamics", "recorder"),
    "limb_impact": ("muscle_stack",),
    "impact_torque": ("limb_dynamics",),
    "movement_pattern": ("recorder",),
    "muscle_state": ("recorder",),
    "motor_unit_state": ("recorder",),
    "sarcomere_state": ("recorder",),
    "muscle_checkpoint": ("recorder",),
    "limb_checkpoint": ("recorder",),
    PROGRESS: ("limb_dynamics",),
}
MESSAGE_FAULTS = ("delay", "duplicate", "reorder", "drop")
NODE_FAULTS = ("stop", "kill")
KINDS = (*MESSAGE_FAULTS, *NODE_FAULTS, "stranger")
Values = dict[tuple[str, int], bytes]


@functools.cache
def setting() -> Setting:
    """The run of all schedules."""
    limb = load_limb(str(LIMB))
    return Setting(limb, waves(FINAL + 1, len(limb.muscles)))


@functools.cache
def undisturbed(lag: int) -> Values:
    """What is recorded without faults; checkpoints are the more, the nearer the nodes are together."""
    (recorder,) = Run(setting(), Schedule(seed=0, lag=lag)).go().bags
    return recorded(recorder)


def drawn(seed: int) -> Schedule:
    """The schedule of a seed."""
    draw = random.Random(seed)
    faults = tuple(drawn_fault(draw, draw.choice(KINDS)) for _ in range(draw.randint(1, 4)))
    return Schedule(
        seed,
        faults,
        mode=draw.choice((ALONE, PARENT, RESPAWN, RESPAWN)),
        limit=draw.choice((2.0, 5.0, 30.0)),
        lag=draw.choice((4, 16, RECORDER_LAG)),
    )


def drawn_fault(draw: random.Random, kind: str) -> Fault:
    """A fault of a kind."""
    if kind in MESSAGE_FAULTS:
        topic = draw.choice(tuple(READERS))
        seconds = draw.choice((draw.uniform(0.0, 0.01), draw.uniform(0.0, 3.0)))
        return Fault(kind, topic, draw.randint(0, FINAL), draw.choice(READERS[topic]), seconds)
    at = draw.randint(0, 13 * FINAL)
    if kind == "stranger":
        topic = draw.choice(tuple(READERS))
        what = str(draw.choice((-5, 3, 10**6))) if topic == PROGRESS else draw.choice(tuple(FORGERS))
        return Fault(kind, topic, at, what=what)
    seconds = draw.choice((None, draw.uniform(0.0, 0.1), draw.uniform(0.0, 3.0), draw.uniform(3.0, 40.0)))
    return Fault(kind, draw.choice(NODES), at, seconds=seconds)


def certain(bag: Values) -> int:
    """How many ticks of a record cannot hold what only a stranger has sent: the real ones have come, too."""
    reached = min(max((tick for at, tick in bag if at == topic), default=-1) for topic in RECORDED)
    return reached + (reached == FINAL)


def judged(run: Run) -> Trial:
    """What became of a schedule."""
    expected = undisturbed(run.schedule.lag)
    bags = [recorded(bag) for bag in run.bags]
    wrong = any(expected.get(key) != data for bag in bags for key, data in bag.items() if key[1] < certain(bag))
    # Nobody waits for a checkpoint.
    short = not bags or any(key[0] not in CHECKPOINTS for key in expected.keys() ^ bags[-1].keys())
    parts = [process.part for process in run.everyone]
    failed = run.gave_up or any(process.status != 0 for process in run.everyone)
    conflicts = sum(part.conflicts for part in parts)
    missing = sum(bag.part.missing() for bag in run.bags)
    stuck = any(process.waits for process in run.everyone)
    return Trial(
        what=f"python -m tests.faults schedules --trials 1 --seed {run.schedule.seed}",
        lost=max((bag.lost for bag in run.bags), default=0.0),
        changed=(wrong and not conflicts) or (short and not (failed or missing or conflicts)),
        said=run.said,
        traceback=bool(run.tracebacks),
        hung=stuck or run.silent > SILENCE,
    )


def trials(count: int, seed: int) -> Iterator[Trial]:
    """Run the schedules of some seeds."""
    for one in range(seed, seed + count):
        yield judged(Run(setting(), drawn(one)).go())
