"""Lengths of muscles that are out of their range are found, and told by `limb simulate`, its bag and `limb muscle`."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from limb_nodes.bags.read import BagReader
from limb_nodes.cli import main
from limb_nodes.solve.ranges import Ranges, limits
from tests.faults import ranges as faults

PARAMS = Path(__file__).parents[2] / "params"
FILE = PARAMS / "reference_joint.yaml"
WAVES = str(PARAMS / "activation_sine_cosine.yaml")


def test_what_leaves_its_range_is_found_in_whatever_pieces():
    trials = list(faults.trials(12, 7))
    assert [trial for trial in trials if not trial.good] == []


@pytest.mark.parametrize("factor", [0.55, 2.2])
def test_fibres_that_are_too_long_or_too_short_are_found(factor, limb_named, model_named, waves):
    flexor = limb_named("reference_joint").muscles[0]
    values = {
        f"muscles[0].units[{u}].series_sarcomeres": factor * unit.values["series_sarcomeres"]
        for u, unit in enumerate(flexor.units)
    }
    model = model_named("reference_joint", values, free=True)
    ranges = Ranges(model)
    ranges.look_at(model.simulate(waves(np.arange(501) / 1000.0, 2), 1000.0, observe=False))
    assert list(ranges.told()) == ["flexor.fibre_length"]
    assert "out of its range of" in ranges.told()["flexor.fibre_length"]


@pytest.mark.parametrize("name", [path.stem for path in sorted(PARAMS.glob("*.yaml")) if "activation" not in path.stem])
def test_the_limbs_that_come_along_stay_in_range(name, model_named, waves):
    model = model_named(name)
    ranges = Ranges(model)
    ranges.look_at(model.simulate(waves(np.arange(2001) / 1000.0, len(model.limb.muscles)), 1000.0, observe=False))
    assert ranges.told() == {}
    assert ranges.outside() == []


def test_a_law_may_declare_a_narrower_range(limb_named):
    muscle = limb_named("reference_joint").muscles[0]
    path = muscle.laws["path"]
    law = replace(path.law, ranges={"muscle_tendon_length": (0.1, 0.3)})
    narrowed = replace(muscle, laws={**muscle.laws, "path": replace(path, law=law)})
    assert limits(narrowed)[0].tolist() == [0.1, 0.3]


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A limb whose fibres have half the sarcomeres that they need."""
    path = tmp_path_factory.mktemp("limbs") / "short.yaml"
    path.write_text(FILE.read_text().replace("series_sarcomeres: 42000", "series_sarcomeres: 23000"))
    return path


def told_in(bag: Path) -> dict[str, str]:
    """What a bag says of lengths out of range."""
    with BagReader(bag) as reader:
        last = [message for _, message in reader.read_topic("/diagnostics")][-1]
    return {pair.key: pair.value for status in last.status for pair in status.values}


def test_simulate_tells_it_and_its_bag_holds_it(short, tmp_path, capsys):
    out = tmp_path / "bag"
    given = ["simulate", str(short), "--activation", WAVES, "--duration", "0.5"]
    for more in ([], ["--out", str(out)]):
        assert main([*given, *more]) == 0
        lines = [line for line in capsys.readouterr().out.splitlines() if line.startswith("range ")]
        assert [line.partition(" is ")[0].split()[1] for line in lines] == [
            "flexor.fibre_length",
            "extensor.fibre_length",
        ]
    told = {key.removeprefix("out of range: "): words for key, words in told_in(out).items()}
    assert lines == [f"range      {length} {words}" for length, words in told.items()]


def test_what_stays_in_range_is_not_told(tmp_path, capsys):
    out = tmp_path / "bag"
    assert main(["simulate", str(FILE), "--activation", WAVES, "--duration", "0.1", "--out", str(out)]) == 0
    assert "range " not in capsys.readouterr().out
    with BagReader(out) as reader:
        assert not reader.has("/diagnostics")


@pytest.mark.parametrize(("length", "out"), [("0.4", True), ("0.01", True), ("0.11", False)])
def test_the_bench_tells_it(length, out, capsys):
    given = ["muscle", str(FILE), "flexor", "--isometric", length]
    assert main(given) == 0
    text = capsys.readouterr().out
    assert main([*given, "--json"]) == 0
    data = json.loads(capsys.readouterr().out)["out_of_range"]
    assert list(data) == (["flexor.fibre_length"] if out else [])
    said = [line for line in text.splitlines() if line.startswith("range")]
    assert said == [f"range: {length} {words}" for length, words in data.items()]
    assert all("for 100 % of the time" in words for words in data.values())
