"""What a run tells at its end is what its own nodes have told on `/diagnostics`, where anybody may write."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from limb_nodes.bags.read import BagReader
from limb_nodes.bags.types import make_message
from limb_nodes.bags.write import BagWriter
from limb_nodes.nodes.settings import RunSettings, reported

SETTINGS = RunSettings("limb.yaml", "drive.yaml", 1000.0, 1.0, "run")


@pytest.mark.parametrize("value", ["many", "", "-1", "1.5", "9" * 5000, "0x10", "٣", "\x1b[31m", "inf"])
@pytest.mark.parametrize("own", [True, False], ids=["by a node of the run", "by a stranger"])
def test_a_count_that_is_none_is_passed_over(value: str, own: bool, tmp_path: Path) -> None:
    with BagWriter(tmp_path / "run", {}) as bag:
        for identity, text in ((SETTINGS.identity, "3"), (SETTINGS.identity if own else "a stranger", value)):
            pairs = [
                make_message("diagnostic_msgs/msg/KeyValue", key=key, value=given)
                for key, given in (("bad_input", text), ("run", identity))
            ]
            status = make_message(
                "diagnostic_msgs/msg/DiagnosticStatus",
                level=0, name="/muscle_stack", message="", values=pairs,
            )  # fmt: skip
            bag.write("/diagnostics", 0, make_message("diagnostic_msgs/msg/DiagnosticArray", 0, status=[status]))
    with BagReader(tmp_path / "run") as bag:
        assert reported(bag, SETTINGS)["bad_input"] == 3


def test_what_a_stranger_tells_does_not_count(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "run", {}) as bag:
        pairs = [
            make_message("diagnostic_msgs/msg/KeyValue", key=key, value=given)
            for key, given in (("bad_input", "3"), ("run", SETTINGS.identity))
        ]
        status = make_message(
            "diagnostic_msgs/msg/DiagnosticStatus",
            level=0, name="/muscle_stack", message="", values=pairs,
        )  # fmt: skip
        bag.write("/diagnostics", 0, make_message("diagnostic_msgs/msg/DiagnosticArray", 0, status=[status]))
    with BagReader(tmp_path / "run") as bag:
        assert reported(bag, SETTINGS)["bad_input"] == 3
        assert reported(bag, replace(SETTINGS, identity="another"))["bad_input"] == 0
