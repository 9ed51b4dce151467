"""The steps from raw EMG to an envelope, against signals whose envelope is known."""

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from limb_nodes.signals.envelope import (
    band_pass,
    bridge_gaps,
    low_pass,
    normalise,
    rectify,
    resample,
    rest_level,
)

RATE = 1000.0


def tone(frequency: float, seconds: float = 8.0, rate: float = RATE) -> np.ndarray:
    time = np.arange(round(seconds * rate)) / rate
    return np.sin(2 * np.pi * frequency * time)[:, None]


def gain(before: np.ndarray, after: np.ndarray) -> float:
    middle = slice(len(before) // 4, -len(before) // 4)
    return float(after[middle].std() / before[middle].std())


@pytest.mark.parametrize("edge", [20.0, 450.0])
def test_band_pass_loses_3_db_at_each_edge(edge):
    raw = tone(edge)
    assert gain(raw, band_pass(raw, RATE, (20.0, 450.0))) == pytest.approx(np.sqrt(0.5), rel=2e-3)


def test_low_pass_loses_3_db_at_its_corner():
    raw = tone(6.0)
    assert gain(raw, low_pass(raw, RATE, 6.0)) == pytest.approx(np.sqrt(0.5), rel=2e-3)


@pytest.mark.parametrize(("order", "slope"), [(2, 12.0), (4, 24.0), (8, 48.0)])
def test_order_counts_both_passes(order, slope):
    # Far below its edge a Butterworth filter falls by 6 dB per octave and order.
    at = [gain(tone(f, 20.0), band_pass(tone(f, 20.0), RATE, (80.0, 400.0), order)) for f in (10.0, 5.0)]
    assert 20 * np.log10(at[0] / at[1]) == pytest.approx(slope, abs=0.3)


def test_drift_and_offset_are_removed():
    noise = np.random.default_rng(1).normal(size=(8000, 1))
    drift = 5.0 + 3.0 * tone(1.0)
    with_drift = band_pass(noise + drift, RATE, (20.0, 450.0))
    without = band_pass(noise, RATE, (20.0, 450.0))
    middle = slice(500, -500)
    assert np.abs(with_drift - without)[middle].max() < 0.01


def test_no_phase_shift():
    raw = tone(100.0)
    filtered = band_pass(raw, RATE, (20.0, 450.0))
    middle = slice(2000, 6000)
    lags = np.arange(-3, 4)
    match = [float((raw[middle] * np.roll(filtered, lag, axis=0)[middle]).sum()) for lag in lags]
    assert lags[int(np.argmax(match))] == 0


def test_modulated_noise_gives_back_its_modulation():
    # |noise| has the mean sqrt(2/pi); averaged over many channels the envelope is that times the modulation.
    rng = np.random.default_rng(2)
    time = np.arange(6000) / RATE
    modulation = 0.55 + 0.45 * np.sin(2 * np.pi * 0.5 * time)
    carrier = sosfiltfilt(butter(4, [60, 300], "band", fs=RATE, output="sos"), rng.normal(size=(6000, 200)), axis=0)
    carrier /= carrier.std()
    raw = modulation[:, None] * carrier
    result = low_pass(rectify(band_pass(raw, RATE, (20.0, 450.0))), RATE).mean(axis=1)
    expected = np.sqrt(2 / np.pi) * modulation
    assert np.abs(result - expected)[300:-300].max() < 0.03
    assert np.abs(result - expected).max() < 0.06


def test_constant_amplitude_has_no_transient_at_the_ends():
    raw = np.sign(np.random.default_rng(3).normal(size=(4000, 1)))
    smooth = low_pass(rectify(raw), RATE)
    np.testing.assert_allclose(smooth, 1.0, atol=1e-9)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (
            lambda x: band_pass(x, RATE, (20.0, 500.0)),
            "a number > 0 and < 500 in Hz, half the rate,",
        ),
        (lambda x: band_pass(x, RATE, (0.0, 450.0)), "corner is 0; a number > 0"),
        (lambda x: band_pass(x, RATE, (450.0, 20.0)), "a lower and then a higher number"),
        (lambda x: band_pass(x, RATE, (float("nan"), 20.0)), "a lower and then a higher number"),
        (lambda x: low_pass(x, RATE, 6.0, 3), "order is 3; an even number"),
        (lambda x: low_pass(x[:100], RATE, 6.0), "corner is 6; 167 samples, one period of it"),
        (lambda x: rest_level(x, RATE, 9.0), "is 9; a number <= 8 in s"),
        (lambda x: normalise(x, np.array([0.0])), "not above its rest level"),
        (lambda x: resample(x, RATE, 0.0), "a number > 0"),
        (lambda x: bridge_gaps(np.full(3, np.nan)), "no sample is finite"),
    ],
)
def test_impossible_arguments_are_named(call, words):
    with pytest.raises(ValueError, match=words):
        call(tone(50.0))


def test_gaps_are_bridged_along_lines_and_counted():
    values = np.array([np.nan, 1.0, 2.0, np.nan, np.nan, 5.0, np.nan, 4.0, np.nan])
    bridged, gaps = bridge_gaps(values)
    np.testing.assert_allclose(bridged, [1, 1, 2, 3, 4, 5, 4.5, 4, 4])
    assert (gaps.count, gaps.samples, gaps.longest) == (4, 5, 2)
    assert np.isnan(values[0])


def test_normalise_scales_and_clips_and_counts():
    envelope = np.array([[-0.1, 1.0], [0.5, 3.0], [2.0, 2.0]])
    values, above = normalise(envelope, np.array([1.0, 3.0]), np.array([0.0, 1.0]))
    np.testing.assert_allclose(values, [[0, 0], [0.5, 1], [1, 0.5]])
    assert above == [1, 0]


def test_rest_is_the_quietest_stretch():
    envelope = np.concatenate([np.full(500, 3.0), np.full(400, 0.25), np.full(700, 1.0)])[:, None]
    assert rest_level(envelope, RATE, 0.4) == pytest.approx(0.25)
    assert rest_level(envelope, RATE, 0.8) == pytest.approx((400 * 0.25 + 400 * 1.0) / 800)
    assert rest_level(envelope, RATE, 1.6) == pytest.approx(envelope.mean())


def test_resample_keeps_time():
    line = np.arange(1001.0)[:, None] / RATE
    slow = resample(line, RATE, 300.0)
    np.testing.assert_allclose(slow[:, 0], np.arange(301) / 300.0, atol=1e-12)
