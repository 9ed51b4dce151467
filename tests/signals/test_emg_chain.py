"""Envelopes against a chain written here from scipy's own functions, and sample by sample against all at once."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import butter, filtfilt, iirnotch, lfilter, lfilter_zi, sosfilt, sosfilt_zi, sosfiltfilt

from limb_nodes.errors import FieldError
from limb_nodes.signals.causal import CausalChain
from limb_nodes.signals.emg import envelopes
from limb_nodes.signals.envelope import notch
from limb_nodes.signals.options import EnvelopeOptions
from limb_nodes.signals.recording import Recording

# EMG amplifiers sample at these rates (Hz): plain ones, Delsys Trigno's two, and one of a drifting clock.
RATES = [500.0, 1000.0, 1000.03, 1925.926, 2000.0, 2148.1481, 4000.0]
NAMES = ("RF", "BF", "VM")


def raw_emg(rate: float, seconds: float = 8.0, seed: int = 5, offset: float = 1.5) -> np.ndarray:
    """Noise in the band of EMG, contractions that come and go, an offset, and hum with two harmonics."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(seconds * rate))[:, None] / rate
    carrier = sosfilt(butter(2, [30, 0.4 * rate], "band", fs=rate, output="sos"), rng.normal(size=(len(time), 3)), 0)
    contraction = 0.03 + np.clip(np.sin(2 * np.pi * 0.3 * time + np.arange(3)), 0, 1) ** 2
    hum = sum(a * np.sin(2 * np.pi * 50 * k * time + k) for k, a in ((1, 0.4), (2, 0.1), (3, 0.2)))
    return contraction * carrier + hum + offset


def recording(values: np.ndarray, rate: float) -> Recording:
    return Recording("made.txt", NAMES, ("mV",) * 3, values, rate)


def band_at(rate: float) -> tuple[float, float]:
    return 20.0, min(450.0, 0.4 * rate)


def zero_phase_by_scipy(values, rate, band, low_pass, order, mains):
    """Each filter forward and backward, 3 dB down at its corner after both passes; ends mirrored for three periods."""
    n = order // 2
    # A Butterworth filter squared is 3 dB down where |H|^2 = sqrt(1/2): at this part of its corner, in warped terms.
    part = (np.sqrt(2) - 1) ** (1 / (2 * n))

    def run(signal, corner, kind, padtype):
        prewarped = np.tan(np.pi * corner / rate) * (part if kind == "high" else 1 / part)
        sections = butter(n, 2 / np.pi * np.arctan(prewarped), kind, output="sos")
        return sosfiltfilt(sections, signal, axis=0, padtype=padtype, padlen=int(np.ceil(3 * rate / corner)))

    signal = values
    harmonic = mains or np.inf
    while harmonic < rate / 2:
        # Three times the time in which the narrowest notch rings down by 1/e.
        pad = int(np.ceil(3 * 30 / (np.pi * mains) * rate))
        signal = filtfilt(*iirnotch(harmonic, 30, rate), signal, axis=0, padlen=pad)
        harmonic += mains
    signal = run(run(signal, band[0], "high", "odd"), band[1], "low", "even")
    return run(np.abs(signal), low_pass, "low", "even")


def causal_by_scipy(values, rate, band, low_pass, order, mains):
    """Each filter once, at rest at the first sample."""
    columns = []
    for signal in values.T:
        harmonic = mains or np.inf
        while harmonic < rate / 2:
            b, a = iirnotch(harmonic, 30, rate)
            signal, _ = lfilter(b, a, signal, zi=lfilter_zi(b, a) * signal[0])
            harmonic += mains
        for corner, kind in ((band[0], "high"), (band[1], "low"), (low_pass, "low")):
            if corner == low_pass:
                signal = np.abs(signal)
            sections = butter(order, corner, kind, fs=rate, output="sos")
            signal, _ = sosfilt(sections, signal, zi=sosfilt_zi(sections) * signal[0])
        columns.append(signal)
    return np.stack(columns, axis=1)


@pytest.mark.parametrize("mains", [None, 50.0, 60.0])
@pytest.mark.parametrize("causal", [False, True])
@pytest.mark.parametrize("rate", RATES)
def test_envelopes_are_those_of_a_chain_of_scipys_functions(rate, causal, mains):
    values, band = raw_emg(rate), band_at(rate)
    result = envelopes(recording(values, rate), EnvelopeOptions(band=band, causal=causal, mains=mains)).values
    expected = (causal_by_scipy if causal else zero_phase_by_scipy)(values, rate, band, 6.0, 4, mains)
    expected = np.clip(expected / expected.max(axis=0), 0, 1)
    difference = np.sqrt(np.mean((result - expected) ** 2))
    assert difference <= 1e-3
    # Far apart, so that the bound tells one chain from the other.
    other = (zero_phase_by_scipy if causal else causal_by_scipy)(values, rate, band, 6.0, 4, mains)
    assert np.sqrt(np.mean((other / other.max(axis=0) - expected) ** 2)) > 0.05


@pytest.mark.parametrize(("order", "low_pass", "band"), [(2, 3.0, (10.0, 300.0)), (8, 12.0, (30.0, 400.0))])
@pytest.mark.parametrize("causal", [False, True])
def test_other_orders_and_corners_too(causal, order, low_pass, band):
    values = raw_emg(2000.0)
    options = EnvelopeOptions(
        band=band, band_order=order, low_pass=low_pass, low_pass_order=order, causal=causal, mains=60.0
    )
    result = envelopes(recording(values, 2000.0), options).values
    expected = (causal_by_scipy if causal else zero_phase_by_scipy)(values, 2000.0, band, low_pass, order, 60.0)
    assert np.sqrt(np.mean((result - np.clip(expected / expected.max(axis=0), 0, 1)) ** 2)) <= 1e-3


@pytest.mark.parametrize("causal", [False, True])
@pytest.mark.parametrize("rate", [1000.0, 2148.1481])
def test_the_notch_takes_the_hum_out_and_leaves_the_emg(rate, causal):
    quiet = raw_emg(rate, offset=0.0)
    time = np.arange(len(quiet))[:, None] / rate
    for k, a in ((1, 0.4), (2, 0.1), (3, 0.2)):
        quiet -= a * np.sin(2 * np.pi * 50 * k * time + k)
    options = EnvelopeOptions(band=band_at(rate), causal=causal, maximum=dict.fromkeys(NAMES, 0.3))
    clean = envelopes(recording(quiet, rate), options).values
    hum = envelopes(recording(raw_emg(rate), rate), options).values
    notched = envelopes(
        recording(raw_emg(rate), rate),
        EnvelopeOptions(band=band_at(rate), causal=causal, mains=50.0, maximum=dict.fromkeys(NAMES, 0.3)),
    ).values
    # The causal notch needs a second to settle.
    middle = slice(round(1.5 * rate), -round(0.5 * rate))
    assert np.abs(notched - clean)[middle].mean() < 0.05
    assert np.abs(hum - clean)[middle].mean() > 0.3


def test_every_harmonic_below_half_the_rate_is_taken():
    time = np.arange(8000) / 1000.0
    for frequency, kept in ((50, 0.0), (250, 0.0), (450, 0.0), (75, 1.0), (475, 0.96)):
        tone = np.sin(2 * np.pi * frequency * time)[:, None]
        left = notch(tone, 1000.0, 50.0)[2000:6000].std() / tone[2000:6000].std()
        assert left == pytest.approx(kept, abs=0.02), frequency


@pytest.mark.parametrize("mains", [None, 60.0])
def test_step_by_step_block_by_block_and_all_at_once_are_the_same(mains):
    values = raw_emg(1000.0, seconds=1.5)
    values[:40, 1] = np.nan
    values[300:310, 0] = np.nan
    values[700, 2] = np.inf
    options = EnvelopeOptions(mains=mains)
    whole = CausalChain(1000.0, options, 3).process(values)
    chain = CausalChain(1000.0, options, 3)
    np.testing.assert_array_equal(np.stack([chain.step(row) for row in values]), whole)
    for cuts in ([1, 2, 39, 40, 41, 305, 700, 701], [700], []):
        chain = CausalChain(1000.0, options, 3)
        np.testing.assert_array_equal(np.concatenate([chain.process(part) for part in np.split(values, cuts)]), whole)
    assert chain.process(values[:0]).shape == (0, 3)
    assert np.isfinite(whole).all()


def test_a_missing_value_is_taken_as_the_one_before_and_no_channel_disturbs_another():
    values = raw_emg(1000.0, seconds=1.0)
    held = values.copy()
    held[500:520, 1] = values[499, 1]
    missing = values.copy()
    missing[500:520, 1] = np.nan
    options = EnvelopeOptions()
    result = CausalChain(1000.0, options, 3).process(missing)
    np.testing.assert_array_equal(result, CausalChain(1000.0, options, 3).process(held))
    np.testing.assert_array_equal(result[:, [0, 2]], CausalChain(1000.0, options, 3).process(values)[:, [0, 2]])


def test_an_offset_makes_no_transient_and_a_channel_that_is_silent_stays_at_zero():
    values = np.full((1000, 2), 2.5)
    values[:, 1] = np.nan
    np.testing.assert_allclose(CausalChain(1000.0, EnvelopeOptions(), 2).process(values), 0.0, atol=1e-9)
    late = values.copy()
    late[400:, 1] = 7.0
    np.testing.assert_allclose(CausalChain(1000.0, EnvelopeOptions(mains=50.0), 2).process(late), 0.0, atol=1e-9)


def test_what_comes_later_does_not_change_what_was():
    values = raw_emg(1000.0, seconds=2.0)
    changed = values.copy()
    changed[1200:] *= 50.0
    options = EnvelopeOptions(causal=True, maximum=dict.fromkeys(NAMES, 1.0))
    early = [envelopes(recording(given, 1000.0), options).values[:1200] for given in (values, changed)]
    np.testing.assert_array_equal(*early)
    both_ways = EnvelopeOptions(maximum=dict.fromkeys(NAMES, 1.0))
    early = [envelopes(recording(given, 1000.0), both_ways).values[:1200] for given in (values, changed)]
    assert np.abs(early[0] - early[1]).max() > 0.01


@pytest.mark.parametrize(
    ("options", "rate", "line"),
    [
        ({"mains": 55.0}, 1000.0, "mains is 55; 50 or 60 in Hz is needed"),
        ({"mains": 50.0, "band": None}, 90.0, "mains is 50; a number < 45 in Hz, half the rate, is needed"),
        ({"band": (20.0, 450.0)}, 500.0, "band corner is 450; a number > 0 and < 250 in Hz, half the rate, is needed"),
        ({"band": (90.0, 20.0)}, 500.0, "band edges are 90 and 20; a lower and then a higher number in Hz are needed"),
        ({"low_pass_order": 3}, 1000.0, "low_pass order is 3; an even number from 2 to 12 is needed"),
    ],
)
def test_filters_that_cannot_work_are_named_by_their_option(options, rate, line):
    with pytest.raises(FieldError) as error:
        CausalChain(rate, EnvelopeOptions(**options), 3)
    assert str(error.value) == line
    for causal in (False, True):
        with pytest.raises(FieldError) as error:
            envelopes(recording(raw_emg(rate), rate), EnvelopeOptions(**options, causal=causal))
        assert str(error.value) == f"made.txt ({rate:g} Hz): {line}"
