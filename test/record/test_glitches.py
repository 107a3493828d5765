"""Faults that are the reference's own count in nothing, and those of the sensor stay."""

import numpy as np
import pytest
from rig.hidden import draw_case
from scipy.signal import butter, lfilter, resample_poly, sosfilt

from frac_accel import Samples, diagnose
from frac_accel.record import Record
from frac_accel.record.glitches import glitches

RATE_HZ, COUNT = 200.0, 20_000
KINDS = {"zero": 1, "zeros": 5, "spike": 1, "spikes": 4, "hold": 20, "noise": 40}


def pair(rng):
    """Reference and sensor of a motion whose strength changes, noise of a few permille."""
    motion = sosfilt(butter(4, [0.5, rng.uniform(20, 45)], "band", fs=RATE_HZ, output="sos"),
                     rng.normal(size=COUNT))
    motion *= 2 / motion.std() * (1 + 0.7 * np.sin(np.arange(COUNT) * rng.uniform(0.5, 2) * 1e-3))
    lag = sosfilt(butter(1, rng.uniform(30, 80), fs=RATE_HZ, output="sos"), motion)
    return motion + 0.01 * rng.normal(size=COUNT), lag + 0.01 * rng.normal(size=COUNT)


def spoiled(rng, values, kind, times=10):
    """The values with so many faults of a kind, and their places."""
    values, length, places = values.copy(), KINDS[kind], rng.choice(
        np.arange(500, COUNT - 500, 100), times, replace=False)
    for at in places:
        rows = slice(at, at + length)
        values[rows] = {"zero": 0.0, "hold": values[at],
                        "spik": values[rows] + rng.choice([-15, 15]),
                        "nois": values[rows] + 4 * rng.normal(size=length)}[kind[:4]]
    return values, places


def samples(values, rate=RATE_HZ):
    return Samples.of(np.round(np.arange(len(values)) * 1e9 / rate),
                      np.outer(values, [1, 0, 0]))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(3))
def test_what_only_the_reference_does_is_found(kind, seed):
    rng = np.random.default_rng([991, seed, len(kind)])
    true, sensor = pair(rng)
    reference, _ = spoiled(rng, true, kind)
    # what is off by less than a part of the motion is no matter
    off = np.abs(reference - true) > 0.5
    inside = np.zeros(COUNT, bool)
    for rows in glitches(reference, sensor, np.ones(COUNT, bool)):
        inside[rows] = True
    # a value that is held where motion turns stands out on neither side
    assert np.mean(inside[off]) > (0.8 if kind == "hold" else 0.9)
    near = np.convolve(reference != true, np.ones(7), "same") > 0
    assert not (inside & ~near).any()


@pytest.mark.parametrize("at", [0, COUNT - 2, COUNT - 1])
def test_a_fault_at_an_end_of_the_record_is_as_good_as_any(at):
    from_rest_to_rest = np.sin(np.linspace(0, np.pi, COUNT))
    reference, sensor = (values * from_rest_to_rest for values in pair(np.random.default_rng(17)))
    reference[at] += 20
    rows, = glitches(reference, sensor, np.ones(COUNT, bool))
    assert 0 <= rows.start <= at < rows.stop <= COUNT


@pytest.mark.parametrize("kind", KINDS)
def test_a_fault_of_the_sensor_is_none_of_the_reference(kind):
    rng = np.random.default_rng([992, len(kind)])
    reference, sensor = pair(rng)
    assert glitches(reference, spoiled(rng, sensor, kind)[0], np.ones(COUNT, bool)) == []


@pytest.mark.parametrize("seed", range(10))
def test_shocks_that_both_see_are_motion(seed):
    rng = np.random.default_rng([993, seed])
    motion = np.zeros(COUNT)
    motion[rng.choice(COUNT, 20)] = 200 * rng.normal(size=20)
    motion = sosfilt(butter(2, rng.uniform(20, 80), fs=RATE_HZ, output="sos"),
                     motion + rng.normal(size=COUNT))
    # a sensor that does not show all that the reference does, and is coarser
    lag = sosfilt(butter(2, rng.uniform(5, 40), fs=RATE_HZ, output="sos"), motion)
    sensor = np.clip(lag + 0.02 * rng.normal(size=COUNT), -5, 5)
    assert glitches(motion + 0.01 * rng.normal(size=COUNT), sensor, np.ones(COUNT, bool)) == []


@pytest.mark.parametrize("seed", [7, 15, *range(6)])
def test_a_jolt_after_which_a_slow_sensor_rings_for_long_is_motion(seed):
    """Three jolts of a bridge under traffic did not count, and the mode that rang had no name."""
    rng = np.random.default_rng([997, seed])
    motion = sosfilt(butter(2, [0.5, rng.uniform(10, 20)], "band", fs=RATE_HZ, output="sos"),
                     rng.normal(size=COUNT))
    jolts = np.zeros(COUNT)
    jolts[rng.choice(COUNT, 40)] = rng.uniform(20, 60) * rng.normal(size=40)
    motion = motion / motion.std() + sosfilt(
        butter(2, rng.uniform(30, 60), fs=RATE_HZ, output="sos"), jolts)
    natural, ratio = rng.uniform(8, 20), rng.uniform(0.005, 0.02)
    slow = sosfilt(butter(2, rng.uniform(10, 20), fs=RATE_HZ, output="sos"), motion)
    pole = np.exp((-ratio + 1j) * 2 * np.pi * natural / RATE_HZ)
    ringing = lfilter([0, abs(1 - pole)**2], [1, -2 * pole.real, abs(pole)**2], slow)
    sensor = slow + rng.uniform(0.03, 0.1) * (ringing - slow)
    noise = 0.002 * rng.normal(size=COUNT), 0.01 * sensor.std() * rng.normal(size=COUNT)
    assert glitches(motion + noise[0], sensor + noise[1], np.ones(COUNT, bool)) == []


@pytest.mark.parametrize("seed", [0, 10, pytest.param(1, marks=pytest.mark.long),
                                  pytest.param(7, marks=pytest.mark.long)])
def test_bursts_of_motion_that_a_spring_bends_are_motion(seed):
    """A hundred samples did not count, and the spring had no name."""
    case = draw_case(seed, {"quadratic_stiffness"}, "dongle", "noise_bursts", 100.0)
    reference, sensor, _ = case.samples()
    assert not any("reference alone" in words
                   for words in Record.of(reference, sensor, "x").integrity(0).words)


@pytest.mark.parametrize("kind", [
    pytest.param("hold", marks=pytest.mark.thorough), pytest.param("zeros", marks=pytest.mark.long),
    pytest.param("noise", marks=pytest.mark.thorough)])
def test_a_faulty_reference_gives_the_sensor_no_name(kind):
    """Bursts of interference were named, or noise of the reference."""
    rng = np.random.default_rng([994, len(kind)])
    true, sensor = pair(rng)
    found = diagnose((samples(spoiled(rng, true, kind)[0]), samples(sensor)), time_limit_s=60)
    assert [finding.cause for finding in found.findings if finding.cause != "low_pass_lag"] == []
    assert found.extended["nrmse"] < 0.04
    words, = (words for words in found.integrity.words if "reference alone" in words)
    assert "a fault of the reference" in words


def test_a_faster_reference_loses_the_samples_that_its_fault_reaches():
    rng = np.random.default_rng(995)
    true, sensor = pair(rng)
    reference, places = spoiled(rng, resample_poly(true, 2, 1)[:COUNT], "spike")
    record = Record.of(samples(reference, 2 * RATE_HZ), samples(sensor[:COUNT // 2]))
    rows = np.round(places / 2).astype(int)
    first = round((record.start_ns * 1e-9) * RATE_HZ)
    assert not record.valid[rows - first].any()
    assert np.mean(record.valid) > 0.9
    assert np.std((record.reference[:, 0] - true[first:first + len(record)])[record.valid]) < 0.05


@pytest.mark.parametrize("size", [1e300, 1e-310])
@pytest.mark.filterwarnings("error")
def test_numbers_beyond_all_measure_do_no_harm(size):
    rng = np.random.default_rng(996)
    true, sensor = pair(rng)
    reference = true.copy()
    reference[::1000] = 1.7e308
    for signals in ((size * true, size * sensor), (reference, sensor), (true, reference)):
        glitches(*signals, np.ones(COUNT, bool))
    assert len(glitches(reference, sensor, np.ones(COUNT, bool))) > 15
