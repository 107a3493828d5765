"""A sensor that has failed on the way is judged by what came before."""

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from frac_accel import SensorModel, diagnose
from frac_accel.model.core import Gain

RATE, COUNT = 200.0, 12_000


@pytest.mark.parametrize("seed", range(2))
def test_a_sensor_that_stands_still_from_some_instant_on(seed):
    """Nothing of it was left to judge on, and the record was refused."""
    rng = np.random.default_rng([51, seed])
    motion = sosfiltfilt(butter(3, 0.35, output="sos"), rng.normal(size=COUNT))
    gain, fails = rng.uniform(0.6, 0.9), int(rng.uniform(0.4, 0.55) * COUNT)
    sensor = gain * motion + 0.002 * rng.normal(size=COUNT)
    sensor[fails:] = 0.0
    found = diagnose((motion, sensor), SensorModel(Gain(1.0)), sampling_rate_hz=RATE)
    finding, = [each for each in found.findings if each.cause == "sensitivity_error"]
    assert abs(finding.effect.gain - gain) < 4 * finding.std["gain"]
    assert any("stands still at 0 from" in words for words in found.integrity.words)
