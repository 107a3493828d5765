"""What rounding takes of an error has an interval: the power of the rest is known only so well."""

import numpy as np
import pytest
from exact_sines import record

from frac_accel import SensorModel, diagnose
from frac_accel.model.core import Gain

RATE = 200.0


@pytest.mark.parametrize("seed", range(4))
def test_the_interval_of_a_lattice_holds_what_it_is_worth(seed):
    rng = np.random.default_rng(seed)
    step, noise = rng.uniform(0.3, 0.5), rng.uniform(0.1, 0.15)
    reference, sensor = record(rng, lambda s: 0.9 + 0 * s, band=(1.0, 60.0), n=6000, rate=RATE,
                               noise=noise, sines=300)
    found = diagnose((reference, step * np.round(sensor / step)), SensorModel(Gain(0.9)),
                     sampling_rate_hz=RATE)
    assert [finding.cause for finding in found.findings] == ["quantization"]
    gain = found.findings[0].gain
    # noise of this size makes of rounding an error of its own, uniform (Widrow and Kollar, 2008)
    worth = 1 - noise / np.hypot(noise, step / np.sqrt(12))
    low, high = gain.ci95
    width = high - low
    assert 0.005 < width < 0.1
    # of one draw, an interval twice as wide
    assert low - width / 2 < worth < high + width / 2
