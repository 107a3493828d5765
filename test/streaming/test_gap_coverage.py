"""The stated variance holds over gaps of any length and losses up to a half; beyond, nothing."""

import numpy as np
import pytest
import rig
from random_models import model_of

from frac_accel import Corrector
from frac_accel.errors import FracAccelError
from frac_accel.signals.metrics import interpolate
from frac_accel.signals.sample_rate import estimate_rate
from frac_accel.streaming.bridging import MEMBERS, BridgeErrors
from frac_accel.streaming.timing import tells_rate

RATE = 1000.0
START = 1_700_000_000_000_000_000
ORDERS = (0.5, 1.0, 1.5)
SEEDS = 2


def record_of(order, seed, snr_db=40.0):
    rng = np.random.default_rng([20, seed])
    sensor = rig.Sensor({"type": "oscillator", "natural_frequency_hz": 10 ** rng.uniform(1.7, 2.3),
                         "damping_ratio": 0.2, "damping_order": order, "sensitivity": 1.0})
    top = 0.6 * sensor.core["natural_frequency_hz"]
    excitation = rig.band_noise(rng, RATE, 12.0, (rng.uniform(0.5, 5.0), top), lead_s=0.5)
    return rng, model_of(sensor), rig.simulate_record(sensor, excitation, rng, snr_db), 1.2 * top


def scaled_errors(order, seed, keep, snr_db=40.0):
    """Errors over deviations of the samples that are as close to a gap as the filter is long."""
    rng, model, record, bandwidth = record_of(order, seed, snr_db)
    kernel = Corrector(model, RATE, bandwidth_hz=bandwidth, noise_std=record.noise_std)
    delay = kernel.design.delay_samples
    kept = keep(rng, len(record.sensor), kernel.design.warm_up_samples)
    result = kernel.process(record.stamps_ns[kept], record.sensor[kept])
    truth = interpolate(record.stamps_ns, record.reference, result.stamps_ns, RATE)
    scaled = (result.values - truth) / np.sqrt(result.variance)
    near = np.convolve(~kept, np.ones(2 * delay + 1), "same") > 0.5
    chosen = near[np.flatnonzero(kept)[result.index]] & np.isfinite(truth).all(axis=1)
    return scaled[chosen], kernel.counters


def gaps(share):
    """Gaps of a share of the longest that is bridged, and of as much again to recover in."""
    def keep(rng, n, longest):
        kept, length = np.ones(n, bool), max(int(share * longest), 1)
        for at in range(300, n - 2 * longest, 3 * longest):
            kept[at:at + length] = False
        return kept
    return keep


def losses(share):
    def keep(rng, n, longest):
        return rng.random(n) > share * (np.arange(n) > 300)
    return keep


KEPT = {"a sample": gaps(0.0), "0.3 of the longest": gaps(0.3), "the longest": gaps(1.0),
        "2 % lost": losses(0.02), "30 % lost": losses(0.3), "50 % lost": losses(0.5)}


@pytest.mark.parametrize("snr_db", [40.0, 60.0])
@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("keep", KEPT)
def test_two_deviations_hold_nineteen_of_twenty(order, keep, snr_db):
    runs = [scaled_errors(order, seed, KEPT[keep], snr_db) for seed in range(SEEDS)]
    scaled = np.concatenate([scaled for scaled, _ in runs])
    assert len(scaled) > 300
    assert 0.93 <= np.mean(np.abs(scaled) < 2) <= 0.97
    assert np.mean(np.abs(scaled) > 4) < 2e-3
    assert all(counters["gaps"] > 10 for _, counters in runs)


@pytest.mark.parametrize("snr_db", [40.0, 60.0])
@pytest.mark.parametrize("order", ORDERS)
def test_so_they_do_a_second_after_the_start(order, snr_db):
    """What came before is unknown, and the filter's own error is as large as the noise at 60 dB."""
    scaled = []
    for seed in range(SEEDS):
        _, model, record, bandwidth = record_of(order, seed, snr_db)
        kernel = Corrector(model, RATE, bandwidth_hz=bandwidth, noise_std=record.noise_std)
        result = kernel.process(record.stamps_ns, record.sensor)
        truth = interpolate(record.stamps_ns, record.reference, result.stamps_ns, RATE)
        later = (result.index > RATE) & np.isfinite(truth).all(axis=1)
        scaled.append(((result.values - truth) / np.sqrt(result.variance))[later])
    assert 0.93 <= np.mean(np.abs(np.concatenate(scaled)) < 2) <= 0.97


@pytest.mark.parametrize("share", [0.3, 0.5])
@pytest.mark.parametrize("order", [0.5, 1.0])
def test_so_they_do_where_samples_are_lost_from_the_first_on(order, share):
    """A gap before anything is known of the motion is no ground for a deviation beyond all."""
    def keep(rng, n, longest):
        kept = (rng.random(n) > share) & (np.arange(n) < 4000)
        kept[:6] = True, False, True, False, False, True
        return kept

    scaled, largest = [], []
    for seed in range(4):
        rng, model, record, bandwidth = record_of(order, seed)
        kernel = Corrector(model, RATE, bandwidth_hz=bandwidth, noise_std=record.noise_std)
        kept = keep(rng, len(record.sensor), None)
        result = kernel.process(record.stamps_ns[kept], record.sensor[kept])
        truth = interpolate(record.stamps_ns, record.reference, result.stamps_ns, RATE)
        scaled.append(((result.values - truth) / np.sqrt(result.variance))[200:])
        largest.append(np.sqrt(result.variance).max() / np.std(record.reference))
    assert 0.93 < np.mean(np.abs(np.concatenate(scaled)) < 2) < 0.975
    assert max(largest) < 100


@pytest.mark.parametrize("order", [0.5, 1.0])
def test_nothing_is_given_while_nine_of_ten_are_lost(order):
    runs = [scaled_errors(order, seed, losses(0.9)) for seed in range(SEEDS)]
    scaled = np.concatenate([scaled for scaled, _ in runs])
    assert all(counters["given"] < 600 for _, counters in runs)
    assert np.mean(np.abs(scaled) < 2) > 0.93


def test_it_goes_on_when_the_losses_are_over():
    _, counters = scaled_errors(1.0, 0, lambda rng, n, _: (
        (rng.random(n) > 0.9) | (np.arange(n) < 2000) | (np.arange(n) > 4000)))
    assert counters["given"] > len(range(4000, 12_000)) - 200
    assert counters["restarts"] > 100


@pytest.mark.parametrize("lost", [0.0, 0.3, 0.5, 0.7, 0.9, 0.95])
@pytest.mark.parametrize("jitter", [0.0, 0.02])
def test_the_rate_is_right_or_not_told_however_many_are_lost(lost, jitter):
    told = 0
    for seed in range(40):
        rng = np.random.default_rng([21, seed])
        times = np.arange(4000) + jitter * rng.normal(size=4000)
        stamps = START + np.round(times[rng.random(4000) > lost][:100] * 1e9 / RATE).astype(int)
        if tells_rate(stamps):
            told += 1
            assert abs(estimate_rate(stamps) / RATE - 1) < 5e-3
    assert told == 40 if lost < 0.4 else told < 40 if lost > 0.6 else told > 20


def test_a_stream_of_lost_samples_is_not_given_a_wrong_rate():
    rng, model, record, _ = record_of(1.0, 1)
    kept = rng.random(len(record.sensor)) > 0.9
    kernel = Corrector(model, noise_std=0.01)
    result = kernel.process(record.stamps_ns[kept], record.sensor[kept])
    assert len(result) == 0 and kernel.sampling_rate_hz is None
    assert kernel.counters["without_rate"] >= 1000
    with pytest.raises(FracAccelError, match="sampling rate cannot be estimated"):
        kernel.finish()


def test_and_it_starts_when_enough_come():
    rng, model, record, _ = record_of(1.0, 1)
    kept = (rng.random(len(record.sensor)) > 0.9) | (np.arange(len(record.sensor)) > 5000)
    stamps, values = record.stamps_ns[kept], record.sensor[kept]
    whole, parts = Corrector(model), Corrector(model)
    one = whole.process(stamps, values)
    many = [parts.process(stamps[i:i + 37], values[i:i + 37]) for i in range(0, len(stamps), 37)]
    assert abs(whole.sampling_rate_hz / RATE - 1) < 1e-3 and len(one) > 6500
    np.testing.assert_array_equal(one.values, np.concatenate([part.values for part in many]))
    assert whole.counters == parts.counters


@pytest.mark.parametrize("missing", [1, 2, 7, 40, 100])
def test_the_ensemble_has_the_covariance_of_the_bridges_errors(missing):
    """Against the errors of all bridges in a long record of the same process."""
    rng = np.random.default_rng(22)
    wave = np.convolve(rng.normal(size=60_000), np.hanning(80), "valid")[:, None]
    signal = wave * [1.0, 10.0, 0.1]
    errors = BridgeErrors(120)
    errors.add(signal[:40_000])
    drawn = np.mean([errors.draw(missing, np.zeros(3), np.zeros(3)) for _ in range(3)], axis=0)
    assert drawn.shape == (missing, 3, MEMBERS)
    drawn = errors.draw(missing, np.zeros(3), np.zeros(3))
    share = np.arange(1, missing + 1)[:, None] / (missing + 1)
    actual = np.stack([
        signal[at + 1:at + missing + 1] - (1 - share) * signal[at]
        - share * signal[at + missing + 1] for at in range(36_000, 39_800)], axis=-1)
    for axis in range(3):
        expected = actual[:, axis] @ actual[:, axis].T / actual.shape[-1]
        found = drawn[:, axis] @ drawn[:, axis].T / MEMBERS
        assert np.abs(found - expected).max() < 0.25 * np.abs(expected).max()


@pytest.mark.parametrize("between", [1, 3, 8])
def test_the_errors_of_neighbours_belong_together_as_in_the_record(between):
    rng = np.random.default_rng(23)
    wave = np.convolve(rng.normal(size=60_000), np.hanning(40), "valid")[:, None]
    signal = wave * [1.0, 10.0, 0.1]
    errors = BridgeErrors(120)
    errors.add(signal[:40_000])
    first = errors.draw(1, np.zeros(3), np.zeros(3))[0]
    errors.add(np.concatenate([np.full((1, 3), np.nan), signal[:between]]))
    second = errors.draw(1, np.zeros(3), np.zeros(3))[0]
    bend = -np.diff(signal[:40_000], 2, axis=0) / 2
    for axis in range(3):
        expected = np.mean(bend[between + 1:, axis] * bend[:-between - 1, axis])
        size = np.mean(bend[:, axis]**2)
        assert abs(np.mean(first[axis] * second[axis]) - expected) < 0.2 * size
        assert abs(np.mean(second[axis]**2) / size - 1) < 0.2
    errors.forget()
    alone = errors.draw(1, np.zeros(3), np.zeros(3))[0]
    assert abs(np.mean(first * alone)) < 1e-9 * np.mean(first**2)


def test_lags_that_no_pair_of_samples_has_are_not_taken_for_known():
    errors = BridgeErrors(50)
    errors.add(np.random.default_rng(0).normal(size=(8, 3)))
    short = errors.draw(1, np.zeros(3), np.zeros(3))
    long = errors.draw(50, np.zeros(3), np.zeros(3))
    assert np.mean(long**2) > np.mean(short**2) > 0.1


@pytest.mark.parametrize("ahead_ns", [3_600_000_000_000, 365 * 86_400_000_000_000, 2**62])
def test_a_stamp_far_ahead_takes_no_memory(ahead_ns):
    import tracemalloc
    _, model, record, _ = record_of(0.5, 2)
    stamps = record.stamps_ns.copy()
    stamps[3000:] += ahead_ns
    kernel = Corrector(model, RATE, noise_std=0.01)
    tracemalloc.start()
    result = kernel.process(stamps, record.sensor)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 60e6 and kernel.counters["restarts"] == 1 and len(result) > 10_000
