"""Values that a faster clock sends again are no samples, and coarse ones are."""

import numpy as np
import pytest

from frac_accel import Samples
from frac_accel.record import Record
from frac_accel.record.held import first_of_held

RATE_HZ = 400.0


def moving(rng, count):
    """Motion up to a tenth of the rate, in metres per second squared."""
    values = np.convolve(rng.normal(size=count + 40), np.hanning(41) / 8, "valid")
    return np.c_[values, np.zeros((count, 2))]


def samples(values):
    return Samples.of(np.arange(len(values)) * round(1e9 / RATE_HZ), values)


@pytest.mark.parametrize("seed", range(5))
def test_values_that_are_held_count_once(seed):
    rng = np.random.default_rng([881, seed])
    length = rng.uniform(1.6, 7.0)
    values = moving(rng, 8000)
    # a clock of its own: now and then a value is held for one sample more or less
    taken = (np.floor(np.arange(8000) / length) * length).astype(int)
    few, mean = first_of_held(samples(values[taken]))
    assert mean == pytest.approx(length, rel=0.01)
    assert np.array_equal(few.values, values[np.unique(taken)])


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("step", [0.3, 1.0, 3.0])
def test_coarse_values_and_stillness_are_not_held(seed, step):
    rng = np.random.default_rng([882, seed])
    values = moving(rng, 8000)
    values[3000:4000] = values[3000]
    coarse = samples(step * np.std(values[:, 0]) * np.round(
        values / np.std(values[:, 0]) / step))
    assert first_of_held(coarse) == (coarse, 1.0)


def test_the_rest_around_a_shock_is_not_held():
    rng = np.random.default_rng(884)
    values = np.zeros((8000, 3))
    values[4000:5000] = moving(rng, 1000)
    still = samples(values)
    assert first_of_held(still) == (still, 1.0)


def test_a_record_says_that_values_are_held():
    rng = np.random.default_rng(883)
    values = moving(rng, 8000)
    noisy = values + 1e-3 * rng.normal(size=values.shape) * [1, 0, 0]
    record = Record.of(samples(values), samples(noisy[np.arange(8000) // 4 * 4]))
    assert "the sensor holds each value for 4 samples: the first of them counts, at 100 Hz" \
        in record.words
    assert record.sampling_rate_hz == pytest.approx(100.0)
    error = (record.sensor - record.reference)[record.valid, 0]
    assert np.std(error) < 0.01 * np.std(values[:, 0])
