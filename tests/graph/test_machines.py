"""The nodes of a run on two machines: two network namespaces and a cable between them."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import suppress

import pytest

from tests.graph.conftest import Processes
from tests.graph.test_lockstep import parameters

# The ends of the test's own cable; the middle is where it carries.
ADDRESSES = {"one": "10.213.77.1/30", "two": "10.213.77.2/30"}
PLACES = {"activation_input": "one", "muscle_stack": "one", "limb_dynamics": "two", "recorder": "two"}


def ip(*arguments: str) -> None:
    subprocess.run(["ip", *arguments], check=True, capture_output=True, text=True)


@pytest.fixture
def machines() -> Iterator[dict[str, str]]:
    """Names of two network namespaces, each with a device `cable`, and of a middle with their other ends."""
    if not shutil.which("ip"):
        pytest.skip("the command ip is not installed")
    names = {end: f"limb{os.getpid()}{end}" for end in (*ADDRESSES, "middle")}
    try:
        for name in names.values():
            try:
                ip("netns", "add", name)
                ip("netns", "exec", name, "true")
            except subprocess.CalledProcessError as problem:
                pytest.skip(f"network namespaces may not be made: {problem.stderr.strip()}")
        for end, address in ADDRESSES.items():
            name, middle = names[end], names["middle"]
            ip("-n", name, "link", "add", "cable", "type", "veth", "peer", "name", end, "netns", middle)
            ip("-n", middle, "link", "set", end, "up")
            ip("-n", name, "addr", "add", address, "dev", "cable")
            for device in "lo", "cable":
                ip("-n", name, "link", "set", device, "up")
            # By multicast the nodes find each other.
            ip("-n", name, "route", "add", "default", "dev", "cable")
        yield names
    finally:
        for name in names.values():
            with suppress(subprocess.CalledProcessError):
                ip("netns", "del", name)


@pytest.fixture
def nodes(machines, tmp_path) -> Iterator[Processes]:
    """Ended before the machines are: they would live on there."""
    started = Processes(tmp_path)
    yield started
    for child in started.all:
        print(child.report())
        child.end()


@pytest.mark.parametrize(("delay", "loss"), [(0.0, 0.0), (0.005, 0.01)], ids=["short", "long and bad"])
def test_the_values_are_those_of_one_machine(
    delay, loss, machines, nodes, reference, limb, waves, bags, until, tmp_path, monkeypatch
):
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET")
    cable = nodes.start("-m", "tests.graph.cable", *ADDRESSES, str(delay), str(loss), on=machines["middle"])
    until(lambda: cable.printed, "the cable")
    started = {
        name: nodes.node(name, on=machines[place], **parameters(name, limb, waves, tmp_path / "run"))
        for name, place in PLACES.items()
    }
    assert {name: child.wait() for name, child in started.items()} == dict.fromkeys(started, 0)
    assert bags.differences(reference, tmp_path / "run") == []
    assert cable.running()
