"""A high-pass of sensor or reference: under gravity, where it takes most of the motion away, and in
a sweep beside slow noise."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d
from scipy.signal import butter, iirpeak, lfilter, sosfilt, sosfiltfilt

from frac_accel import FracAccelError, Samples, SensorModel, diagnose
from frac_accel.model.core import Gain

FINE = 8


def high_passed(values, rate, corner_hz):
    """The exact high-pass of straight lines between fine samples, from its steady state."""
    w = 2 * np.pi * corner_hz / rate
    pole = np.exp(-w)
    slopes = np.diff(values, prepend=values[0])
    return lfilter([(1 - pole) / w], [1, -pole], slopes)


def pair(rate, reference, sensor, axis):
    at = np.round(1e9 * (50 + np.arange(len(reference)) / rate))
    across = np.eye(3)["xyz".index(axis)]
    return tuple(Samples.of(at, np.outer(values, across)) for values in (reference, sensor))


def road(rng, rate, seconds, low_hz, high_hz):
    sos = butter(6, [low_hz, high_hz], "band", fs=FINE * rate, output="sos")
    return sosfiltfilt(sos, rng.normal(size=int(FINE * rate * seconds)))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_ac_coupling_of_a_vertical_axis(seed):
    """It takes all of gravity away, which an offset does as well."""
    rng, rate = np.random.default_rng(seed), 200.0
    motion = road(rng, rate, 100, 0.3, 40.0)
    motion = 9.81 + motion / motion.std()
    corner = np.exp(rng.uniform(np.log(0.1), np.log(1.0)))
    sensor = 0.97 * high_passed(motion, FINE * rate, corner)[::FINE]
    reference = motion[::FINE]
    n = len(reference)
    found = diagnose(pair(rate, reference + 0.003 * rng.normal(size=n),
                          sensor + 0.005 * rng.normal(size=n), "z"), axis="z", time_limit_s=60)
    named = {f.cause: f for f in found.findings}
    assert set(named) - {"offset"} == {"ac_coupling"}
    assert named["ac_coupling"].effect.corner_hz == pytest.approx(corner, rel=0.02)
    assert found.verdict == "explained"


@pytest.mark.parametrize("seed", [9, 10, 11])
def test_a_reference_that_has_lost_most_of_the_motion(seed):
    """Braking and hills are in the sensor alone: an oscillator of no frequency was identified, and
    stood in the way of all else."""
    rng, rate = np.random.default_rng(seed), 200.0
    fast, slow = road(rng, rate, 80, 0.5, 40.0), road(rng, rate, 80, 0.02, 0.2)
    motion = 0.3 * fast / fast.std() + rng.uniform(1, 3) * slow / slow.std()
    corner = rng.uniform(0.2, 0.6)
    recorded = high_passed(motion, FINE * rate, corner)[::FINE]
    n = len(recorded)
    found = diagnose(pair(rate, recorded + 0.002 * rng.normal(size=n),
                          rng.uniform(0.95, 1.05) * motion[::FINE] + rng.normal(size=n) * 0.005,
                          "x"), time_limit_s=60)
    cause, = [finding for finding in found.findings if finding.cause != "offset"]
    assert cause.cause == "reference_ac_coupling"
    assert cause.effect.corner_hz == pytest.approx(corner, rel=0.02)
    assert found.verdict == "explained"


@pytest.mark.parametrize("seed", [4, 5])
def test_ac_coupling_that_takes_most_of_the_motion_away(seed):
    """No classical sensor describes a tenth of it, so that the record was refused."""
    rng, rate = np.random.default_rng(seed), 200.0
    fast, slow = road(rng, rate, 80, 0.5, 40.0), road(rng, rate, 80, 0.02, 0.1)
    motion = 0.1 * fast / fast.std() + slow / slow.std()
    corner = rng.uniform(1.0, 1.5)
    sensor = high_passed(motion, FINE * rate, corner)[::FINE]
    n = len(sensor)
    found = diagnose(pair(rate, motion[::FINE] + 0.0005 * rng.normal(size=n),
                          sensor + 0.0005 * rng.normal(size=n), "y"), axis="y", time_limit_s=60)
    cause, = found.findings
    assert cause.cause == "ac_coupling"
    assert cause.effect.corner_hz == pytest.approx(corner, rel=0.02)


def test_what_follows_nothing_is_still_refused():
    rng, rate = np.random.default_rng(6), 200.0
    signals = [road(rng, rate, 80, 0.5, 40.0)[::FINE] for _ in range(2)]
    with pytest.raises(FracAccelError):
        diagnose(pair(rate, *signals, "y"), axis="y")


@pytest.mark.parametrize("seed", [7, 8])
def test_a_reference_behind_a_high_pass_in_a_sweep_beside_slow_noise(seed):
    """What stands for the slow noise has no name; the high-pass is named, or suspected with the
    recording that would tell, and nothing else is."""
    rng, rate, seconds = np.random.default_rng(seed), 400.0, 25.0
    t = np.arange(0, seconds, 1 / (FINE * rate))
    motion = 3 * np.sin(2 * np.pi * (0.3 * t + 0.5 * (20 - 0.3) / seconds * t**2))
    corner = rng.uniform(0.35, 0.6)
    recorded = high_passed(motion, FINE * rate, corner)[::FINE]
    n = len(recorded)
    slow = lfilter([1], [1, -0.9995], rng.normal(size=n))
    reference = recorded + 0.002 * slow / slow.std() + 0.001 * rng.normal(size=n)
    late = CubicSpline(t, motion)(t[::FINE] - 1e-4)
    found = diagnose(pair(rate, reference, 0.99 * late + 0.01 * rng.normal(size=n), "x"),
                     time_limit_s=60)
    named = {f.cause: f for f in found.findings}
    assert not set(named) - {"time_delay", "offset", "reference_ac_coupling"}
    if "reference_ac_coupling" not in named:
        suspected = [entry for entry in found.suspects
                     if "reference_ac_coupling" in entry["causes"]]
        assert suspected and "constant acceleration" in suspected[0]["experiment"]
        assert found.extended["nrmse"] < 0.02  # the model has it as a description
        return
    assert named["reference_ac_coupling"].effect.corner_hz == pytest.approx(corner, rel=0.02)
    assert found.verdict == "explained"


@pytest.mark.thorough
def test_beside_a_filter_of_no_kind_a_high_pass_makes_no_late_reference():
    """A high-pass is ahead of slow motion, which speaks for no late reference; it is a cause itself
    where a bell without phase, late by a part of a sample, has no name."""
    rate, count, named = 25.0, 3000, 0
    for seed in range(4):
        rng = np.random.default_rng([41, seed])
        motion = sosfiltfilt(butter(2, [0.02, 1.5], "band", fs=FINE * rate, output="sos"),
                             rng.normal(size=FINE * count))
        motion, corner = motion / motion.std(), rng.uniform(0.1, 0.2)
        behind = gaussian_filter1d(high_passed(motion, FINE * rate, corner),
                                   rng.uniform(0.05, 0.08) * FINE * rate)
        behind = np.roll(behind, int(rng.uniform(0.0, 0.03) * FINE * rate))[::FINE]
        found = diagnose(pair(rate, motion[::FINE], behind + 0.004 * rng.normal(size=count), "x"),
                         SensorModel(Gain(1.0)))
        assert {finding.cause for finding in found.findings} <= {"ac_coupling"}
        for finding in found.findings:
            named += 1
            assert finding.effect.corner_hz == pytest.approx(corner, rel=0.05)
    assert named >= 2


@pytest.mark.parametrize("seed", range(2))
def test_noise_of_the_reference_shows_behind_a_high_pass(seed):
    """Without it the two share too little of slow motion, and the search took all of its time."""
    rng, rate, begins = np.random.default_rng([81, seed]), 200.0, 2_000
    fine = FINE * rate
    white = rng.standard_normal(FINE * (24_000 + begins))
    motion = sosfilt(butter(2, [1, 60], "bandpass", fs=fine, output="sos"), white)
    motion /= motion.std()
    for mode_hz in rng.uniform([4, 12, 30], [8, 20, 50]):
        mode = lfilter(*iirpeak(mode_hz, rng.uniform(4, 10), fs=fine), white)
        motion = motion + rng.uniform(0.3, 1) * mode / mode.std()
    motion = sosfilt(butter(8, 80, fs=fine, output="sos"), motion)
    motion /= motion.std()
    corner_hz = rng.uniform(1.5, 5)
    sensor = high_passed(motion, fine, corner_hz)[::FINE]
    std = rng.uniform(0.04, 0.08)
    reference = motion[::FINE] + std * rng.standard_normal(len(sensor))
    sensor = sensor + 0.005 * rng.standard_normal(len(sensor))
    found = diagnose((reference[begins:], sensor[begins:]), SensorModel(Gain(1.0)),
                     sampling_rate_hz=rate, time_limit_s=60)
    named = {finding.cause: finding for finding in found.findings}
    assert named.keys() == {"ac_coupling", "reference_noise"} and found.cut_off is None
    corner = named["ac_coupling"]
    assert abs(corner.effect.corner_hz - corner_hz) < 4 * corner.std["corner_hz"]
    noise = named["reference_noise"]
    assert abs(noise.effect.std - std) < 4 * noise.std["std"]
    assert noise.effect.std == pytest.approx(std, rel=0.05)


@pytest.mark.thorough
@pytest.mark.parametrize("seed", range(4))
def test_a_late_reference_beside_a_high_pass(seed):
    """The lead is one at all frequencies, and a high-pass has no lag that it could take back: both
    had no name, though nothing was left, where the lead is shorter than what stamps prove."""
    rng, rate = np.random.default_rng([46, seed]), 200.0
    motion = road(rng, rate, 100, 0.3, 40.0)
    motion = 9.81 + motion / motion.std()
    corner, late = np.exp(rng.uniform(np.log(0.05), np.log(0.5))), rng.uniform(0.003, 0.009)
    sensor = high_passed(motion, FINE * rate, corner)[::FINE]
    time = np.arange(len(motion)) / (FINE * rate)
    reference = CubicSpline(time, motion)(np.maximum(time[::FINE] - late, 0))
    n = len(sensor)
    found = diagnose(pair(rate, reference + 0.003 * rng.normal(size=n),
                          sensor + 0.005 * rng.normal(size=n), "z"),
                     SensorModel(Gain(1.0)), axis="z", time_limit_s=60)
    named = {finding.cause: finding.effect for finding in found.findings}
    assert set(named) == {"ac_coupling", "reference_delay"}
    assert named["ac_coupling"].corner_hz == pytest.approx(corner, rel=0.02)
    assert named["reference_delay"].delay_s == pytest.approx(late, abs=3e-5)
    assert found.verdict == "explained"
