"""One filter stays one, beside a clock that runs differently or where the motion is mostly slow."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d, uniform_filter1d
from scipy.signal import butter, lfilter, sosfiltfilt

from frac_accel import Samples, diagnose

FINE = 40


def pair(rate, reference, sensor):
    at = np.round(1e9 * (50 + np.arange(len(reference)) / rate))
    return tuple(Samples.of(at, np.outer(values, [0, 0, 1])) for values in (reference, sensor))


def drive(rng, rate, seconds):
    """Acceleration of a car's floor: the body's and the axles' modes, changing speed, hills."""
    count = int(FINE * rate * seconds)
    road = [sosfiltfilt(butter(4, band, "band", fs=FINE * rate, output="sos"),
                        rng.normal(size=count)) for band in ((1.0, 2.0), (8.0, 16.0), (2.0, 30.0))]
    speed = 1 + 0.7 * np.sin(2 * np.pi * np.arange(count) / count * rng.uniform(1, 3))
    return speed * sum(share * part / part.std() for share, part in zip((1.0, 0.6, 0.3), road))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_an_averaging_filter_beside_a_clock(seed):
    """Its order was that of the trial before the clock was known, and a delay mended that; or an
    oscillator that was identified without the clock stood in its place."""
    rng, rate, seconds = np.random.default_rng(seed), 200.0, 60.0
    motion = 9.81 + drive(rng, rate, seconds)
    order, width = 3, int(rng.integers(50, 100))
    filtered = motion
    for _ in range(order):
        filtered = np.convolve(filtered, np.ones(width) / width)[:len(motion)]
    filtered[:order * width] = motion[:order * width]
    skew = rng.choice([-1, 1]) * rng.uniform(60, 300)
    t = np.arange(len(motion)) / (FINE * rate)
    at = (1 + 1e-6 * skew) * t[FINE * 5:-FINE * 10:FINE]
    # the sums of an average of n lag by (n - 1) / 2, the integral by n / 2
    sensor = 0.97 * CubicSpline(t, filtered)(at - order / 2 / (FINE * rate)) + 0.1
    reference = motion[FINE * 5:-FINE * 10:FINE]
    found = diagnose(pair(rate, reference + 0.002 * rng.normal(size=len(reference)),
                          sensor + 0.005 * rng.normal(size=len(sensor))), axis="z",
                     time_limit_s=60)
    named = {finding.cause: finding.effect for finding in found.findings}
    assert set(named) - {"offset"} == {"linear_phase_filter", "clock_skew"}
    assert named["linear_phase_filter"].order == order
    length_s = width / (FINE * rate)
    assert named["linear_phase_filter"].length_s == pytest.approx(length_s, rel=0.01)
    assert named["clock_skew"].skew_ppm == pytest.approx(skew, abs=1.0)
    assert found.verdict == "explained"


@pytest.mark.parametrize("seed", [11, 12])
def test_a_low_pass_of_the_reference_beside_mostly_slow_motion(seed):
    rng, rate = np.random.default_rng(seed), 100.0
    motion = drive(rng, rate, 60.0)
    slow = gaussian_filter1d(rng.normal(size=len(motion)), 0.4 * FINE * rate)
    motion = 0.4 * motion + 1.2 * slow / slow.std()
    corner = rng.uniform(12.0, 25.0)
    pole = np.exp(-2 * np.pi * corner / (FINE * rate))
    smoothed = lfilter([1 - pole], [1, -pole], uniform_filter1d(motion, 2))
    reference, sensor = smoothed[::FINE], rng.uniform(0.95, 1.05) * motion[::FINE]
    n = len(sensor)
    found = diagnose(pair(rate, reference + 0.002 * rng.normal(size=n),
                          sensor + 0.008 * rng.normal(size=n)), axis="z", time_limit_s=60)
    cause, = [finding for finding in found.findings if finding.cause != "offset"]
    assert cause.cause == "reference_low_pass"
    assert cause.effect.corner_hz == pytest.approx(corner, rel=0.03)
    assert found.verdict == "explained"
