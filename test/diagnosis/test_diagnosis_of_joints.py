"""A robot's joint: the velocity that it reports, and what its positions say."""

import numpy as np
import pytest
from scipy.signal import butter, lfilter, sosfiltfilt

from frac_accel import Samples, SensorModel, diagnose
from frac_accel.model.core import Gain

RATE, FINE, COUNT = 100.0, 32, 8000


def joint(seed, end_hz, noise):
    """Differences of positions and the reported velocity, with the stamps of a loop that takes its
    time; and the corner [Hz] of the low-pass that it reports through."""
    rng = np.random.default_rng([111, seed])
    velocity = sosfiltfilt(butter(1, (0.02, end_hz), "band", fs=RATE * FINE, output="sos"),
                           rng.normal(size=FINE * COUNT))
    velocity *= np.minimum(np.arange(len(velocity)) / (5 * FINE * RATE), 1) / velocity.std()
    corner = rng.uniform(0.7, 0.9)
    reported = lfilter(*butter(1, corner, fs=RATE * FINE), velocity)
    position = np.cumsum(velocity) / (FINE * RATE)
    taken = np.arange(COUNT) + 0.04 * rng.normal(size=COUNT)
    stamps = np.round(1e9 * taken / RATE)

    def at(values):
        return np.interp(taken * FINE, np.arange(len(values)), values)
    where = at(position)
    difference = (where[2:] - where[:-2]) / (1e-9 * (stamps[2:] - stamps[:-2]))
    sensor = at(reported) + noise * reported.std() * rng.normal(size=COUNT)
    return (Samples.of(stamps[1:-1], np.outer(difference, [1.0, 0, 0])),
            Samples.of(stamps, np.outer(sensor, [1.0, 0, 0]))), corner


@pytest.mark.thorough
@pytest.mark.parametrize("seed", range(2))
def test_a_lag_has_its_name_beside_differences_of_positions(seed):
    """The differences average over two intervals, which hardly shows: nothing speaks against it
    for that."""
    pair, corner = joint(seed, 3.0, 1e-3)
    found = diagnose(pair, SensorModel(Gain(1.0)))
    names = {finding.cause: finding.effect for finding in found.findings}
    assert names["low_pass_lag"].corner_hz == pytest.approx(corner, rel=0.02)
    assert names.keys() <= {"low_pass_lag", "reference_smoothing"}
    assert found.extended["nrmse"] < 0.01


def test_values_that_were_put_on_other_instants_have_no_age():
    """`polled_readout` was named, by a lag of as much as the stamps scatter."""
    pair, _ = joint(0, 1.0, 2e-5)
    found = diagnose(pair)
    assert any("put on uniform instants" in words for words in found.integrity.words)
    assert "polled_readout" not in {finding.cause for finding in found.findings}
