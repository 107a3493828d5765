"""The sampling rate from bad stamps, and the stated policy for each thing that stamps can do."""

import numpy as np
import pytest

from frac_accel import Corrector
from frac_accel.model import SensorModel
from frac_accel.record.clock import Clock
from frac_accel.signals.sample_rate import estimate_rate
from frac_accel.streaming.timing import PATIENCE

RATE = 1000.0
INTERVAL = 1_000_000
START = 1_700_000_000_000_000_000
N = 1200


def corrector(rate=RATE, **wishes):
    return Corrector(SensorModel.from_dict({
        "schema": "frac_accel/sensor_model/1",
        "core": {"natural_frequency_hz": 150.0, "damping_ratio": 0.2}}), rate, **wishes)


def uniform(n=N):
    return START + np.arange(n, dtype=np.int64) * INTERVAL


def slow_motion(stamps):
    t = (stamps - START) * 1e-9
    return np.stack([np.sin(2 * np.pi * f * t) for f in (3.0, 5.0, 7.0)], axis=1)


def run(stamps, values=None):
    kernel = corrector()
    result = kernel.process(stamps, slow_motion(stamps) if values is None else values)
    return kernel, result


def events(kernel, *but):
    """Counters of the clock that are not zero."""
    names = ("jitter", "gaps", "filled", "duplicates", "stamps_back", "early", "not_finite",
             "restarts")
    return {name: kernel.counters[name] for name in names
            if kernel.counters[name] and name not in but}


@pytest.mark.parametrize("rate", [0.5, 100.0, 1000.0 / 3, 2000.0, 1e6])
def test_rate_of_clean_stamps(rate):
    stamps = START + np.round(np.arange(100) * 1e9 / rate).astype(np.int64)
    assert abs(estimate_rate(stamps) / rate - 1) < 1e-5


@pytest.mark.parametrize("seed", range(5))
def test_rate_through_jitter_gaps_duplicates_and_bursts(seed):
    rng = np.random.default_rng(seed)
    rate = float(rng.choice([100.0, 400.0, 2000.0]))
    times = np.arange(400) / rate + rng.normal(size=400) * 0.05 / rate
    kept = rng.random(400) > 0.1            # lost samples
    times = times[kept]
    times[200:] += 37.3 / rate              # one long pause
    stamps = START + np.round(times * 1e9).astype(np.int64)
    stamps[50] = stamps[49]                 # a duplicate
    assert abs(estimate_rate(stamps) / rate - 1) < 2e-3


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("rounded", [np.floor, np.round])
def test_rate_of_stamps_that_are_rounded_to_milliseconds(seed, rounded):
    rng = np.random.default_rng([71, seed])
    rate = rng.uniform(80.0, 480.0)
    ticks = rounded(1e3 * (np.arange(20_000) / rate + rng.uniform(0, 1e-3)))
    kept = rng.random(len(ticks)) > rng.uniform(0, 0.4)
    stamps = START + ticks[kept].astype(np.int64) * 1_000_000
    assert abs(estimate_rate(stamps) / rate - 1) < 0.02
    clock = Clock.of(stamps)
    assert clock.kind == "regular" and abs(clock.rate_hz / rate - 1) < 1e-4
    assert clock.slot[-1] == pytest.approx(np.flatnonzero(kept)[-1] - np.flatnonzero(kept)[0])


@pytest.mark.parametrize("stamps", [[], [5], [5, 5, 5], [9, 5, 1]])
def test_no_rate_where_no_stamp_advances(stamps):
    assert estimate_rate(stamps) is None


def test_uniform_stamps_meet_no_event():
    kernel, result = run(uniform())
    assert events(kernel) == {}
    assert len(result) == N - kernel.design.warm_up_samples


def test_rounded_stamps_of_an_odd_rate_meet_no_event():
    stamps = START + np.round(np.arange(N) * 1e9 / 1024).astype(np.int64)
    kernel = corrector(1024.0)
    kernel.process(stamps, slow_motion(stamps))
    assert events(kernel) == {}


@pytest.mark.parametrize("ppm", [-300, 300])
def test_a_clock_that_is_a_little_off_is_followed(ppm):
    stamps = START + np.round(np.arange(20_000) * INTERVAL * (1 + 1e-6 * ppm)).astype(np.int64)
    kernel, result = run(stamps)
    assert events(kernel) == {}
    assert len(result) == 20_000 - kernel.design.warm_up_samples


def test_jitter_is_counted_and_nothing_lost():
    rng = np.random.default_rng(0)
    stamps = uniform() + np.round(rng.normal(size=N) * 0.15 * INTERVAL).astype(np.int64)
    kernel, result = run(stamps)
    assert set(events(kernel)) == {"jitter"}
    assert 0.3 * N < kernel.counters["jitter"] < 0.8 * N
    assert len(result) == N - kernel.design.warm_up_samples
    np.testing.assert_array_equal(result.stamps_ns, stamps[result.index])


def test_single_late_stamp_is_jitter_not_a_gap():
    stamps = uniform()
    stamps[600] += int(0.6 * INTERVAL)
    kernel, _ = run(stamps)
    assert events(kernel) == {"jitter": 1}


@pytest.mark.parametrize("missing", [1, 2, 7])
def test_short_gap_is_bridged(missing):
    stamps = np.delete(uniform(), np.arange(600, 600 + missing))
    kernel, result = run(stamps)
    assert events(kernel) == {"gaps": 1, "filled": missing}
    assert (np.diff(result.index) == 1).all()  # every sample that came is given out
    error = np.abs(result.values - slow_motion(stamps)[result.index])
    assert np.max(error) < 0.02  # straight across seven samples of a slow sine


def test_long_gap_starts_anew():
    stamps = uniform()
    stamps[600:] += 100 * INTERVAL
    kernel, result = run(stamps)
    assert events(kernel) == {"restarts": 1}
    warm_up, delay = kernel.design.warm_up_samples, kernel.design.delay_samples
    assert kernel.counters["cut_off"] == delay
    missing = np.setdiff1d(np.arange(result.index[0], result.index[-1] + 1), result.index)
    np.testing.assert_array_equal(missing, np.arange(600 - delay, 600 + warm_up - delay))


def test_duplicate_stamp_is_dropped():
    stamps = np.insert(uniform(), 600, uniform()[599])
    values = slow_motion(stamps)
    values[600] = 99.0
    kernel, result = run(stamps, values)
    assert events(kernel) == {"duplicates": 1}
    assert 600 not in result.index
    assert np.max(np.abs(result.values)) < 2


def test_stamp_that_goes_back_is_dropped():
    stamps = np.insert(uniform(), 600, uniform()[590])
    kernel, result = run(stamps)
    assert events(kernel) == {"stamps_back": 1}
    assert 600 not in result.index


def test_clock_that_is_set_back_is_believed_after_a_while():
    stamps = uniform()
    stamps[600:] -= 3600 * 10**9
    kernel, result = run(stamps, slow_motion(uniform()))
    assert events(kernel) == {"stamps_back": PATIENCE, "restarts": 1}
    assert result.index[-1] == N - 1 - kernel.design.delay_samples


def test_constant_stamps_give_nothing_and_say_why():
    kernel = corrector()
    result = kernel.process(np.full(300, START), np.zeros((300, 3)))
    assert len(result) == 0
    assert events(kernel) == {"duplicates": 299}


def test_one_sample_too_many_is_dropped():
    stamps = np.insert(uniform(), 600, uniform()[599] + INTERVAL // 20)
    kernel, result = run(stamps)
    assert events(kernel) == {"early": 1}
    assert 600 not in result.index


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_sample_that_is_not_finite_is_dropped_and_bridged(bad):
    stamps = uniform()
    values = slow_motion(stamps)
    values[600, 1] = bad
    kernel, result = run(stamps, values)
    assert events(kernel) == {"not_finite": 1, "gaps": 1, "filled": 1}
    assert 600 not in result.index
    assert np.isfinite(result.values).all()


def test_stream_that_begins_with_nan():
    stamps = uniform()
    values = slow_motion(stamps)
    values[:40] = np.nan
    kernel, result = run(stamps, values)
    assert events(kernel) == {"not_finite": 40}
    assert result.index[0] == 40 + kernel.design.warm_up_samples - kernel.design.delay_samples


def test_all_nan_gives_nothing_and_counts():
    kernel, result = run(uniform(), np.full((N, 3), np.nan))
    assert len(result) == 0
    assert events(kernel) == {"not_finite": N}


def test_wrong_rate_shows_as_events():
    """Stamps at half the stated rate: every second sample looks lost."""
    kernel, _ = run(START + np.arange(400, dtype=np.int64) * 2 * INTERVAL)
    assert kernel.counters["gaps"] == 399 or kernel.counters["gaps"] > 300


def test_absurd_stamps_do_not_crash():
    rng = np.random.default_rng(1)
    stamps = rng.integers(-2**62, 2**62, 500)
    kernel, _ = run(stamps, rng.normal(size=(500, 3)))
    assert kernel.counters["samples"] == 500
    stamps = np.array([np.iinfo(np.int64).min, np.iinfo(np.int64).max, 0, 5] * 50)
    kernel, _ = run(stamps, rng.normal(size=(200, 3)))
    assert kernel.counters["samples"] == 200
