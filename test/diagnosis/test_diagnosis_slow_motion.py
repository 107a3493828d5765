"""A reference behind a high-pass, whose own slow noise must not be taken for motion."""

import numpy as np
import pytest
import scipy.signal
from second_set_bench import samples

from frac_accel import SensorModel, diagnose

RATE, FINE = 200.0, 8


def swept(rng, n, corner_hz):
    """Sensor and reference on a shaker that sweeps from 1.5 to 25 Hz, ever stronger; the reference
    behind a high-pass, and wandering."""
    t = np.arange(n * FINE) / (RATE * FINE)
    motion = (0.05 + t / t[-1]) * np.sin(2 * np.pi * (1.5 * t + 23.5 * t**2 / (2 * t[-1])))
    high_pass = scipy.signal.butter(1, corner_hz, "highpass", fs=RATE * FINE)
    reference = scipy.signal.lfilter(*high_pass, motion)[::FINE]
    slow = scipy.signal.lfilter([1.0], [1.0, -np.exp(-2 * np.pi * 0.05 / RATE)], rng.normal(size=n))
    reference += 0.003 * slow / slow.std() + 1e-3 * rng.normal(size=n)
    return t[::FINE], reference, motion[::FINE] + 1e-3 * rng.normal(size=n)


@pytest.mark.parametrize("n, seed", [
    (12_000, 0), (12_000, 1), pytest.param(44_000, 3, marks=pytest.mark.long)])
def test_its_corner_is_found_beside_noise_that_wanders(n, seed):
    rng = np.random.default_rng([31, seed])
    corner_hz = rng.uniform(0.3, 0.8)
    t, reference, sensor = swept(rng, n, corner_hz)
    found = diagnose((samples(t, reference), samples(t, sensor)), SensorModel.from_dict(
        {"schema": "frac_accel/sensor_model/1", "core": {"type": "gain"}}))
    assert [finding.cause for finding in found.findings] == ["reference_ac_coupling"]
    fault = found.findings[0].effect
    assert fault.corner_hz == pytest.approx(corner_hz, rel=0.05)
    assert 0 < fault.known_from_hz < 1.5
