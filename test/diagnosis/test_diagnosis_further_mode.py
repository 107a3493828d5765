"""Two resonances of a mount beyond all that is compared."""

import numpy as np
import pytest
from exact_sines import record

from frac_accel import SensorModel, diagnose
from frac_accel.model.core import Gain

RATE = 400.0


def mode(s, frequency_hz, ratio):
    w = 2 * np.pi * frequency_hz
    return (2 * ratio * w * s + w**2) / (s**2 + 2 * ratio * w * s + w**2)


@pytest.mark.parametrize("seed", range(3))
def test_a_further_resonance_is_no_smoothing_of_the_reference(seed):
    rng = np.random.default_rng(seed)
    first, further = rng.uniform(260.0, 280.0), rng.uniform(650.0, 800.0)
    reference, sensor = record(
        rng, lambda s: mode(s, first, 0.05) * mode(s, further, 0.02),
        band=(1.0, 190.0), n=5000, rate=RATE, noise=2e-3, sines=400)
    found = diagnose((reference, sensor), SensorModel(Gain(1.0)), sampling_rate_hz=RATE)
    assert {finding.cause for finding in found.findings} <= {"mounting_resonance"}
