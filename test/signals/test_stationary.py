"""A stretch of a stationary process against the dense equations."""

import numpy as np
import pytest
from scipy.fft import irfft, rfftfreq
from scipy.linalg import solve, toeplitz

from frac_accel.signals.stationary import stationary


@pytest.mark.parametrize("seed", range(4))
def test_the_best_guess_is_that_of_the_dense_equations(seed):
    rng = np.random.default_rng([49, seed])
    count = int(rng.integers(500, 900))
    values = np.cumsum(rng.normal(size=count)) * 0.1 + rng.normal(size=count)
    values = (values - values.mean()) / values.std()
    record = stationary(values)
    frequency = rfftfreq(record.length)
    response = np.sinc(frequency * rng.uniform(3, 8)) / (1 + rng.uniform(1, 9) * frequency)
    covariance, crossing = (irfft(power, record.length)[:count]
                            for power in (record.power, response * record.power))
    exact = toeplitz(crossing) @ solve(toeplitz(covariance), values)
    assert np.allclose(record.filtered(response, response), exact, atol=1e-4)


@pytest.mark.parametrize("seed", range(4))
def test_nothing_rings_in_from_the_ends(seed):
    """White noise behind an average is its best guess away from a notch, at the ends too; divided
    line by line, a record that is taken for periodic rings from there."""
    rng = np.random.default_rng([50, seed])
    count, room = 4000, 400
    length = int(rng.integers(5, 12))
    motion = np.cumsum(rng.normal(size=count + 2 * room))
    motion = motion - np.linspace(0, motion[-1], len(motion))
    motion /= motion.std()
    noise = 1e-3 * rng.normal(size=count)
    recorded = np.convolve(motion, np.ones(length) / length, "same")[room:-room] + noise
    level, scale = recorded.mean(), recorded.std()
    record = stationary((recorded - level) / scale)
    frequency = rfftfreq(record.length)
    with np.errstate(invalid="ignore"):
        kept = np.nan_to_num(np.sin(np.pi * length * frequency)
                             / (length * np.sin(np.pi * frequency)), nan=1.0)
    # two samples after one another tell where an average of an even length is centred
    shift = np.exp(1j * np.pi * frequency * (1 - length % 2))
    white = (1e-3 / scale)**2
    power = np.maximum(record.power - white, 0.0)
    best = kept * power / np.maximum(record.power, 1e-300) / np.maximum(kept**2, 1e-4)
    guess = level + scale * record.filtered(best * shift, best * shift)
    error = guess - motion[room:-room]
    ends = np.r_[error[:200], error[-200:]]
    assert np.std(ends) < 2 * np.std(error[200:-200])
