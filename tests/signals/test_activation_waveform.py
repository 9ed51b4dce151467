"""Waveform YAML: each wave against its formula, the shipped files, and one-line errors with the place."""

from pathlib import Path

import numpy as np
import pytest

from limb_nodes.errors import UserError
from limb_nodes.signals.activation import load_activation

PARAMS = Path(__file__).parents[2] / "params"
RATE = 100.0
TIME = np.arange(201) / RATE


@pytest.fixture
def write(tmp_path):
    def write(text):
        path = tmp_path / "wave.yaml"
        path.write_text(text)
        return str(path)

    return write


@pytest.fixture
def sample(write):
    def sample(wave):
        return load_activation(write(f"muscles:\n  m: {wave}\n"), ["m"], RATE, 2.0).values[:, 0]

    return sample


def test_constant(sample):
    np.testing.assert_array_equal(sample("{wave: constant, value: 0.3}"), 0.3)


def test_sine_is_clipped_at_zero_and_one(sample):
    expected = np.clip(np.sin(2 * np.pi * 1.5 * TIME), 0, 1)
    np.testing.assert_allclose(sample("{wave: sine, frequency: 1.5}"), expected, atol=1e-12)
    high = sample("{wave: sine, mean: 0.5, amplitude: 2, frequency: 1}")
    assert high.max() == 1.0
    assert high.min() == 0.0


def test_cosine_with_phase_and_mean(sample):
    result = sample("{wave: cosine, mean: 0.5, amplitude: 0.5, frequency: 2, phase: 0.7, clip: false}")
    np.testing.assert_allclose(result, 0.5 + 0.5 * np.cos(4 * np.pi * TIME + 0.7), atol=1e-12)


def test_step_happens_at_its_time(sample):
    result = sample("{wave: step, before: 0.1, after: 0.8, time: 0.5}")
    np.testing.assert_array_equal(result, np.where(np.arange(201) < 50, 0.1, 0.8))


def test_ramp_is_straight_between_its_times(sample):
    result = sample("{wave: ramp, start: 0, end: 1, start_time: 0.5, end_time: 1.5}")
    np.testing.assert_allclose(result, np.clip(TIME - 0.5, 0, 1), atol=1e-12)


def test_extra_muscles_are_noted(write):
    source = write("muscles: {m: {wave: constant, value: 0}, n: {wave: constant, value: 0}}")
    assert load_activation(source, ["m"], RATE, 1.0).notes == ("not used, for the limb has no such muscle: n",)


def test_shipped_sine_and_cosine_cross_the_threshold_where_the_report_has_them():
    result = load_activation(str(PARAMS / "activation_sine_cosine.yaml"), ["flexor", "extensor"], 1000.0, 1.0)
    time = np.arange(1001) / 1000
    above = result.values >= 0.8
    np.testing.assert_array_equal(above[:, 0], np.sin(2 * np.pi * time) >= 0.8)
    np.testing.assert_array_equal(above[:, 1], np.cos(2 * np.pi * time) >= 0.8)


def test_shipped_constants():
    result = load_activation(str(PARAMS / "activation_constant.yaml"), ["flexor", "extensor"], 10.0, 1.0)
    np.testing.assert_array_equal(result.values, [[0.9, 0.0]] * 11)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "the file is empty"),
        ("muscles: [", "line 1: not YAML"),
        ("muscles:\n", "muscles is empty"),
        ("muscles: {}\n", "muscles is empty"),
        ("name: a\nmuscles: {m: {wave: constant, value: 0}}\n", "name is not a key here; allowed: muscles"),
        ("muscles: {m: 0.5}", "muscles.m is 0.5; a mapping"),
        ("muscles: {m: {value: 0.5}}", "muscles.m.wave is missing; allowed: constant, sine"),
        ("muscles: {m: {wave: square, value: 0.5}}", "muscles.m.wave is 'square'; allowed: constant, sine"),
        ("muscles: {m: {wave: [1]}}", "muscles.m.wave is [1]; allowed"),
        ("muscles: {m: {wave: constant}}", "muscles.m.value is missing; a number >= 0 and <= 1 is needed"),
        ("muscles: {m: {wave: constant, value: 1.5}}", "muscles.m.value is 1.5; a number >= 0 and <= 1 is needed"),
        ("muscles: {m: {wave: constant, value: .nan}}", "muscles.m.value is nan"),
        ("muscles: {m: {wave: constant, value: high}}", "muscles.m.value is 'high'"),
        ("muscles: {m: {wave: constant, value: true}}", "muscles.m.value is True"),
        ("muscles: {m: {wave: constant, value: 0, clip: true}}", "muscles.m.clip is not a key here"),
        ("muscles: {m: {wave: sine, frequency: 1, clip: 3}}", "muscles.m.clip is 3; true or false is needed"),
        ("muscles: {m: {wave: sine, frequency: -1}}", "muscles.m.frequency is -1; a number >= 0 in Hz is needed"),
        ("muscles: {m: {wave: sine}}", "muscles.m.frequency is missing"),
        ("muscles: {m: {wave: sine, frequency: 50}}", "muscles.m.frequency is 50; a number < 50 in Hz is needed"),
        ("muscles: {m: {wave: sine, frequency: 1, clip: false}}", "muscles.m is -0.0627905 at 0.51 s; a number in"),
        ("muscles: {m: {wave: step, before: 0, after: 1, time: -1}}", "muscles.m.time is -1"),
        (
            "muscles: {m: {wave: ramp, start: 0, end: 1, start_time: 2, end_time: 1}}",
            "muscles.m.end_time is 1; a number > start_time (2) is needed",
        ),
        ("muscles: {m: {wave: constant, value: 0}, m: {wave: constant, value: 0}}", "not YAML"),
        ("muscles: {other: {wave: constant, value: 0}}", "no muscle 'm', a muscle of the limb; there are other"),
    ],
)
def test_bad_waveforms(write, text, words):
    source = write(text)
    with pytest.raises(UserError) as error:
        load_activation(source, ["m"], RATE, 1.0)
    assert str(error.value).startswith(source)
    assert words in str(error.value)
    assert "\n" not in str(error.value)
