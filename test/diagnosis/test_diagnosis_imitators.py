"""Two filters that imitate one which is simpler, and two that are there."""

from types import SimpleNamespace

import numpy as np
import pytest
from sampled_pair import sampled_pair
from scipy.ndimage import uniform_filter1d
from scipy.signal import bilinear, butter, lfilter, sosfilt, sosfiltfilt

from frac_accel import Samples, SensorModel, diagnose
from frac_accel.diagnosis.doubts.imitations import another_alone
from frac_accel.diagnosis.engine import Engine
from frac_accel.diagnosis.judgement import Examined, _is_far_behind
from frac_accel.model.core import Gain
from frac_accel.model.effects import known_effects
from frac_accel.record import Record

RATE, COUNT, FINER = 2000.0, 20_000, 16
EFFECTS = known_effects()
AVERAGES = EFFECTS["linear_phase_filter"](0.0004, 4)
LOW_PASS = EFFECTS["low_pass_filter"](900.0, 8, "butterworth")


def engine_of(sensor):
    """Engine for a sensor with a gain of 1 in use, and what it gets at a far higher rate."""
    rng, fine = np.random.default_rng(1), FINER * RATE
    motion = sosfiltfilt(butter(1, [4, 150], "band", fs=fine, output="sos"),
                         rng.normal(size=FINER * COUNT))
    motion *= 4 / motion.std()
    both = butter(10, 0.45 * RATE, fs=fine, output="sos")
    signals = [sosfiltfilt(both, values) for values in (motion, sensor(motion, fine))]
    record = Record.of(*sampled_pair(rng, signals, FINER, RATE, 0.1), "x", None)
    return Engine(record, 0, SensorModel(Gain(1.0)), record.valid)


def doubted(engine, resonance):
    both = engine.search.fit({effect.cause: effect for effect in (AVERAGES, resonance)})
    engine.search.fit({LOW_PASS.cause: LOW_PASS})
    return set(another_alone(engine, both))


def test_two_filters_that_one_low_pass_stands_for_are_doubted():
    engine = engine_of(lambda motion, fine: sosfilt(
        butter(8, RATE / 2, fs=fine, output="sos"), motion))
    resonance = EFFECTS["second_resonance"](450.0, 0.11, 0.2)
    assert doubted(engine, resonance) == {"linear_phase_filter", "second_resonance"}


def test_two_filters_that_are_there_are_not():
    omega = 2 * np.pi * 200.0

    def sensor(motion, fine):
        ringing = lfilter(*bilinear([0.3 * omega**2], [1, 0.1 * omega, omega**2], fine), motion)
        return uniform_filter1d(0.7 * motion + ringing, 15)
    assert not doubted(engine_of(sensor), EFFECTS["second_resonance"](200.0, 0.05, 0.3))


@pytest.mark.parametrize("seed", range(3))
def test_noise_of_the_reference_is_no_filter_where_stamps_scatter(seed):
    """A mean of 7 to 21 samples keeps it from the output; its lag was taken back by the delay that
    such stamps leave open, and called a late reference."""
    rng, n = np.random.default_rng([43, seed]), 700
    motion = sosfiltfilt(butter(1, 0.01, fs=1.0, output="sos"),
                         np.cumsum(rng.normal(size=4 * n)))[n:2 * n]
    motion = 16 * (motion - motion.mean()) / motion.std()
    noisy = motion + 0.06 * rng.normal(size=n)
    for at in rng.choice(n, 40, replace=False):
        noisy[at] += rng.normal() * rng.choice([1, 1, 1, 4])
    stamps = 1e9 * np.arange(n)
    found = diagnose(tuple(Samples.of(np.round(at), np.outer(values, [1, 0, 0])) for at, values in (
        (stamps, noisy), (stamps + 3e5 * rng.normal(size=n) + 1e6,
                          motion + 0.05 * rng.normal(size=n)))), SensorModel(Gain(1.0)))
    assert found.findings == []


@pytest.mark.parametrize("cost, name, expected", [
    (1.9, "free_mass_friction", False), (2.1, "free_mass_friction", True),
    (2.1, "sensitivity_error", False), (2.1, "second_resonance", False)])
def test_a_set_without_doubts_that_leaves_far_more_is_no_answer(cost, name, expected):
    """Dry friction was named for a slow temperature probe, of which other sets, all in doubt, left
    a third of the power."""
    def examined(cost, *causes):
        effects = {cause: EFFECTS[cause] for cause in causes}
        return Examined(SimpleNamespace(cost=cost, effects=effects), dict.fromkeys(causes), None,
                        {}, {})
    here = examined(1.0, "second_resonance", "time_delay")
    assert _is_far_behind(here, examined(cost, name, "offset")) == expected
