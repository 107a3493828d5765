"""A robot's joint: the velocity that it reports, and what its positions say."""

import numpy as np
import pytest
from scipy.signal import butter, lfilter, sosfiltfilt

from frac_accel import Samples, SensorModel, diagnose
from frac_accel.model.core import Gain

RATE, FINE, COUNT = 100.0, 32, 8000


@pytest.mark.thorough
@pytest.mark.parametrize("seed", range(2))
def test_a_lag_has_its_name_beside_differences_of_positions(seed):
    """The differences average over two intervals, which hardly shows: nothing speaks against it
    for that."""
    rng = np.random.default_rng([111, seed])
    velocity = sosfiltfilt(butter(1, (0.02, 3.0), "band", fs=RATE * FINE, output="sos"),
                           rng.normal(size=FINE * COUNT))
    velocity *= np.minimum(np.arange(len(velocity)) / (5 * FINE * RATE), 1) / velocity.std()
    corner = rng.uniform(0.7, 0.9)
    reported = lfilter(*butter(1, corner, fs=RATE * FINE), velocity)
    position = np.cumsum(velocity) / (FINE * RATE)
    # a loop that takes its time stamps both
    taken = np.arange(COUNT) + 0.04 * rng.normal(size=COUNT)
    stamps = np.round(1e9 * taken / RATE)

    def at(values):
        return np.interp(taken * FINE, np.arange(len(values)), values)
    where = at(position)
    difference = (where[2:] - where[:-2]) / (1e-9 * (stamps[2:] - stamps[:-2]))
    sensor = at(reported) + 1e-3 * reported.std() * rng.normal(size=COUNT)
    found = diagnose((Samples.of(stamps[1:-1], np.outer(difference, [1.0, 0, 0])),
                      Samples.of(stamps, np.outer(sensor, [1.0, 0, 0]))), SensorModel(Gain(1.0)))
    names = {finding.cause: finding.effect for finding in found.findings}
    assert names["low_pass_lag"].corner_hz == pytest.approx(corner, rel=0.02)
    assert names.keys() <= {"low_pass_lag", "reference_smoothing"}
    assert found.extended["nrmse"] < 0.01
