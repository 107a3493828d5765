"""What the parameters' uncertainty adds to a corrected signal covers the error that it makes."""

import numpy as np
import pytest
import rig

from frac_accel import Corrector, FracAccelError
from frac_accel.model import SensorModel
from frac_accel.model.core import Oscillator
from frac_accel.model.effects.offset import Offset
from frac_accel.model.effects.time_delay import TimeDelay
from frac_accel.uncertainty import corrected_uncertainty

pytestmark = pytest.mark.long

RATE_HZ = 2000.0
NAMES = ["sensitivity", "natural_frequency_hz", "damping_ratio", "delay_s", "offset"]


def model_of(values, std):
    sensitivity, frequency, damping, delay, offset = values
    return SensorModel(
        Oscillator(frequency, damping, sensitivity=sensitivity),
        [TimeDelay(delay), Offset(offset)],
        metadata={"covariance": {"parameters": NAMES, "matrix": np.diag(std**2).tolist()}})


def trial(rng, relative_std):
    """Error of a corrected record of a sensor that is not quite the model, and its variance."""
    values = np.array([rng.uniform(0.5, 2), RATE_HZ * rng.uniform(0.05, 0.2),
                       np.exp(rng.uniform(np.log(0.02), np.log(0.7))), 1 / RATE_HZ, 0.1])
    std = np.asarray(relative_std) * values
    true = values + std * rng.standard_normal(5)
    sensor = rig.Sensor({"type": "oscillator", "natural_frequency_hz": true[1],
                         "damping_ratio": abs(true[2]), "damping_order": 1.0,
                         "sensitivity": true[0]},
                        {"time_delay": {"delay_s": true[3]}, "offset": {"offset": true[4]}})
    band_hz = (2.0, min(0.18 * RATE_HZ, 1.2 * values[1]))
    excitation = rig.band_noise(rng, RATE_HZ, 0.5, band_hz, (1.0, 0.0, 0.0), lead_s=0.1)
    record = rig.simulate_record(sensor, excitation)
    model = model_of(values, std)
    corrected = Corrector(model, sample_rate_hz=RATE_HZ).process(record.sensor_stamps_ns,
                                                                 record.sensor)
    place = np.round((corrected.stamps_ns - record.stamps_ns[0]) * 1e-9 * RATE_HZ).astype(int)
    error = corrected.values[:, 0] - record.reference[place, 0]
    result = corrected_uncertainty(model, corrected.values, RATE_HZ)
    # the motion before the first corrected sample is unknown to the sensitivity filters
    judged = slice(len(error) // 5, -50)
    return error[judged], result.variance[judged, 0], result.method[0]


def test_two_standard_uncertainties_cover_at_one_and_ten_percent():
    """1 % on the natural frequency and 10 % on the damping, for which the response is not linear.

    Within one record the error is one draw; 160 records know the mean coverage to 1 %.
    """
    rng = np.random.default_rng(20311)
    trials = [trial(rng, [0.001, 0.01, 0.1, 0.05, 0.1]) for _ in range(160)]
    assert all(method == "first order" for _, _, method in trials)
    covered = [np.mean(np.square(error) < 4 * variance) for error, variance, _ in trials]
    assert 0.93 <= np.mean(covered) <= 0.97


def test_monte_carlo_takes_over_for_larger_uncertainties():
    """8 % on the natural frequency: the inverse is no longer linear in it."""
    rng = np.random.default_rng(20312)
    trials = [trial(rng, [0.001, 0.08, 0.2, 0.05, 0.1]) for _ in range(40)]
    assert all(method == "Monte Carlo" for _, _, method in trials)
    covered = [np.mean(np.square(error) < 4 * variance) for error, variance, _ in trials]
    assert 0.90 <= np.mean(covered) <= 0.99
    ratio = np.mean([np.mean(np.square(error)) / np.mean(variance)
                     for error, variance, _ in trials])
    assert 0.65 <= ratio <= 1.5


def test_a_constant_is_uncertain_by_sensitivity_and_offset():
    std = np.array([0.02, 1.8, 0.01, 1e-5, 0.03])
    model = model_of([2.0, 180.0, 0.1, 1e-3, 0.1], std)
    result = corrected_uncertainty(model, np.full((200, 3), 9.8), RATE_HZ)
    expected = np.hypot(9.8 * 0.02 / 2.0, 0.03 / 2.0)
    np.testing.assert_allclose(np.sqrt(result.variance), expected, rtol=1e-6)


@pytest.mark.parametrize("corrected, words", [
    (np.zeros(100), "expected \\(n, 3\\)"), (np.full((100, 3), np.nan), "not finite")])
def test_bad_samples_are_refused(corrected, words):
    model = model_of([2.0, 180.0, 0.1, 1e-3, 0.1], np.full(5, 1e-3))
    with pytest.raises(FracAccelError, match=words):
        corrected_uncertainty(model, corrected, RATE_HZ)
