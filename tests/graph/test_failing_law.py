"""A law that gives NaN in mid-run ends the run: what, where and when is said, and what was before is kept."""

from __future__ import annotations

import numpy as np
import pytest

from limb_nodes.bags.read import BagReader
from tests.solve.broken_limb import write_broken_limb

RUN = ["--activation", "flexor=0.9,extensor=0", "--duration", "2", "--allow-laws"]


@pytest.mark.parametrize(
    ("command", "options"),
    [("simulate", []), ("run", []), ("run", ["--processes"]), ("run", ["--mode", "realtime"])],
    ids=["simulate", "one process", "four processes", "real time"],
)
def test_the_same_answer_from_every_command(command, options, processes, tmp_path):
    write_broken_limb(tmp_path, 1.24)
    out = tmp_path / "out"
    child = processes.limb(command, tmp_path / "limb.yaml", *RUN, "--out", out, *options)
    assert child.wait() == 1
    line = child.said.splitlines()[-1]
    assert line.startswith(f"limb: error: {tmp_path / 'limb.yaml'}: ")
    assert "stops at 0." in line
    assert "muscle flexor, unit unit, law breaks_off:breaks_off of force_length: force_length_factor is nan" in line
    assert str(out) in line or command == "simulate"
    assert "Traceback" not in child.said
    with BagReader(out) as bag:
        states, pattern = bag.table("joint_states"), bag.table("movement_pattern")
    assert len(states["stamp"]) > 10
    assert np.isfinite(states["position"]).all()
    assert np.isfinite(pattern["acceleration"]).all()
