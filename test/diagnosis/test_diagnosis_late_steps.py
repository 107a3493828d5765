"""Records of which the last part, where causes are judged, alone holds what there is to learn."""

import numpy as np
import pytest
from exact_sines import record

from frac_accel import SensorModel, diagnose
from frac_accel.model.core import Gain

RATE = 100.0


@pytest.mark.parametrize("seed", range(3))
def test_a_step_that_comes_late_is_found_beside_what_is_there_all_along(seed):
    rng = np.random.default_rng(seed)
    late_s, offset, step = rng.uniform(0.002, 0.006), rng.uniform(0.05, 0.1), rng.uniform(0.5, 1.1)
    at_s = rng.uniform(40.0, 55.0)
    reference, sensor = record(rng, lambda s: 0.9 * np.exp(late_s * s), band=(0.5, 20.0), n=6000,
                               rate=RATE, noise=0.03, sines=300)
    sensor += offset + step * (np.arange(6000) / RATE > at_s)
    found = diagnose((reference, sensor), SensorModel(Gain(0.9)), sampling_rate_hz=RATE)
    named = {finding.cause: finding.effect for finding in found.findings}
    assert named.keys() == {"offset", "offset_step", "reference_delay"}
    assert named["offset_step"].step == pytest.approx(step, rel=0.02)
    assert named["offset"].offset == pytest.approx(offset, abs=0.005)


def test_a_sample_a_day_allows_no_delay_of_days():
    """The range of a delay is far less than one of its intervals; that was an error."""
    rng = np.random.default_rng(4)
    reference = np.convolve(rng.normal(size=3010), np.ones(11), "valid")
    sensor = 0.8 * np.roll(reference, 1) + rng.normal(size=3000)
    found = diagnose((reference, sensor), sampling_rate_hz=1 / 86400, time_limit_s=20)
    assert "time_delay" not in {finding.cause for finding in found.findings}
