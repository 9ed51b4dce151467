"""From a text file of raw EMG to the movement of the knee, by the commands: a recording of a man, and one generated."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from limb_nodes.bags.read import BagReader
from limb_nodes.cli import main
from tests.recorded import generated
from tests.recorded.generated import CHANNELS, DURATION, FULL, LIMB, RATE, Generated
from tests.recordings import recorded

ROOT = Path(__file__).parents[2]
SEEDS = (0, 1, 2)


@dataclass(frozen=True)
class Outcome:
    """Bag of the envelopes; envelopes [T, 4] in the order of `CHANNELS`; knee angles (degrees) [T]."""

    bag: Path
    activation: np.ndarray
    recorded: np.ndarray
    computed: np.ndarray


def from_emg_to_movement(file: Path, folder: Path, *options: str) -> Outcome:
    """What `limb emg` and `limb simulate` make of a recording."""
    bag, run = folder / "envelopes", folder / "run"
    assert main(["emg", str(file), "-o", str(bag), *options]) == 0
    assert main(["simulate", str(LIMB), "--activation", str(bag), "--out", str(run)]) == 0
    with BagReader(bag) as reader:
        envelope, angle = reader.table("emg_envelope"), reader.table("reference_angle")
    assert envelope["name"].tolist() == list(CHANNELS)
    return Outcome(bag, envelope["envelope"], np.degrees(angle["position"][:, 0]), knee_angle(run))


def knee_angle(run: Path) -> np.ndarray:
    """The knee's angle (degrees) in the bag of a run [T]."""
    with BagReader(run) as reader:
        return np.degrees(reader.table("joint_states")["position"][:, 0])


@pytest.fixture(scope="module")
def known() -> Generated:
    return generated.movement()


@pytest.fixture(scope="module", params=["generated", "5Nsen"])
def normalised(
    request: pytest.FixtureRequest, known: Generated, tmp_path_factory: pytest.TempPathFactory
) -> tuple[str, Outcome]:
    """A recording by name, normalised to its own maximum, as one without a trial of maximal contraction."""
    folder = tmp_path_factory.mktemp(request.param)
    if request.param == "generated":
        file = generated.write(folder / "generated.txt", known.activation, known.angle, SEEDS[0])
    else:
        file = recorded(f"emg_lower_limb/{request.param}.txt")
    return request.param, from_emg_to_movement(file, folder)


def test_every_sample_is_there(normalised: tuple[str, Outcome]) -> None:
    name, outcome = normalised
    samples, lowest, highest = {"generated": (12001, 4.5, 100.3), "5Nsen": (13480, 0.9, 70.6)}[name]
    assert outcome.activation.shape == (samples, 4)
    np.testing.assert_array_equal(outcome.activation.max(axis=0), 1.0)
    assert outcome.recorded.shape == outcome.computed.shape == (samples,)
    assert [outcome.recorded.min(), outcome.recorded.max()] == pytest.approx([lowest, highest], abs=0.05)


def test_knee_extensors_work_while_the_knee_is_straight(normalised: tuple[str, Outcome]) -> None:
    _, outcome = normalised
    extensors = outcome.activation[:, [CHANNELS.index("RF"), CHANNELS.index("VM")]]
    straight, bent = extensors[outcome.recorded < 15.0], extensors[outcome.recorded > 60.0]
    assert (straight.mean(axis=0) > 4.0 * bent.mean(axis=0)).all()


def stretches(angle: np.ndarray) -> np.ndarray:
    """Times (s) at which a knee that was bent beyond 50 degrees comes below 25."""
    times, bent = [], True
    for tick, degrees in enumerate(angle):
        if bent and degrees < 25.0:
            times.append(tick / RATE)
        bent = degrees > 50.0 if degrees < 25.0 or degrees > 50.0 else bent
    return np.array(times)


def test_the_knee_is_stretched_when_the_recorded_one_is(normalised: tuple[str, Outcome]) -> None:
    """By 0.1 to 0.5 s apart: muscles at their maximum pull harder than those of the recording did."""
    name, outcome = normalised
    expected = stretches(outcome.recorded)
    assert len(expected) == {"generated": 3, "5Nsen": 4}[name]
    np.testing.assert_allclose(stretches(outcome.computed), expected, rtol=0, atol=0.6)


@pytest.fixture(scope="module")
def maximum(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """The options of `limb emg` for what a minute of maximal contraction shows."""
    folder, count = tmp_path_factory.mktemp("maximum"), 60 * RATE
    file = generated.write(folder / "maximal.txt", np.ones((count, len(CHANNELS))), np.zeros(count), seed=99)
    assert main(["emg", str(file), "-o", str(folder / "envelopes")]) == 0
    with BagReader(folder / "envelopes") as reader:
        largest = np.array([channel["maximum"] for channel in reader.run_info()["channels"]])
        level = largest * reader.table("emg_envelope")["envelope"].mean(axis=0)
    # The mean of rectified Gaussian noise; the band-pass takes a part of its power.
    assert level == pytest.approx(0.92 * FULL * np.sqrt(2.0 / np.pi), rel=0.02)
    return [f"--maximum={name}={value!r}" for name, value in zip(CHANNELS, level.tolist(), strict=True)]


@pytest.fixture(scope="module", params=SEEDS)
def way(
    request: pytest.FixtureRequest, known: Generated, maximum: list[str], tmp_path_factory: pytest.TempPathFactory
) -> Outcome:
    """The generated recording with some noise, normalised by a maximal contraction."""
    folder = tmp_path_factory.mktemp("way")
    file = generated.write(folder / "generated.txt", known.activation, known.angle, request.param)
    return from_emg_to_movement(file, folder, *maximum)


def test_the_envelope_is_the_activation(way: Outcome, known: Generated) -> None:
    """Up to the noise that remains, 9 % of the activation.

    The variance of the rectified signal is (pi/2 - 1) times its mean squared, white over 430 Hz, of which the low-pass
    lets 6 Hz through. Of 30 seeds: 7.6 to 11.4 %, correlation 0.985 to 0.995, level 0.97 to 1.03 of the activation's.
    """
    expected = np.sqrt((np.pi / 2.0 - 1.0) * 6.0 / 430.0)
    error = np.sqrt(np.mean((way.activation - known.activation) ** 2, axis=0) / np.mean(known.activation**2, axis=0))
    assert error == pytest.approx(np.full(len(CHANNELS), expected), abs=0.04)
    level = np.sum(way.activation * known.activation, axis=0) / np.sum(known.activation**2, axis=0)
    assert level == pytest.approx(np.ones(len(CHANNELS)), abs=0.06)
    for envelope, activation in zip(way.activation.T, known.activation.T, strict=True):
        assert np.corrcoef(envelope, activation)[0, 1] > 0.975


def test_the_movement_is_the_one_that_the_recording_was_made_from(way: Outcome, known: Generated) -> None:
    """Of 30 seeds: 0.7 to 2.6 degrees root mean square (1.5 with a deviation of 0.5), at most 16 at any instant, of 96
    degrees of movement.
    """
    assert np.ptp(known.angle) > 90.0
    apart = way.computed - known.angle
    assert np.sqrt(np.mean(apart**2)) < 4.0
    assert np.abs(apart).max() < 20.0
    # The recorded angle is the movement, to its digit and but for what lies between two of its samples.
    assert np.abs(way.recorded - known.angle)[:: RATE // generated.ANGLE_RATE].max() < 0.051


def test_the_graph_makes_the_same_movement(way: Outcome, tmp_path: Path) -> None:
    pytest.importorskip("rclpy")
    command = [sys.executable, "-m", "limb_nodes.cli", "run", str(LIMB), "--activation", str(way.bag)]
    options = ["--rate", "500", "--duration", f"{DURATION:g}", "--state-every", "500", "--out", str(tmp_path / "run")]
    done = subprocess.run([*command, *options], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    np.testing.assert_allclose(knee_angle(tmp_path / "run"), way.computed[::2], rtol=0, atol=0.05)
