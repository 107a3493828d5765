"""The filter to a band that is compared, by one transform."""

import numpy as np
import pytest
from scipy.signal import convolve

from frac_accel.record.resampling import inner_filter, inner_taps


@pytest.mark.parametrize("seed", range(8))
def test_it_is_the_sum_over_its_taps_and_each_so_many_th_of_that_is_enough(seed):
    rng = np.random.default_rng([1, seed])
    every, count = int(rng.integers(2, 17)), int(rng.integers(900, 3000))
    rate_hz = rng.uniform(50, 500)
    band_hz = rng.uniform(0.3, 0.4) * rate_hz
    values = np.cumsum(rng.normal(size=every * count)) + rng.normal()
    taps = inner_taps(every * rate_hz, band_hz, len(values))
    half = len(taps) // 2
    # an odd reflection at both ends
    longer = np.r_[2 * values[0] - values[half:0:-1], values,
                   2 * values[-1] - values[-2:-2 - half:-1]]
    summed = convolve(longer, taps, "valid", "direct")
    whole = inner_filter(every * rate_hz, band_hz, len(values))(values)
    assert np.abs(whole - summed).max() < 1e-11 * np.abs(summed).max()
    few = inner_filter(every * rate_hz, band_hz, len(values), every)(values)
    # what is beyond half the lower rate is 80 dB down
    assert few.shape == (count,)
    assert np.abs(few - summed[::every])[half // every:-half // every].max() \
        < 1e-4 * np.std(np.diff(values)) * np.sqrt(every)


@pytest.mark.parametrize("seed", range(4))
def test_it_may_be_late_by_a_part_of_a_sample(seed):
    rng = np.random.default_rng([2, seed])
    every, count, rate_hz, late = int(rng.integers(2, 17)), 2000, 100.0, rng.uniform(0, 1)
    frequency_hz = rng.uniform(1, 25, 5)
    time = np.arange(every * count) / (every * rate_hz)

    def motion(at):
        return np.sin(2 * np.pi * np.outer(at, frequency_hz) + np.arange(5)).sum(axis=1)
    found = inner_filter(every * rate_hz, 40.0, len(time), every)(motion(time), late)
    wanted = motion(time[::every] - late / (every * rate_hz))
    assert np.abs(found - wanted)[100:-100].max() < 1e-3
