"""Which of two topics is the sensor."""

import exact_sines
import numpy as np
import pytest
from scipy.signal import lfilter

from frac_accel.identification.checks.direction import _exchanged, _Way
from frac_accel.record import Record


@pytest.mark.parametrize("seed", range(4))
def test_topics_that_hardly_go_together_are_not_called_exchanged(seed):
    """Where no sensor answers the right way round, one that left 41 % of the output was enough."""
    rng = np.random.default_rng([35, seed])
    natural_frequency_hz = rng.uniform(50, 200)
    motion, output = exact_sines.record(
        rng, lambda s: exact_sines.oscillator(s, natural_frequency_hz, 0.1))

    def judged(noise):
        reference = output + noise * output.std() * rng.normal(size=len(output))
        pair = Record.of(*exact_sines.samples(reference, motion))
        return _exchanged(None, reference, motion, pair)
    assert "reference and sensor are exchanged" in str(judged(0.03))
    assert judged(0.45) is None


@pytest.mark.parametrize("seed", range(4))
def test_a_tone_in_the_sensor_does_not_exchange_the_topics(seed):
    """The other way round, a filter would take the tone away, and leave far less."""
    rng = np.random.default_rng([36, seed])
    rate, corner_hz = exact_sines.RATE, rng.uniform(40, 80)
    motion, output = exact_sines.record(rng, lambda s: 1 / (1 + s / (2 * np.pi * corner_hz)),
                                        band=(0.2, 50.0), noise=3e-3)
    # slow for the most part
    motion, output = (lfilter([1.0], [1.0, -np.exp(-2 * np.pi / rate)], values)
                      for values in (motion, output))
    tone = rng.uniform(0.14, 0.18) * output.std() * np.sin(
        2 * np.pi * rng.uniform(180, 220) * np.arange(len(output)) / rate + rng.uniform(0, 6))
    pair = Record.of(*exact_sines.samples(motion, output + tone))
    assert _exchanged(_Way.of(motion, output + tone, pair, 0.0), motion, output + tone, pair) \
        is None
    # a resonance the other way round still says it
    resonant = exact_sines.record(
        np.random.default_rng(seed), lambda s: exact_sines.oscillator(s, corner_hz, 0.1))
    pair = Record.of(*exact_sines.samples(*resonant[::-1]))
    error = _exchanged(_Way.of(resonant[1], resonant[0], pair, 0.0), *resonant[::-1], pair)
    assert "a resonance at" in str(error)
