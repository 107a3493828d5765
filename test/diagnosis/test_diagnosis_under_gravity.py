"""A constant of the reference, such as gravity, and what a sensor makes of it."""

import numpy as np
import pytest
from sampled_pair import sampled_pair
from scipy.signal import butter, cheby1, sosfilt, sosfiltfilt

from frac_accel import SensorModel, diagnose
from frac_accel.model.core import Gain

RATE, COUNT, FINER = 200.0, 12_000, 8


def pair(seed, sensor):
    """Reference and sensor, which gets the motion and its rate, along one axis under gravity."""
    rng = np.random.default_rng(seed)
    fine = FINER * RATE
    motion = rng.normal(size=FINER * COUNT)
    motion = sosfiltfilt(butter(2, [0.5, 30], "band", fs=fine, output="sos"), motion)
    motion = 9.81 + 2.0 * motion / motion.std()
    return sampled_pair(rng, (motion, sensor(motion, fine)), FINER, RATE, 0.005)


def ac_coupled(motion, rate):
    """By a filter of third order, which no cause says."""
    return sosfilt(cheby1(3, 1.0, 1.5, "high", fs=rate, output="sos"), motion - 9.81)


def falling(motion, rate):
    """A gain that falls with frequency, in three steps."""
    total = 0.7 * motion
    for corner, share in ((0.05, 0.1), (0.6, 0.1), (8.0, 0.1)):
        low = sosfilt(butter(1, corner, fs=rate, output="sos"), motion - 9.81)
        total += share * (low + 9.81)
    return total


def slowly_ac_coupled(motion, rate):
    """By a corner far below what the record can show, long after it was switched on."""
    return sosfilt(butter(1, 0.002, "high", fs=rate, output="sos"), motion - 9.81)


@pytest.mark.thorough
@pytest.mark.parametrize("sensor", [ac_coupled, falling, slowly_ac_coupled])
def test_a_gain_at_standstill_is_no_offset(sensor):
    found = diagnose(pair(1, sensor), SensorModel(Gain(1.0)), time_limit_s=60)
    assert "offset" not in {finding.cause for finding in found.findings}


def test_a_limit_that_was_never_reached_has_no_number():
    reference, sensor = pair(2, lambda motion, _: motion)
    sensor = sensor._replace(values=np.minimum(sensor.values, 12.0))
    found = diagnose((reference, sensor), SensorModel(Gain(1.0)))
    clipping, = found.findings
    assert list(clipping.as_dict()["parameters"]) == ["upper"]
    assert found.unexplained_fraction < 0.01
