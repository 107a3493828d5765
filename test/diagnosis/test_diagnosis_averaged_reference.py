"""A reference that is the mean acceleration over a stretch of time, as the derivative of a wheel's
speed is; some of the motion lies by a notch of that mean, where the reference has none of it."""

import numpy as np
import pytest
from scipy.signal import butter, iirpeak, lfilter, sosfilt

from frac_accel import SensorModel, diagnose
from frac_accel.model.core import Gain

RATE, FINE, SECONDS = 50.0, 20, 240


def record(rng):
    """Length of the mean [s], and the pair."""
    count, room = int(RATE * FINE * SECONDS), int(RATE * FINE * 20)
    white = rng.standard_normal(count + 2 * room)
    drive = sosfilt(butter(2, 0.3, fs=RATE * FINE, output="sos"), rng.standard_normal(len(white)))
    motion = rng.uniform(1, 3) * drive / drive.std()
    length = 2 * int(rng.integers(60, 130)) + 1
    for mode_hz in RATE * FINE / length * rng.uniform([0.9, 1.2], [1.1, 1.6]):
        mode = lfilter(*iirpeak(mode_hz, rng.uniform(2, 6), fs=RATE * FINE), white)
        motion += rng.uniform(0.2, 0.5) * mode / mode.std()
    # nothing is folded down
    motion = sosfilt(butter(8, 0.4 * RATE, fs=RATE * FINE, output="sos"), motion)
    mean = np.convolve(motion, np.ones(length) / length, "same")
    reference, sensor = (values[room:-room][::FINE] for values in (mean, motion))
    n = len(sensor)
    return length / (RATE * FINE), (
        reference + 0.002 * rng.standard_normal(n), sensor + 0.006 * rng.standard_normal(n))


@pytest.mark.parametrize("seed", range(4))
def test_its_length_is_found_and_nothing_is_made_of_what_it_lost(seed):
    """A second resonance at the notch was named, or the fit began too far away to come to it."""
    length_s, pair = record(np.random.default_rng([51, seed]))
    found = diagnose(pair, SensorModel(Gain(1.0)), sampling_rate_hz=RATE, time_limit_s=60)
    finding, = found.findings
    assert finding.cause == "reference_smoothing" and finding.effect.order == 1
    assert abs(finding.effect.length_s - length_s) < 4 * finding.std["length_s"]
    assert abs(finding.effect.length_s - length_s) < 0.005 * length_s
    # more than a twentieth of the output may be lost by the notch, which nothing shows to be noise
    assert found.verdict in ("explained", "undecided") and found.cut_off is None
