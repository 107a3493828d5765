"""A constant of the reference, such as gravity, and what a sensor makes of it."""

import numpy as np
import pytest
from sampled_pair import sampled_pair
from scipy.signal import butter, cheby1, sosfilt, sosfiltfilt
from scipy.spatial.transform import Rotation

from frac_accel import Samples, SensorModel, diagnose
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


def far_from_zero(seed, course, count=5000):
    """A barometer, and a height made of it: slow, smoothed, with a drift of its zero or gain, and
    a wandering that no cause says."""
    rng, fine = np.random.default_rng([20261128, seed]), 10
    slow, fast = (sosfilt(butter(order, corner, fs=fine, output="sos"),
                          rng.normal(size=(count + 1000) * fine))
                  for order, corner in ((1, 1 / 3000), (2, 0.02)))
    motion = 8 * slow / slow.std() + rng.uniform(1, 3) * fast / fast.std()
    smooth = np.convolve(motion, np.full(8 * fine, 1 / (8 * fine)))[:len(motion)]
    motion, smooth = (1000 + values[1000 * fine::fine] for values in (motion, smooth))
    gain, drift = -rng.uniform(0.07, 0.12), rng.uniform(1e-3, 2e-3) * np.arange(count)
    output = gain * smooth + drift if course == "offset_drift" \
        else gain * smooth * (1 + drift / (1000 * gain))
    wandering = 0.0015 * np.cumsum(rng.normal(size=count)) + 0.004 * rng.normal(size=count)
    return np.round(motion, 1), np.round(output + 90 + wandering, 2)


@pytest.mark.parametrize("course, seed", [("offset_drift", 6), ("offset_drift", 7),
                                          ("gain_drift", 5), ("gain_drift", 3)])
def test_a_course_of_the_zero_or_of_the_gain(course, seed):
    """Far from zero either does nearly what the other does: the wrong one is never named."""
    found = diagnose(far_from_zero(seed, course), sampling_rate_hz=1.0)
    named = {finding.cause for finding in found.findings}
    assert not named & ({"gain_drift", "offset_drift"} - {course})


def test_a_start_of_the_search_stays_within_the_limits():
    """Where a clock seems to be off by more than any is, the search does not begin there."""
    found = diagnose(far_from_zero(2, "offset_drift"), sampling_rate_hz=1.0)
    # what is there, and nothing else
    assert {finding.cause for finding in found.findings} \
        <= {"offset", "offset_drift", "linear_phase_filter"}


@pytest.mark.parametrize("seed", range(4))
def test_a_turn_under_gravity_is_known_as_well_as_the_zero_lets_it_be(seed):
    """A zero of a hundredth of gravity does what a turn of 0.6 degrees does: the uncertainty was 25
    times too small, as if there was none."""
    rng = np.random.default_rng([149, seed])
    count, rate = 4000, 50.0
    motion = sosfiltfilt(butter(2, [0.05, 1.0], "band", fs=rate, output="sos"),
                         rng.normal(size=(count, 3)), axis=0)
    reference = motion / motion.std(axis=0) * [1.0, 1.2, 0.4] + [0, 0, 9.81]
    angles = rng.uniform(1.0, 3.0, 3) * rng.choice([-1, 1], 3)
    sensor = Rotation.from_euler("xyz", angles, degrees=True).inv().apply(reference)
    sensor += [0, rng.choice([-1, 1]) * rng.uniform(0.05, 0.12), 0]
    sensor += 0.03 * rng.normal(size=sensor.shape)
    stamps = np.round(1e9 * np.arange(count) / rate)
    found = diagnose(tuple(Samples.of(stamps, values) for values in (reference, sensor)),
                     SensorModel(Gain(1.0)), axis="y")
    turn, = (f for f in found.findings if f.cause == "misalignment")
    roll, _, yaw = angles
    assert abs(turn.effect.roll_deg - roll) < 4 * turn.std["roll_deg"]
    assert abs(turn.effect.yaw_deg - yaw) < 4 * turn.std["yaw_deg"]


@pytest.mark.parametrize("shown, along", [(True, (-1, 1)), (False, (-1, 1)), (False, (1, 1.5))])
def test_a_zero_under_gravity_is_known_as_well_as_a_turn_lets_it_be(shown, along):
    """A turn of half a degree that hardly shows, where the other axes hardly move, brings 0.09 m/s²
    of gravity: the zero's uncertainty was hundreds of times too small, as if there was none.

    Of a reference that does not show gravity, a turn that is known (as the other axes move `along`,
    by powers of ten) brings it, too."""
    apart, rate, count = [], 100.0, 6000
    for seed in range(12):
        rng = np.random.default_rng([161, seed])
        motion = sosfiltfilt(butter(2, [0.5, 20], "band", fs=rate, output="sos"),
                             rng.normal(size=(count, 3)), axis=0)
        reference = motion / motion.std(axis=0) * [2.0, *0.03 * 10**rng.uniform(*along, 2)] \
            + [0, 0, 9.81]
        turn = Rotation.from_euler("xyz", rng.normal(0, 0.7, 3), degrees=True)
        zero = rng.choice([-1, 1]) * rng.uniform(0.05, 0.3)
        sensor = turn.inv().apply(reference) + [zero, 0, 0] + 0.02 * rng.normal(size=(count, 3))
        stamps = np.round(1e9 * np.arange(count) / rate)
        reference = reference - [0, 0, 0 if shown else 9.81]
        found = diagnose(tuple(Samples.of(stamps, values) for values in (reference, sensor)),
                         SensorModel(Gain(1.0)))
        apart += [(f.effect.offset - zero) / f.std["offset"] for f in found.findings
                  if f.cause == "offset"]
    assert len(apart) >= 8
    assert np.mean(np.abs(apart) < 1.96) > 0.8 and np.max(np.abs(apart)) < 3.5
    # and it is not so large that it says nothing
    assert np.sqrt(np.mean(np.square(apart))) > 0.4
