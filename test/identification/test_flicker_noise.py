"""Uncertainties hold beside flicker noise, of which slow parameters see most."""

import numpy as np
import pytest

from frac_accel.identification.fit.uncertainty import by_blocks, sandwich

RATE_HZ, DRAWS = 200.0, 150


def noise(rng, count, corner_hz):
    """Unit white noise with flicker noise that is as strong at a corner, from before the record."""
    frequency = np.fft.rfftfreq(4 * count, 1 / RATE_HZ)
    shape = np.sqrt(1 + corner_hz / np.maximum(frequency, frequency[1]))
    shape[0] = 0
    return np.fft.irfft(np.fft.rfft(rng.normal(size=4 * count)) * shape)[:count]


@pytest.mark.parametrize("seed", range(3))
def test_coverage(seed):
    """An offset, a gain that warms up, a tone and two fast motions, by least squares."""
    rng = np.random.default_rng(seed)
    count, corner_hz = int(rng.integers(5000, 20000)), np.exp(rng.uniform(0, np.log(20)))
    t = np.arange(count) / count
    scores = []
    for _ in range(DRAWS):
        slopes = np.stack([np.ones(count), np.tanh(3 * t), np.sin(80 * t), rng.normal(size=count),
                           (1 + t) * rng.normal(size=count)], axis=1)
        error = noise(rng, count, corner_hz)
        found = np.linalg.lstsq(slopes, error, rcond=None)[0]
        left = error - slopes @ found
        variance = np.maximum(np.diag(sandwich(slopes, left, np.ones(count, bool))),
                              np.diag(by_blocks(slopes, left)))
        scores.append(found / np.sqrt(variance))
    covered = np.mean(np.abs(scores) < 1.96, axis=0)
    # 0.45 without the flicker noise; what moves slower than the record lasts, it cannot tell
    assert (covered[:2] > 0.78).all()
    assert (covered[2:] > 0.86).all()
    assert (covered < 0.995).all()


def test_white_noise_is_what_it_was():
    """No flicker noise is seen in it: the variance is that of least squares."""
    rng = np.random.default_rng(9)
    ratios = []
    for _ in range(60):
        slopes = np.stack([np.ones(4000), np.linspace(-1, 1, 4000), rng.normal(size=4000)], axis=1)
        error = rng.normal(size=4000)
        left = error - slopes @ np.linalg.lstsq(slopes, error, rcond=None)[0]
        ratios.append(np.diag(sandwich(slopes, left, np.ones(4000, bool)))
                      * np.sum(slopes**2, axis=0))
    np.testing.assert_allclose(np.mean(ratios, axis=0), 1.0, atol=0.06)
