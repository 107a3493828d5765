"""A response between samples, of input that reaches up to the Nyquist frequency."""

import numpy as np
import pytest

from frac_accel.signals.convolution import Convolution, at_positions, every

LATE, PART = 0.37, slice(100_000, 103_000)


def filtered(gain, seed=1, n=200_000):
    """White noise behind a filter, and the same `LATE` samples late: a part of a long record, so
    that nothing of its ends is in it."""
    frequency = np.fft.rfftfreq(n)
    lines = np.fft.rfft(np.random.default_rng(seed).standard_normal(n)) * gain(2 * frequency)
    late = np.fft.irfft(lines * np.exp(-2j * np.pi * frequency * LATE), n)
    return np.fft.irfft(lines, n)[PART], late[PART]


@pytest.mark.parametrize("gain, error", [
    (lambda f: f < 0.8, 1e-5), (lambda f: f < 0.9, 1e-5), (lambda f: f < 0.95, 2e-4),
    # anti-alias filters as loggers have them, and none at all: 9 and 31 % with a fifth turned
    (lambda f: (1 + (f / 0.76)**12)**-0.5, 0.015), (lambda f: 1.0, 0.07)])
def test_a_part_of_a_sample_late(gain, error):
    values, late = filtered(gain)
    convolution = Convolution(values, 1.0)
    found = convolution.response(np.exp(-convolution.s * LATE))
    assert np.std((found - late)[500:-500]) < error * np.std(late)


@pytest.mark.parametrize("n", [12, 20, 40, 100, 200, 400, 1000, 5000])
def test_what_rings_does_not_come_round(n):
    """Full-band input of any length: no sample of the response is far larger than the input."""
    for seed in range(10):
        values = np.random.default_rng(seed).standard_normal(n)
        convolution = Convolution(values, 1.0)
        found = convolution.response(np.exp(-convolution.s * LATE))
        assert np.max(np.abs(found)) < 1.6 * np.max(np.abs(values))


def test_values_a_step_apart_are_those_at_their_places():
    rng = np.random.default_rng(2)
    for _ in range(100):
        values = rng.normal(size=rng.integers(8, 400))
        first, step, count = rng.uniform(-60, 60), int(rng.integers(1, 9)), int(rng.integers(1, 90))
        place = first + step * np.arange(count)
        assert every(values, first, step, count) == pytest.approx(
            at_positions(values, place), abs=1e-9)
