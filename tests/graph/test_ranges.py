"""A run says which lengths of its muscles were out of their range: in its summary, on `/diagnostics`, in the bag."""

from __future__ import annotations

from pathlib import Path

import pytest

from limb_nodes.bags.read import BagReader
from limb_nodes.nodes.session import run_in_one_process, run_in_processes
from limb_nodes.nodes.settings import RunSettings, checked
from limb_nodes.solve.ranges import OUT_OF_RANGE

pytestmark = pytest.mark.usefixtures("own_signals")


@pytest.fixture(scope="module")
def short(limb: str, tmp_path_factory: pytest.TempPathFactory) -> str:
    """A limb whose fibres have half the sarcomeres that they need."""
    path = tmp_path_factory.mktemp("limbs") / "short.yaml"
    text = Path(limb).read_text()
    assert "series_sarcomeres: 42000" in text
    path.write_text(text.replace("series_sarcomeres: 42000", "series_sarcomeres: 23000"))
    return str(path)


@pytest.mark.parametrize("run", [run_in_one_process, run_in_processes])
@pytest.mark.parametrize("states", [(), ("muscle_state",)])
def test_a_run_says_which_lengths_are_out_of_range(run, states, short, waves, tmp_path, capfd) -> None:
    out = tmp_path / "bag"
    settings = RunSettings(limb=short, source=waves, rate=1000.0, duration=0.3, out=str(out), states=states)
    outcome = run(checked(settings)[0], lambda tick: None)
    assert sorted(outcome.ranges) == ["extensor.fibre_length", "flexor.fibre_length"]
    assert "flexor.fibre_length is " in capfd.readouterr().err
    with BagReader(out) as bag:
        said = [status for _, message in bag.read_topic("/diagnostics") for status in message.status]
    told = {pair.key: pair.value for status in said if status.name == "/muscle_stack" for pair in status.values}
    assert {OUT_OF_RANGE + length: words for length, words in outcome.ranges.items()}.items() <= told.items()
    # Said as soon as it happens, too, not at the end alone.
    assert len([status for status in said if status.name == "/muscle_stack"]) > 1


def test_one_that_stays_in_range_says_nothing(limb, waves, tmp_path, capfd) -> None:
    settings = RunSettings(limb=limb, source=waves, rate=1000.0, duration=0.1, out=str(tmp_path / "bag"))
    assert run_in_one_process(checked(settings)[0], lambda tick: None).ranges == {}
    assert "range" not in capfd.readouterr().err
