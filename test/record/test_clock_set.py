"""Stamps that jump once by less than an interval, as where a clock is set; the samples go on."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfiltfilt

from frac_accel import Samples, SensorModel, diagnose
from frac_accel.model.core import Gain
from frac_accel.record.clock import Clock

RATE, COUNT = 200.0, 12_000


def stamped(rng, scatter):
    """Stamps [ns], the sample at which they jump, and by how much [s]."""
    at = rng.integers(COUNT // 5, 4 * COUNT // 5)
    size = rng.uniform(0.1, 0.45) * rng.choice([-1, 1]) / RATE
    seconds = np.arange(COUNT) / RATE + size * (np.arange(COUNT) >= at)
    return np.round(1e9 * (seconds + scatter / RATE * rng.normal(size=COUNT))), at, size


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("scatter", [0.0, 0.002])
def test_a_jump_is_told_and_instants_go_on(seed, scatter):
    rng = np.random.default_rng([121, seed])
    stamps, at, size = stamped(rng, scatter)
    clock = Clock.of(stamps)
    assert clock.jump.size_s == pytest.approx(size, abs=0.001 / RATE)
    assert clock.jump.at_s == pytest.approx(at / RATE + size, abs=0.02 / RATE)
    assert clock.rate_hz == pytest.approx(RATE, rel=1e-7)
    np.testing.assert_allclose(clock.instants_s(stamps), np.arange(COUNT) / RATE,
                               atol=0.01 / RATE)
    assert clock.scatter_s < (scatter + 0.001) / RATE


def test_scatter_losses_and_wander_are_no_jump():
    rng, place = np.random.default_rng(122), np.arange(COUNT)
    for seconds in (place / RATE, (place + 0.05 * rng.normal(size=COUNT)) / RATE,
                    place[rng.random(COUNT) > 0.02] / RATE,
                    (place + 0.2 * np.sin(2 * np.pi * place / COUNT)) / RATE,
                    (place + 0.2 * np.abs(place / COUNT - 0.5)) / RATE):
        assert Clock.of(np.round(1e9 * seconds)).jump is None


@pytest.mark.parametrize("seed", range(5))
def test_a_jump_across_lost_samples_is_no_scatter(seed):
    """Stamps that are even but for one step of 4.43 intervals scattered by a tenth of one."""
    rng = np.random.default_rng([124, seed])
    at = rng.integers(COUNT // 5, 4 * COUNT // 5)
    away = rng.integers(1, 40) + rng.uniform(0.1, 0.45) * rng.choice([-1, 1])
    clock = Clock.of(np.round(1e9 / RATE * (np.arange(COUNT) + away * (np.arange(COUNT) >= at))))
    assert clock.jump is None  # whether samples are lost there, the stamps do not tell
    assert clock.scatter_s < 0.001 / RATE
    assert clock.slot[-1] == COUNT - 1 + round(away)


@pytest.mark.parametrize("slower", [1.6, 1.0])
@pytest.mark.parametrize("seed", range(2))
def test_it_has_its_name_and_nothing_else(seed, slower):
    """It was `timestamp_jitter`, with a skew and a delay that undo each other; beside a reference
    of the same rate, a delay."""
    rng = np.random.default_rng([123, seed])
    stamps, _, size = stamped(rng, 0.0)
    fine = np.arange(COUNT * 20 + 400) / (20 * RATE)
    motion = sosfiltfilt(butter(3, (0.5, 20.0), "band", fs=20 * RATE, output="sos"),
                         rng.normal(size=len(fine)))
    motion = CubicSpline(fine, motion / motion.std())
    taken = 0.02 + np.arange(COUNT) / RATE
    every = 0.02 + np.arange(int(COUNT / slower)) * slower / RATE
    reference = Samples.of(np.round(1e9 * (every - 0.02)), np.outer(motion(every), [1.0, 0, 0]))
    sensor = motion(taken) + 0.005 * rng.normal(size=COUNT)
    found = diagnose((reference, Samples.of(stamps, np.outer(sensor, [1.0, 0, 0]))),
                     SensorModel(Gain(1.0)))
    assert [finding.cause for finding in found.findings] == ["time_step"]
    assert found.findings[0].effect.step_s == pytest.approx(size, abs=3e-9)
    assert found.verdict == "explained"
    assert any("their clock was set" in words for words in found.integrity.words)


@pytest.mark.parametrize("seed", range(2))
def test_few_stamps_far_off_are_no_scatter(seed):
    """The stamps of a watch scatter by 0.04 % of an interval, and a few are two intervals off:
    `timestamp_jitter` of 353 us took 8 % of the error, which those few made."""
    rng = np.random.default_rng([125, seed])
    motion = sosfiltfilt(butter(3, (0.005, 0.15), "band", fs=1.0, output="sos"),
                         rng.normal(size=COUNT))
    sensor = motion / motion.std() + 0.03 * rng.normal(size=COUNT)
    stamps = np.arange(COUNT) + 3.5e-4 * rng.normal(size=COUNT)
    for at in rng.choice(COUNT - 20, 12, replace=False) + 10:
        stamps[at:at + 3] -= rng.uniform(0.5, 0.9)
    found = diagnose(tuple(
        Samples.of(np.sort(np.round(1e9 * seconds)), np.outer(values, [1.0, 0, 0]))
        for seconds, values in ((np.arange(COUNT), motion / motion.std()), (stamps, sensor))),
        SensorModel(Gain(1.0)))
    assert [finding.cause for finding in found.findings] == []
