"""What looks like a cause of the catalogue and is none: a loose part that strikes, and a gain that
leaves gravity alone."""

import numpy as np
import pytest
from scipy.ndimage import uniform_filter1d
from scipy.signal import butter, sosfiltfilt

from frac_accel import SensorModel, diagnose
from frac_accel.model.core import Gain

pytestmark = pytest.mark.thorough


def road(rng, rate, count, low_hz, high_hz):
    values = sosfiltfilt(butter(2, [low_hz, high_hz], "band", fs=rate, output="sos"),
                         rng.normal(size=count))
    return values / values.std()


@pytest.mark.parametrize("seed", range(4))
def test_a_part_that_strikes_as_the_motion_turns(seed):
    """Its bursts begin at one size of the motion, on the way out: no interference does."""
    rng, rate, count = np.random.default_rng([81, seed]), 1000.0, 14_000
    motion = road(rng, rate, count, 0.3, 3.0)
    side, strikes = 0, np.zeros(count)
    for i in range(count):
        here = int(np.sign(motion[i])) if abs(motion[i]) > 0.3 else 0
        if here and here != side:
            strikes[i], side = here, here
    ring_hz, time = rng.uniform(100, 200), np.arange(400) / rate
    ring = np.exp(-2 * np.pi * ring_hz * 0.04 * time) * np.sin(2 * np.pi * ring_hz * time)
    sensor = motion + rng.uniform(0.3, 0.6) * np.convolve(strikes, ring)[:count]
    found = diagnose((motion, sensor + 0.008 * rng.normal(size=count)), SensorModel(Gain(1.0)),
                     sampling_rate_hz=rate, time_limit_s=60)
    assert not found.findings


def test_bursts_of_their_own_keep_their_name():
    """Half of them: where the motion happens to be larger in them, it may have made them."""
    hits = 0
    for seed in range(6):
        rng, rate, count = np.random.default_rng([82, seed]), 1000.0, 14_000
        motion = road(rng, rate, count, 0.3, 3.0)
        loud = np.zeros(count)
        for start in rng.integers(0, count - 100, 30):
            loud[start:start + 50] = 1.0
        sensor = motion + rng.uniform(0.2, 0.4) * loud * rng.normal(size=count)
        found = diagnose((motion, sensor + 0.008 * rng.normal(size=count)),
                         SensorModel(Gain(1.0)), sampling_rate_hz=rate, time_limit_s=60)
        causes = [finding.cause for finding in found.findings]
        assert causes in ([], ["interference_bursts"])
        hits += len(causes)
    assert hits >= 3


@pytest.mark.parametrize("seed", range(4))
def test_an_automatic_gain_that_leaves_the_level_is_no_offset(seed):
    """The mean is the reference's; with another gain of the motion, a constant made up for it."""
    rng, rate, count = np.random.default_rng([83, seed]), 200.0, 10_000
    motion = road(rng, rate, count, 2, 40) * (1.5 + road(rng, rate, count, 0.05, 0.3) / 3)
    level = np.sqrt(uniform_filter1d(motion**2, int(0.5 * rate)))
    sensor = 9.81 + motion / (1 + rng.uniform(0.2, 0.5) * level)
    found = diagnose((9.81 + motion, sensor + 0.01 * rng.normal(size=count)),
                     sampling_rate_hz=rate, time_limit_s=60)
    assert not {finding.cause for finding in found.findings} & {"offset", "sensitivity_error"}


@pytest.mark.parametrize("seed", range(3))
def test_gravity_that_a_reference_has_lost(seed):
    """What a high-pass of the reference takes away of the level is a constant, which proves
    neither; the rest does."""
    rng, rate, count = np.random.default_rng([84, seed]), 200.0, 10_000
    motion, corner = road(rng, rate, count, 0.2, 40), rng.uniform(0.3, 1.0)
    frequency = np.fft.rfftfreq(count, 1 / rate)
    lost = np.fft.irfft(np.fft.rfft(motion) * 1j * frequency / (1j * frequency + corner), count)
    found = diagnose((lost + 0.001 * rng.normal(size=count),
                      9.81 + motion + 0.01 * rng.normal(size=count)),
                     SensorModel(Gain(1.0)), sampling_rate_hz=rate, time_limit_s=60)
    causes = {finding.cause: finding.effect for finding in found.findings}
    assert set(causes) - {"offset", "reference_noise"} == {"reference_ac_coupling"}
    assert causes["reference_ac_coupling"].corner_hz == pytest.approx(corner, rel=0.02)
