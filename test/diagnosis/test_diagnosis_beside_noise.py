"""Names beside noise that grows with the motion, that is coloured, or that is no noise at all."""

import numpy as np
import pytest
from sampled_pair import sampled_pair
from scipy.signal import butter, lfilter, sosfilt, sosfiltfilt

from frac_accel import diagnose, write_bag
from frac_accel.io.bag import Temperatures
from frac_accel.model import SensorModel
from frac_accel.model.core import Gain

RATE, FINER, COUNT = 200.0, 8, 12_000


def motion_of(rng, band=(0.5, 40.0)):
    """Base acceleration with an RMS of one, as finely sampled, louder and quieter by turns."""
    fine = FINER * RATE
    motion = sosfiltfilt(butter(3, band, "band", fs=fine, output="sos"),
                         rng.normal(size=FINER * COUNT))
    level = 1 + 0.8 * np.sin(2 * np.pi * np.arange(len(motion)) / (fine * rng.uniform(6, 12)))
    motion *= level
    return motion / motion.std()


def named(record, **given):
    found = diagnose(record, SensorModel(Gain(1.0)), time_limit_s=60, **given)
    return {finding.cause: finding for finding in found.findings}


@pytest.mark.parametrize("seed", range(3))
def test_a_zero_that_follows_temperature_beside_noise_that_grows_with_the_motion(seed):
    rng = np.random.default_rng([51, seed])
    motion = motion_of(rng)
    seconds = np.arange(COUNT / RATE)
    celsius = 25 + 6 * np.sin(2 * np.pi * seconds / rng.uniform(25, 40))
    per_k = rng.uniform(0.03, 0.05)
    zero = per_k * np.interp(np.arange(len(motion)) / (FINER * RATE), seconds, celsius - 25)
    noise = 0.06 * motion * rng.normal(size=len(motion))
    record = sampled_pair(rng, (motion, motion + zero + noise), FINER, RATE, 1e-3)
    found = named(record, temperature=(np.round(1e9 * seconds).astype(np.int64), celsius))
    assert found.keys() == {"thermal_offset"}
    value, std = found["thermal_offset"].effect.coefficient_per_k, \
        found["thermal_offset"].std["coefficient_per_k"]
    assert abs(value - per_k) < 4 * std < 0.1 * per_k


def test_the_temperature_of_a_bag_is_its_own(tmp_path):
    """The command read it, the function did not: `offset_drift` was named."""
    rng = np.random.default_rng([51, 3])
    motion = motion_of(rng)
    seconds = np.arange(COUNT / RATE)
    celsius = 25 + 6 * np.sin(2 * np.pi * seconds / rng.uniform(25, 40))
    zero = 0.04 * np.interp(np.arange(len(motion)) / (FINER * RATE), seconds, celsius - 25)
    reference, sensor = sampled_pair(rng, (motion, motion + zero), FINER, RATE, 1e-3)
    stamps = sensor.stamps_ns[0] + np.round(1e9 * seconds).astype(np.int64)
    bag = tmp_path / "bag.mcap"
    write_bag(bag, {"/imu/reference": reference, "/imu/data_raw": sensor, "/imu/temperature":
                    Temperatures(stamps, celsius, np.zeros(len(celsius)), "imu_link")})
    assert named(bag).keys() == {"thermal_offset"}


@pytest.mark.parametrize("seed", range(3))
def test_a_moving_average_beside_coloured_noise(seed):
    """A low-pass alone leaves 2.5 times the power, and was as likely."""
    rng = np.random.default_rng([52, seed])
    motion = motion_of(rng, (1.0, 70.0))
    # by the trapezoidal rule
    taps = np.r_[0.5, np.ones(rng.integers(2 * FINER, 3 * FINER)), 0.5]
    sensor = motion
    for _ in range(3):
        sensor = lfilter(taps / taps.sum(), 1.0, sensor)
    wander = sosfilt(butter(1, [0.05, 1.0], "band", fs=FINER * RATE, output="sos"),
                     rng.normal(size=len(motion)))
    sensor = sensor + 0.1 * sensor.std() * wander / wander.std()
    found = named(sampled_pair(rng, (motion, sensor), FINER, RATE, 1e-3))
    assert found.keys() == {"linear_phase_filter"}


@pytest.mark.parametrize("seed", range(3))
def test_a_step_of_the_zero_beside_a_delay_that_moves(seed):
    """No cause has a delay that grows and is flushed, again and again."""
    rng = np.random.default_rng([53, seed])
    motion = motion_of(rng, (1.0, 25.0))
    time = np.arange(len(motion))
    late = 12 * ((time / (FINER * RATE * rng.uniform(8, 12))) % 1)
    sensor = np.interp(time - late, time, motion)
    at, step = rng.uniform(0.3, 0.7), rng.choice([-1, 1]) * rng.uniform(0.8, 1.6)
    sensor[int(at * len(sensor)):] += step
    found = named(sampled_pair(rng, (motion, sensor), FINER, RATE, 1e-3))
    assert found.keys() == {"offset_step"}
    assert found["offset_step"].effect.step == pytest.approx(step, rel=0.03)


def of_one_over_f(rng, rms, corner_hz):
    """Noise whose density goes with one over the frequency below a corner and is white above."""
    frequency = np.fft.rfftfreq(FINER * COUNT, 1 / (FINER * RATE))
    lines = np.fft.rfft(rng.normal(size=FINER * COUNT))
    lines[1:] *= np.sqrt(1 + corner_hz / frequency[1:])
    lines[0] = 0
    noise = np.fft.irfft(lines)
    return rms * noise / np.std(noise[::FINER])


@pytest.mark.parametrize("seed", range(3))
def test_a_low_pass_above_the_band_beside_slow_noise(seed):
    """A delay leaves more where little is left, which loud slow noise hid."""
    rng = np.random.default_rng([54, seed])
    motion = motion_of(rng, (1.0, 45.0))
    corner_hz = rng.uniform(90, 150)
    # the analogue filter's response, of a motion that repeats
    u = 1j * np.fft.rfftfreq(len(motion), 1 / (FINER * RATE)) / corner_hz
    sensor = np.fft.irfft(np.fft.rfft(motion) / (u**2 + np.sqrt(2) * u + 1), len(motion))
    sensor = sensor + of_one_over_f(rng, 0.04, 40.0)
    found = named(sampled_pair(rng, (motion, sensor), FINER, RATE, 1e-3))
    assert found.keys() == {"low_pass_filter"}
    value, std = found["low_pass_filter"].effect.corner_hz, \
        found["low_pass_filter"].std["corner_hz"]
    assert abs(value - corner_hz) < 4 * std < 0.05 * corner_hz


@pytest.mark.parametrize("seed", range(3))
def test_a_delay_beside_slow_noise(seed):
    rng = np.random.default_rng([55, seed])
    motion = motion_of(rng, (1.0, 45.0))
    late = int(rng.integers(3, 3 * FINER))
    sensor = np.r_[np.zeros(late), motion[:-late]] + of_one_over_f(rng, 0.04, 40.0)
    found = named(sampled_pair(rng, (motion, sensor), FINER, RATE, 1e-3))
    assert found.keys() == {"time_delay"}
    assert found["time_delay"].effect.delay_s == pytest.approx(late / (FINER * RATE), rel=0.02)
