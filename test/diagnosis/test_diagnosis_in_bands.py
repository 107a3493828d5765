"""Changes along a record that are not the same at all frequencies. Made at a far higher rate,
without the package."""

import numpy as np
import pytest
from scipy.signal import bilinear, butter, lfilter, sosfiltfilt

from frac_accel import Samples, SensorModel, diagnose

RATE, FINE, COUNT = 500.0, 16, 12_000


def behind(frequency_hz, damping_ratio, motion):
    """Motion as an oscillator shows it, with the resonance where it belongs after the bilinear
    transform."""
    omega = 2 * FINE * RATE * np.tan(np.pi * frequency_hz / (FINE * RATE))
    return lfilter(*bilinear([omega**2], [1, 2 * damping_ratio * omega, omega**2], FINE * RATE),
                   motion)


def moving(rng, band_hz):
    motion = sosfiltfilt(butter(3, band_hz, "band", fs=FINE * RATE, output="sos"),
                         rng.normal(size=FINE * COUNT))
    return motion / motion.std() * np.minimum(np.arange(FINE * COUNT) / (FINE * RATE), 1)


def found_in(rng, motion, sensor, frequency_hz, damping_ratio):
    stamps = np.round(1e9 * np.arange(COUNT) / RATE)
    noise = 0.005 * sensor.std() * rng.normal(size=COUNT)
    pair = tuple(Samples.of(stamps, np.outer(values, [1.0, 0.0, 0.0]))
                 for values in (motion[::FINE], sensor[::FINE] + noise))
    model = SensorModel.from_dict({"schema": "frac_accel/sensor_model/1", "core": {
        "type": "oscillator", "natural_frequency_hz": frequency_hz, "damping_ratio": damping_ratio,
        "damping_order": 1.0, "sensitivity": 1.0}, "effects": []})
    return diagnose(pair, model)


@pytest.mark.long  # two to four minutes each
@pytest.mark.parametrize("seed", [1, 0])
def test_another_sensor_that_is_plugged_in_is_no_step_of_gain(seed):
    """Its gain and its dynamics are others: `gain_step` and `time_step` were named. What they
    describe is in the extended model all the same."""
    rng = np.random.default_rng([81, seed])
    motion = moving(rng, (4.0, 25.0))
    f0, gain = rng.uniform(70, 90), rng.uniform(0.90, 0.95)
    at = rng.integers(COUNT // 3, 2 * COUNT // 3)
    one, other = behind(f0, 0.6, motion), gain * behind(0.4 * f0, 0.5, motion)
    found = found_in(rng, motion, np.where(np.arange(len(motion)) < FINE * at, one, other), f0, 0.6)
    assert not {"gain_step", "time_step", "gain_drift"} & {f.cause for f in found.findings}
    assert found.verdict == "unexplained"
    assert found.extended["nrmse"] < 0.4 * found.baseline["nrmse"]
    # the same step alone is one
    stepped = one * np.where(np.arange(len(motion)) < FINE * at, 1, gain)
    found = found_in(rng, motion, stepped, f0, 0.6)
    assert [f.cause for f in found.findings] == ["gain_step"]
