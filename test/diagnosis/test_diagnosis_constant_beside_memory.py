"""A constant beside what a fractional sensor remembers."""

import numpy as np
import pytest
from rig.oscillator import integrate
from scipy.signal import butter, sosfiltfilt

from frac_accel import Samples, SensorModel, diagnose

RATE, FINE, COUNT = 50.0, 16, 8000


@pytest.mark.parametrize("seed", range(2))
def test_an_offset_is_none_that_earlier_motion_has_left(seed):
    """It was suspected only, as a free motion, and the verdict was `consistent`."""
    rng = np.random.default_rng([101, seed])
    motion = sosfiltfilt(butter(2, (0.1, 0.35), "band", fs=RATE * FINE, output="sos"),
                         rng.normal(size=FINE * (COUNT + 2000)))
    motion /= motion.std()
    f0, zeta, order = rng.uniform(0.8, 1.5), rng.uniform(0.2, 0.3), rng.uniform(0.4, 0.6)
    # the record begins in motion
    moved = integrate(np.append(motion, motion[-1]), 1 / (RATE * FINE), f0, zeta, order).q[:-1]
    offset = rng.uniform(0.03, 0.05) * rng.choice([-1, 1])
    reference, output = motion[FINE * 2000::FINE], moved[FINE * 2000::FINE]
    sensor = output + offset + 0.008 * output.std() * rng.normal(size=COUNT)
    model = SensorModel.from_dict({"schema": "frac_accel/sensor_model/1", "core": {
        "type": "oscillator", "natural_frequency_hz": f0, "damping_ratio": zeta,
        "damping_order": order, "sensitivity": 1.0}, "effects": []})
    stamps = np.round(1e9 * np.arange(COUNT) / RATE)
    found = diagnose(tuple(Samples.of(stamps, np.outer(each, [1.0, 0.0, 0.0]))
                           for each in (reference, sensor)), model)
    assert [finding.cause for finding in found.findings] == ["offset"]
    assert found.verdict == "explained"
