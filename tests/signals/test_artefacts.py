"""What a raw channel holds that is no EMG is noticed; EMG alone is not."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import butter, sosfilt

from limb_nodes.errors import FieldError, UserError
from limb_nodes.signals.artefacts import artefacts, clipped_runs, lone_spikes, no_signal, still_runs
from limb_nodes.signals.emg import Envelopes, envelopes
from limb_nodes.signals.envelope import runs
from limb_nodes.signals.options import EnvelopeOptions
from limb_nodes.signals.recording import Recording, read_recording
from tests.recordings import recorded

RATES = [500.0, 1000.0, 2148.1481, 10000.0]


def emg(rate: float = 1000.0, seconds: float = 6.0, seed: int = 0, scale: float = 0.1) -> np.ndarray:
    """Contractions that come and go, of noise in the band of EMG."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(seconds * rate)) / rate
    carrier = sosfilt(butter(2, [30, min(400, 0.4 * rate)], "band", fs=rate, output="sos"), rng.normal(size=len(time)))
    return scale * (0.05 + np.clip(np.sin(np.pi * time), 0, 1)) * carrier / carrier.std()


def kinds(values: np.ndarray, rate: float = 1000.0) -> list[str]:
    return [one.kind for one in artefacts("RF", "mV", values, rate)]


def two(values: np.ndarray, rate: float = 1000.0) -> Recording:
    """A recording of a good channel and another one."""
    return Recording(
        "made.txt", ("good", "RF"), ("mV", "mV"), np.column_stack([emg(rate, len(values) / rate, seed=9), values]), rate
    )


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("step", [0.0, 0.0005, 0.01])
def test_emg_alone_is_no_artefact(rate, seed, step):
    values = emg(rate, seed=seed)
    if step:
        # A converter of 12 bits, and one of 6 or so.
        values = step * np.round(values / step)
        values[:: round(rate / 40)] += step
    assert no_signal(values, rate) == ""
    assert kinds(values, rate) == []


@pytest.mark.parametrize(
    "values",
    [
        5.0 + 3.0 * np.sin(np.arange(6000) / 500) + emg(),
        np.sin(2 * np.pi * 80 * np.arange(6000) / 1000) + 0.01 * emg(),
        np.exp(-(((np.arange(6000) - 3000) / 200) ** 2)) * emg(),
        np.where(np.arange(6000) < 3000, 0.01, 1.0) * emg(),
        np.where(np.arange(6000) < 3000, 0.0, 2.0) + emg(),
    ],
    ids=["drift", "tone", "one burst", "louder", "a step of the offset"],
)
def test_nor_is_what_is_broad(values):
    assert kinds(values) == []


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize(("height", "offset"), [(3.0, 0.0), (-3.0, 0.0), (12.0, 40.0), (-2.0, -5.0)])
@pytest.mark.parametrize("at", [0, 1, 2500, -1])
def test_a_lone_spike_is_noted_with_its_time(rate, height, offset, at):
    values = emg(rate) + offset
    values[at] += height
    (spike,) = artefacts("RF", "mV", values, rate)
    place = at % len(values)
    assert (spike.kind, spike.samples) == ("spike", 1)
    assert spike.start == spike.end == pytest.approx(place / rate)
    assert spike.value == pytest.approx(values[at])
    assert spike.note.startswith(f"channel RF: a lone spike, {values[at]:.6g} mV at {place / rate:.6g} s, ")
    assert spike.note.endswith("--remove-spikes puts a straight line there")


def test_several_spikes_and_wider_ones_are_noted_together():
    values = emg(2000.0)
    values[3000] += 3.0
    values[7000:7003] -= [2.0, 4.0, 2.0]
    values[9000:9002] += 5.0
    found = artefacts("RF", "", values, 2000.0)
    assert [(round(one.start * 2000), one.samples) for one in found] == [(3000, 1), (7000, 3), (9000, 2)]
    assert found[0].note.startswith("channel RF: 3 lone spikes, ")
    assert [one.note for one in found[1:]] == ["", ""]


def test_a_spike_beside_a_gap_is_noted():
    values = emg()
    values[3000:3010] = np.nan
    values[2999] = 4.0
    assert kinds(values) == ["spike"]


def test_many_high_waves_are_a_signal_not_spikes():
    values = 0.01 * emg()
    values[100::200] += 1.0
    assert len(lone_spikes(values, 1000.0)[0]) == 0


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("part", [0.3, 0.5])
@pytest.mark.parametrize("noise", [0.0, 1e-5])
def test_clipping_is_noted_at_each_limit(rate, part, noise):
    values = emg(rate)
    limit = part * np.abs(values).max()
    clipped = np.clip(values, -limit, np.inf)
    clipped[clipped == -limit] += noise * limit * np.random.default_rng(1).random((clipped == -limit).sum())
    (found,) = artefacts("RF", "mV", clipped, rate)
    at_limit = np.flatnonzero(values <= -limit)
    assert found.kind == "clipping"
    assert found.value == pytest.approx(-limit, rel=1e-4)
    assert found.samples >= len(at_limit)
    assert found.start == pytest.approx(at_limit[0] / rate, abs=2 / rate)
    assert f"clipped at {found.value:.6g} mV, {found.samples} samples" in found.note
    assert "record with less gain, or leave it out by --skip RF" in found.note
    assert len(clipped_runs(np.clip(values, -limit, limit))) == 2


def test_a_channel_that_stands_still_for_a_while_is_noted():
    values = emg()
    values[1000:1150] = values[1000]
    values[4000:4600] = 0.0
    found = artefacts("RF", "mV", values, 1000.0)
    assert [(one.kind, one.start, one.end, one.samples) for one in found] == [
        ("still", 1.0, 1.149, 150),
        ("still", 4.0, 4.599, 600),
    ]
    assert "and 1 times more; check its contact" in found[0].note
    values[4000:4050] = np.nan
    assert still_runs(values, 1000.0).tolist() == [[1000, 1150], [4050, 4600]]


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        (np.full(3000, np.nan), "holds no value"),
        (np.zeros(3000), "is 0 everywhere"),
        (np.full(3000, 2.5), "is 2.5 everywhere"),
        (np.where(np.arange(3000) % 7, 2.5, np.nan), "is 2.5 everywhere"),
        (2.5 + 1e-13 * np.arange(3000), "is 2.5 everywhere"),
        (np.random.default_rng(0).integers(0, 2, 3000) * 0.1, "takes 2 different values only, from 0 to 0.1, as"),
        (0.3 + np.random.default_rng(0).integers(-1, 2, 3000) * 0.1, "takes 3 different values only, from 0.2 to 0.4,"),
        (np.where(np.arange(3000) == 1500, 5.0, 0.0), "is 0 everywhere but in a spike"),
        (
            np.where(np.arange(3000) == 1500, 5.0, np.random.default_rng(0).integers(0, 3, 3000) * 1e-4),
            "takes 3 different values only, from 0 to 0.0002, as",
        ),
    ],
    ids=[
        "empty",
        "zero",
        "constant",
        "constant with gaps",
        "rounding",
        "a step",
        "two steps",
        "spike",
        "step and spike",
    ],
)
def test_a_channel_without_signal_is_left_at_zero_and_noted(values, reason):
    result = envelopes(two(values))
    assert no_signal(values, 1000.0).startswith(reason)
    assert np.all(result.values[:, 1] == 0.0)
    assert result.values[:, 0].max() == 1.0
    assert [channel.has_signal for channel in result.channels] == [True, False]
    (note,) = result.notes
    assert note.startswith(f"channel RF {reason}")
    assert "from 0 to " in note
    assert "no signal, left at 0; check its electrode, leave it out by --skip RF" in note


def two_of(values: np.ndarray) -> Recording:
    return Recording("made.txt", ("RF", "BF"), ("mV", "mV"), np.column_stack([values, values]), 1000.0)


def test_it_is_normalised_if_the_user_says_so():
    step = np.random.default_rng(0).integers(-1, 2, 6000) * 1e-4
    result = envelopes(two(step), EnvelopeOptions(trust=("RF",)))
    assert result.values[:, 1].max() == 1.0
    assert result.channels[1].has_signal
    with pytest.raises(UserError, match="the maximum of channel RF is 0; a number > 0, its rest level, is needed"):
        envelopes(two(np.zeros(6000)), EnvelopeOptions(trust=("RF",)))
    with pytest.raises(UserError, match=r"made.txt: channel RF holds no value; at least one is needed"):
        envelopes(two(np.full(6000, np.nan)), EnvelopeOptions(trust=("RF",)))
    with pytest.raises(FieldError, match="trust names 'VM'; one of good, RF is needed"):
        envelopes(two(step), EnvelopeOptions(trust=("VM",)))


def test_no_signal_at_all_is_refused():
    with pytest.raises(UserError, match=r"^made.txt: channel RF is 0 everywhere; a channel with a signal is needed$"):
        envelopes(two_of(np.zeros(3000)))


def test_spikes_are_removed_on_request():
    plain, spiky = emg(), emg()
    spiky[4100] += 12.0
    clean = envelopes(two(plain)).values[:, 1]
    noted = envelopes(two(spiky))
    assert noted.values[:, 1].mean() < 0.3 * clean.mean()
    for causal in (False, True):
        clean = envelopes(two(plain), EnvelopeOptions(causal=causal)).values[:, 1]
        removed = envelopes(two(spiky), EnvelopeOptions(causal=causal, remove_spikes=True))
        assert np.abs(removed.values[:, 1] - clean).max() < 0.02
        (note,) = removed.notes
        assert note.endswith("replaced by a straight line")
    assert removed.channels[1].gaps.count == 0


def gappy(start: int, end: int, rate: float = 1000.0) -> Recording:
    raw = two(emg(rate), rate)
    raw.values[start:end, 1] = np.nan
    return raw


@pytest.mark.parametrize("causal", [False, True])
def test_long_gaps_are_refused_bridged_or_kept(causal):
    raw = gappy(3000, 5000)
    with pytest.raises(FieldError) as error:
        envelopes(raw, EnvelopeOptions(causal=causal))
    assert str(error.value) == (
        "made.txt: longest_gap is 0.1; a number >= 2 in s is needed, for channel RF has no value from 3 to 5 s, "
        "or --keep-gaps"
    )
    bridged = envelopes(raw, EnvelopeOptions(causal=causal, longest_gap=2.0))
    assert np.isfinite(bridged.values).all()
    assert (bridged.channels[1].gaps.count, bridged.channels[1].gaps.samples) == (1, 2000)
    kept = envelopes(raw, EnvelopeOptions(causal=causal, keep_gaps=True))
    assert runs(np.isnan(kept.values[:, 1])).tolist() == [[3000, 5000]]
    assert np.isfinite(kept.values[:, 0]).all()
    assert kept.channels[1].gaps.count == 0
    assert kept.notes == ("channel RF: no value from 3 to 5 s, kept as a gap",)
    assert kept.artefacts[0].kind == "gap"


def test_what_lies_beside_a_kept_gap_is_as_if_recorded_alone():
    raw, rate = gappy(3000, 5000), 1000.0
    options = EnvelopeOptions(keep_gaps=True, maximum={"good": 1.0, "RF": 1.0})
    kept = envelopes(raw, options).values
    first = Recording("a", raw.names, raw.units, raw.values[:3000], rate)
    last = Recording("b", raw.names, raw.units, raw.values[5000:], rate)
    np.testing.assert_array_equal(kept[:3000, 1], envelopes(first, options).values[:, 1])
    np.testing.assert_array_equal(kept[5000:, 1], envelopes(last, options).values[:, 1])


def test_gaps_at_the_limit_are_bridged_at_any_rate():
    for rate in (1000.0, 2148.1481):
        width = int(0.1 * rate)
        result = envelopes(gappy(3000, 3000 + width, rate), EnvelopeOptions(band=(20.0, 400.0)))
        assert result.channels[1].gaps.longest == width
        with pytest.raises(FieldError, match=r"longest_gap is 0.1"):
            envelopes(gappy(3000, 3001 + width, rate), EnvelopeOptions(band=(20.0, 400.0)))


def test_rest_and_resampling_go_round_a_kept_gap():
    options = EnvelopeOptions(keep_gaps=True, rest=0.2, resample=100.0, delay=0.05)
    result = envelopes(gappy(3000, 5000), options)
    whole = envelopes(two(emg()), EnvelopeOptions(rest=0.2, resample=100.0, delay=0.05))
    assert result.channels[1].rest == pytest.approx(whole.channels[1].rest, rel=0.3)
    (gap,) = runs(np.isnan(result.values[:, 1]))
    np.testing.assert_allclose(gap / 100.0, [3.05, 5.05], atol=0.011)
    with pytest.raises(FieldError, match=r"rest is 3.5; a number <= 3 in s, the longest stretch without a gap"):
        envelopes(gappy(3000, 5000), EnvelopeOptions(keep_gaps=True, rest=3.5))


@pytest.mark.parametrize("delay", [0.0, 0.03, 0.0507])
@pytest.mark.parametrize("resample", [None, 130.0])
def test_the_delay_shifts_envelopes_and_not_angles(delay, resample):
    rate = 1000.0
    angle = np.linspace(0, 90, 6000)
    raw = Recording("m", ("RF", "knee"), ("mV", "deg"), np.column_stack([emg(), angle]), rate)
    plain = envelopes(raw)
    late = envelopes(raw, EnvelopeOptions(delay=delay, resample=resample))
    times = np.arange(len(late.values)) / late.rate
    expected = np.interp(times - delay, np.arange(6000) / rate, plain.values[:, 0])
    np.testing.assert_allclose(late.values[:, 0], expected, atol=1e-12)
    np.testing.assert_allclose(late.angles[:, 0], np.interp(times, np.arange(6000) / rate, plain.angles[:, 0]))
    with pytest.raises(FieldError, match=r"delay is -0.1; a number >= 0 and <= 1 in s is needed"):
        envelopes(raw, EnvelopeOptions(delay=-0.1))


def from_folder(name: str, **options: object) -> Envelopes:
    return envelopes(read_recording(recorded("emg_formats") / name), EnvelopeOptions(**options))


def test_recorded_dead_channels():
    dead = from_folder("dead-channel/dead.csv")
    assert [channel.has_signal for channel in dead.channels] == [True, True, False]
    assert np.all(dead.values[:, 2] == 0.0)
    assert "channel IM EMG9 is 0 everywhere, from 0 to 1.498 s: no signal, left at 0" in dead.notes[0]
    assert "--skip 'IM EMG9'" in dead.notes[0]
    unplugged = from_folder("dead-channel/unplugged.csv")
    assert [channel.has_signal for channel in unplugged.channels] == [True, False]
    assert "takes 3 different values only, from -0.0001 to 0.0001" in unplugged.notes[0]
    np.testing.assert_array_equal(unplugged.values[:, 0].max(), 1.0)


def test_recorded_artefacts():
    clean = from_folder("artefact/clean.csv")
    assert clean.notes == ()
    spike = from_folder("artefact/spike.csv")
    assert [(one.column, one.kind, one.start, one.value) for one in spike.artefacts] == [("RF", "spike", 4.1, 12.0)]
    removed = from_folder("artefact/spike.csv", remove_spikes=True)
    assert np.abs(removed.values - clean.values).max() < 0.02
    clipped = from_folder("artefact/clipped.csv")
    assert [(one.column, one.kind, one.value) for one in clipped.artefacts] == [
        (name, "clipping", level) for name in ("RF", "BF") for level in (0.1, -0.1)
    ]
    short = from_folder("artefact/nan_10ms.csv")
    assert (short.channels[0].gaps.count, short.channels[0].gaps.samples) == (1, 10)
    assert np.abs(short.values - clean.values).max() < 0.05
    with pytest.raises(FieldError, match=r"longest_gap is 0.1; a number >= 2 in s is needed, for channel RF has no"):
        from_folder("artefact/nan_2s.csv")
    kept = from_folder("artefact/nan_2s.csv", keep_gaps=True)
    assert runs(np.isnan(kept.values[:, 0])).tolist() == [[1000, 3000]]


@pytest.mark.parametrize("name", ["5Nsen.txt", "5Npie.txt"])
def test_recorded_emg_of_a_man_is_no_artefact(name):
    result = envelopes(read_recording(recorded("emg_lower_limb") / name))
    assert result.artefacts == ()
