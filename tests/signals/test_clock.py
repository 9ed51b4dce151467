"""The even clock behind stamps: odd rates, rounding, noise, packets, drift, gaps; and stamps that have none."""

from __future__ import annotations

import numpy as np
import pytest

from limb_nodes.errors import FieldError, UserError
from limb_nodes.signals.clock import Fitted, fit_clock

ROWS = 20_000
# Delsys Trigno, OpenBCI, Myo, round ones, and clocks that drift by 30 ppm.
RATES = [
    148.1481,
    200.0,
    250.0,
    1259.2593,
    1925.9259,
    2000.0,
    2148.1481,
    1e3 * (1 - 30e-6),
    2e3 * (1 + 30e-6),
    4370.629,
]


def place(row: int) -> str:
    return f"line {row + 2}"


def fitted(times: np.ndarray, rate: float | None = None, stated: float | None = None) -> Fitted:
    return fit_clock("made.csv", np.asarray(times, dtype=float), place, rate, stated)


def refusal(times: np.ndarray, **options: float) -> str:
    with pytest.raises(UserError) as refused:
        fitted(times, **options)
    line = str(refused.value)
    assert line.startswith("made.csv")
    assert "\n" not in line
    return line


def spans(clock: Fitted, rate: float, rows: int) -> None:
    """Every row has its tick, and the last one comes when it was sampled, to a sample."""
    assert clock.ticks is None
    assert clock.wander is None
    assert abs((rows - 1) / clock.rate - (rows - 1) / rate) * rate < 1.0


@pytest.mark.parametrize("start", [0.0, 12.3456789, 1_772_460_000.123])
@pytest.mark.parametrize("decimals", [3, 4, 5, 6])
@pytest.mark.parametrize("rate", RATES)
def test_odd_rates_with_rounded_times(rate: float, decimals: int, start: float) -> None:
    times = np.round(start + np.arange(ROWS) / rate, decimals)
    clock = fitted(times)
    spans(clock, rate, ROWS)
    assert clock.start == pytest.approx(start, abs=1.0 / rate)


@pytest.mark.parametrize("rate", RATES)
def test_times_cut_instead_of_rounded(rate: float) -> None:
    spans(fitted(np.floor(np.arange(ROWS) / rate * 1e3) / 1e3), rate, ROWS)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("rate", [250.0, 1000.0, 2148.1481])
def test_noise_on_stamps(rate: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    even = np.arange(ROWS) / rate
    for noise in (0.05 / rate, 0.5 / rate, 0.002):
        spans(fitted(even + rng.uniform(0.0, noise, ROWS)), rate, ROWS)
        # Stamps of reception: seldom very late, never early, in order.
        late = even + rng.exponential(noise, ROWS)
        spans(fitted(np.maximum.accumulate(late)), rate, ROWS)


@pytest.mark.parametrize("size", [2, 7, 32, 100])
def test_packets_share_a_stamp(size: int) -> None:
    even = np.arange(ROWS) / 1000.0
    last = np.minimum(np.arange(ROWS) // size * size + size - 1, ROWS - 1)
    spans(fitted(even[last]), 1000.0, ROWS)


def test_packets_of_any_size() -> None:
    rng = np.random.default_rng(3)
    ends = np.minimum(np.cumsum(rng.integers(5, 40, ROWS)), ROWS - 1)
    last = ends[np.searchsorted(ends, np.arange(ROWS))]
    spans(fitted(last / 1000.0 + rng.exponential(0.001)), 1000.0, ROWS)


def test_exact_times_give_the_exact_rate() -> None:
    for rate in (1000.0, 2000.0, 1024.0, 250.0, 100.0 / 3.0, 1e5):
        spans(fitted(np.arange(3000) / rate), rate, 3000)
        assert fitted(np.arange(3000) / rate).rate == pytest.approx(rate, rel=1e-5)
    assert fitted(np.arange(3000) / 1000.0).rate == 1000.0
    assert fitted(np.array([10.0, 10.5, 11.0]) * 1e-3).rate == 2000.0


@pytest.mark.parametrize("decimals", [3, 4, 7])
def test_missing_rows_are_counted(decimals: int) -> None:
    ticks = np.delete(np.arange(6000), np.r_[1000:1010, 3000, 4000:4200])
    clock = fitted(np.round(ticks / 1000.0, decimals))
    assert clock.rate == 1000.0
    np.testing.assert_array_equal(clock.ticks, ticks)
    assert clock.notes == ("rows missing between the first and the last time: 211",)
    even = clock.even(np.column_stack([ticks, -ticks]).astype(float))
    assert even.shape == (6000, 2)
    assert np.isnan(even[1000:1010]).all()
    np.testing.assert_array_equal(even[ticks, 0], ticks)


@pytest.mark.parametrize("rate", [1000.0, 1000.0 * (1 - 30e-6), 1000.0 * (1 + 30e-6)])
def test_missing_rows_beside_rounding_as_coarse_as_the_steps(rate: float) -> None:
    ticks = np.delete(np.arange(100_000), np.r_[60_000:60_100])
    clock = fitted(np.round(ticks / rate, 3))
    assert abs(clock.count - 100_000) <= 1
    assert abs(clock.count / clock.rate - 100_000 / rate) * rate < 1.5


def test_missing_rows_between_noisy_stamps() -> None:
    rng = np.random.default_rng(1)
    ticks = np.delete(np.arange(10_000), np.r_[5000:5200])
    clock = fitted(ticks / 1000.0 + rng.uniform(0.0, 0.002, len(ticks)))
    assert clock.ticks is not None
    assert clock.ticks[-1] == pytest.approx(9999, abs=1)
    assert clock.rate == pytest.approx(1000.0, rel=2e-4)


def test_missing_packets() -> None:
    packets = np.delete(np.arange(500), [100, 101, 102, 300, 301, 302, 303, 304])
    ticks = (packets[:, None] * 20 + np.arange(20)).ravel()
    clock = fitted(np.repeat(packets * 0.02, 20))
    assert clock.ticks is not None
    assert clock.ticks[-1] == pytest.approx(ticks[-1], abs=1)
    assert clock.rate == pytest.approx(1000.0, rel=2e-4)


def test_slow_drift_is_resampled() -> None:
    rows = 200_000
    ticks = np.arange(rows) / 1000.0
    # The device warms up: 100 ppm less over 200 s.
    true = ticks + 1e-4 * 20.0 * np.exp(-ticks / 20.0)
    clock = fitted(np.round(true, 6))
    assert clock.wander is None or np.ptp(clock.wander) < 0.01
    values = np.sin(2 * np.pi * 5.0 * true)[:, None]
    even = clock.even(values)
    expected = np.sin(2 * np.pi * 5.0 * (clock.start + np.arange(clock.count) / clock.rate))
    assert np.abs(even[:, 0] - expected)[1000:-1000].max() < 0.05


@pytest.mark.parametrize("back", [0.002, 0.05, 1.0, 3600.0])
def test_jump_back_is_refused_with_the_row(back: float) -> None:
    times = np.arange(2000) / 1000.0
    times[1200:] -= back
    assert "line 1202: time is " in refusal(times)
    assert fitted(times, rate=1000.0).rate == 1000.0


def test_clock_that_was_set_is_refused_with_the_row() -> None:
    times = np.arange(2000) / 1000.0
    times[1200:] += 3600.0
    assert "line 1202: time is 3601.2, 3600 s after the one before, as if the clock was set" in refusal(times)
    clock = fitted(times, rate=1000.0)
    assert clock.ticks is None
    assert "times not used" in clock.notes[0]


@pytest.mark.parametrize("noise", [0.0, 1e-4])
@pytest.mark.parametrize(
    ("first", "second"), [(1000.0, 500.0), (500.0, 1000.0), (1000.0, 1100.0), (2148.1481, 148.1481)]
)
def test_changed_rate_is_refused_with_the_row(first: float, second: float, noise: float) -> None:
    rng = np.random.default_rng(5)
    times = np.concatenate([np.arange(1500) / first, 1500 / first + np.arange(1500) / second])
    times += rng.uniform(0.0, noise, len(times)) / first * 1000.0
    line = refusal(times)
    assert "one rate is needed" in line
    row = int(line.split("line ")[1].split(":")[0]) - 2
    assert abs(row - 1500) <= (2 if noise == 0.0 else 40)


def test_wandering_times_are_refused() -> None:
    rng = np.random.default_rng(2)
    assert "even distance" in refusal(np.cumsum(rng.exponential(0.001, 5000)))


def test_missing_time_is_refused() -> None:
    times = np.arange(100) / 100.0
    times[40] = np.nan
    assert "line 42: time is missing" in refusal(times)


@pytest.mark.parametrize("times", [[0.0, 0.0, 0.0], [3.0, 2.0, 1.0], [1.0]])
def test_times_that_do_not_rise(times: list[float]) -> None:
    refusal(np.array(times))


def test_given_rate_always_counts() -> None:
    times = np.arange(5000) / 1000.0
    clock = fitted(times, rate=500.0)
    assert clock.rate == 500.0
    assert "rate 500 Hz as given; the times say 1000 Hz" in clock.notes
    assert fitted(times, rate=1000.001).notes == ()
    with pytest.raises(FieldError, match="rate is 0"):
        fitted(times, rate=0.0)


def test_stated_rate_counts_if_the_times_allow_it() -> None:
    rounded = np.round(np.arange(5000) / 2148.1481, 3)
    assert fitted(rounded, stated=2148.1481).rate == 2148.1481
    drifting = np.arange(50_000) / (1000.0 * (1 - 60e-6))
    assert fitted(drifting, stated=1000.0).rate == pytest.approx(999.94, rel=1e-6)
    assert "the file states 2000 Hz, its times say 1000 Hz" in refusal(np.arange(5000) / 1000.0, stated=2000.0)


def test_size_from_a_stamp_is_checked_before_it_is_taken() -> None:
    times = np.arange(100.0)
    times[50:] += 1e18
    assert "line 52" in refusal(times)
    times[50:] = 1e300
    refusal(times)
