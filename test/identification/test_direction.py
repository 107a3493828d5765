"""Which of two topics is the sensor."""

import exact_sines
import numpy as np
import pytest

from frac_accel.identification.checks.direction import _exchanged
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
