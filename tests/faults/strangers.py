"""Messages of strangers to real nodes: nothing changes, or it is said."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from limb_nodes.exchange.identity import bytes_of
from limb_nodes.foundation.topics import exchanged
from tests.faults.forged import FORGERS
from tests.faults.trial import Trial

KIND = "messages of strangers, real nodes"
TOPICS = ("activation", "limb_state", "joint_torque", "movement_pattern")
KINDS = [(topic, kind) for kind in FORGERS for topic in TOPICS]
MODES = ("lockstep", "realtime")
COUNT = len(KINDS) * len(MODES)
ROOT = Path(__file__).resolve().parents[2]
LIMB, WAVES = str(ROOT / "params/reference_joint_tendon.yaml"), str(ROOT / "params/activation_sine_cosine.yaml")
RATE, SECONDS = 200.0, 0.6
# The tick at which strangers come.
AT = 40


def trials(count: int, seed: int) -> Iterator[Trial]:
    """Try the kinds in both modes, from the seed on."""
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    with tempfile.TemporaryDirectory(prefix="limb_strangers_") as place:
        os.environ.setdefault("ROS_LOG_DIR", place)
        _, expected, _ = run(Path(place) / "whole", "lockstep", None)
        for number in range(seed - 1, seed - 1 + count):
            (topic, kind), mode = KINDS[number // len(MODES) % len(KINDS)], MODES[number % len(MODES)]
            counts, found, failed = run(Path(place) / f"run{number}", mode, (topic, kind))
            # A run that a copy of its identity has disturbed ends with a line if it cannot go on.
            told = failed or counts["conflicts"] + counts["bad_input"] + counts["foreign"] > 0
            # A copy of what came, or what came first and is the same, changes nothing and need not be told.
            same = mode == "realtime" or all(np.array_equal(found[name], values) for name, values in expected.items())
            whole = len(found["joint_states"]) == round(RATE * SECONDS) + 1 and np.isfinite(found["joint_states"]).all()
            yield Trial(f"{kind} on {topic} in {mode}, trial {number + 1}", changed=not (told or (same and whole)))


def run(out: Path, mode: str, stranger: tuple[str, str] | None) -> tuple[dict[str, int], dict[str, Any], bool]:
    """A run of real nodes in this process with a stranger: what they have counted, what is recorded, whether it failed.

    One that hangs is given up by `Bench.until`.
    """
    from limb_nodes.bags.read import BagReader
    from limb_nodes.nodes.messages import class_of
    from limb_nodes.nodes.qos import STREAM
    from limb_nodes.nodes.session import CLASSES
    from limb_nodes.nodes.settings import RunSettings, checked
    from tests.graph.conftest import Bench

    ready, _ = checked(RunSettings(LIMB, WAVES, rate=RATE, duration=SECONDS, out=str(out), mode=mode, stall_limit=5.0))
    graph = Bench()
    try:
        nodes = {name: graph.add(kind, **ready.parameters(name)) for name, kind in CLASSES.items()}
        graph.until(lambda: nodes["limb_dynamics"].part.tick >= AT, f"tick {AT}")
        if stranger is not None:
            topic, kind = stranger
            part = nodes["limb_dynamics"].part
            publisher = graph.publisher(class_of(topic), exchanged(topic), STREAM)
            form = part.forms[topic]
            newest = bytearray(form.data)
            newest[form.run] = bytes_of(part.identity)
            newest[4:12] = np.array(divmod(part.tick * part.ticks.nanoseconds, 10**9), dtype="<u4").tobytes()
            if "tick" in form.numbers:
                start = form.numbers["tick"][0]
                newest[start : start + 8] = int(part.tick).to_bytes(8, "little")
            if "last_tick" in form.numbers:
                start = form.numbers["last_tick"][0]
                newest[start : start + 8] = round(RATE * SECONDS).to_bytes(8, "little")
            for message in FORGERS[kind](form, bytes(newest), part.ticks.nanoseconds):
                publisher.publish(message)
        graph.until(lambda: nodes["recorder"].finished or any(node.failure for node in nodes.values()), "the end")
        names = ("conflicts", "bad_input", "foreign")
        counts = {name: sum(getattr(node.part, name) for node in nodes.values()) for name in names}
        failed = any(node.failure for node in nodes.values())
        graph.finish(nodes["recorder"])
    finally:
        graph.close()
    fields = {"joint_states": "position", "joint_torque": "torque", "activation": "activation"}
    with BagReader(out) as bag:
        return counts, {topic: bag.table(topic)[field] for topic, field in fields.items()}, failed
