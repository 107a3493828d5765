"""Noise of the reference, which a resonance amplifies, makes no classical sensor fractional."""

import numpy as np
import pytest
import shaken

from frac_accel import identify

RATE_HZ = 20_000.0


@pytest.mark.parametrize("seed", [1, 10, 11, 15, 21])
def test_shocks_on_a_classical_sensor(seed):
    """Before, orders from 0.977 to 1.118 with up to 10 standard uncertainties from 1."""
    rng = np.random.default_rng([50270, seed])
    frequency_hz, ratio = rng.uniform(2500, 4500), rng.uniform(0.02, 0.05)
    motion = shaken.shocks(rng, RATE_HZ, 12_000, 10, 5e-4, 2000.0)
    pair = shaken.measured(rng, motion, RATE_HZ, frequency_hz, ratio, rng.uniform(45, 60),
                           rng.uniform(55, 65))
    found = identify(pair, sampling_rate_hz=RATE_HZ)
    assert found.structure == "oscillator"
    assert found.parameters["natural_frequency_hz"]["value"] == pytest.approx(frequency_hz,
                                                                              rel=2e-3)


@pytest.mark.parametrize("order", [0.5, 0.8, 1.2])
def test_a_fractional_sensor_is_still_found(order):
    """Whose reference is as noisy."""
    rng = np.random.default_rng([50271, int(10 * order)])
    rate, n = 2000.0, 12_000
    frequency = np.fft.rfftfreq(2 * n, 1 / rate)
    u = 1j * frequency / 180.0
    spectrum = np.where((frequency > 5) & (frequency < 700),
                        np.exp(2j * np.pi * rng.random(len(frequency))), 0)
    pair = [np.fft.irfft(spectrum * response, 2 * n)[:n] for response in (
        np.ones_like(u), 1 / (u**2 + 2 * 0.1 * u**order + 1))]
    reference, sensor = (values + 10**(-55 / 20) * values.std() * rng.standard_normal(n)
                         for values in pair)
    found = identify((reference, sensor), sampling_rate_hz=rate)
    assert found.structure == "fractional"
    assert found.parameters["damping_order"]["value"] == pytest.approx(order, abs=0.02)
