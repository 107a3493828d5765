"""Samples that pile up at a value, beside a model that is no better than what it does not know."""

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from frac_accel import Samples, SensorModel, diagnose
from frac_accel.model.core import Gain
from frac_accel.record.clipping import clipped, pile_up

COUNT = 20_000


def motion_and_guess(rng, noise, band=(0.02, 0.3)):
    """Motion of unit power in a band [of the Nyquist frequency], and a guess of it that is off by
    as much noise."""
    sos = butter(2, band, "band", output="sos")
    motion = sosfiltfilt(sos, rng.normal(size=COUNT))
    return motion / motion.std(), lambda known: motion / motion.std() \
        + noise * rng.normal(size=COUNT)


@pytest.mark.parametrize("seed", range(8))
def test_a_limit_reached_often_shows_beside_a_model_that_is_off_by_more(seed):
    """Half of what is left is far more than what is cut off, but many samples have a mean."""
    rng = np.random.default_rng([61, seed])
    motion, guess = motion_and_guess(rng, rng.uniform(0.4, 0.8))
    step, limit = rng.uniform(0.05, 0.15), rng.uniform(1.8, 2.2)
    values = step * np.round((np.clip(motion, -9, limit) + 0.02 * rng.normal(size=COUNT)) / step)
    top = step * np.floor(limit / step)
    values = np.minimum(values, top)
    found = clipped(values, np.ones(COUNT, bool), step, guess)
    assert found.upper == top
    assert found.lower is None


def test_a_pile_by_chance_is_no_limit():
    """Of motion on a coarse lattice the extreme comes oftener than its neighbours now and then; and
    a guess of it that is noisy knows nothing of that."""
    piles = 0
    for seed in range(400):
        rng = np.random.default_rng([62, seed])
        motion, guess = motion_and_guess(rng, rng.uniform(0.1, 0.8), (0.005, 0.02))
        step = rng.uniform(0.1, 0.5)
        values = step * np.round(motion[:2000] / step)
        piles += any(pile_up(side * values) is not None for side in (-1, 1))
        found = clipped(values, np.ones(2000, bool), step, lambda known, of=guess: of(known)[:2000])
        assert not found.samples.any()
    assert piles > 20


def test_crests_on_a_lattice_are_no_limit():
    """A sine stands at its crests: there its values pile up, and its model goes no further."""
    piles, time = 0, np.arange(COUNT)
    for seed in range(20):
        rng = np.random.default_rng([63, seed])
        motion = np.sin(2 * np.pi * rng.uniform(0.01, 0.02) * time)
        step = rng.uniform(0.05, 0.1)
        values = step * np.round(motion / step)
        piles += pile_up(values) is not None
        noise = 0.3 * rng.normal(size=COUNT)
        found = clipped(values, np.ones(COUNT, bool), step, lambda known, m=motion + noise: m)
        assert not found.samples.any()
    assert piles > 4


@pytest.mark.thorough
@pytest.mark.parametrize("seed", range(4))
def test_a_limit_beside_a_slower_reference(seed):
    """Of a sensor that is resampled, its own values show the limit, under gravity."""
    rng, rate, slow = np.random.default_rng([64, seed]), 200.0, 50.0
    count = int(120 * rate)
    motion = sosfiltfilt(butter(2, [0.5, 15.0], "band", fs=rate, output="sos"),
                         rng.normal(size=count))
    motion = 9.81 + 0.7 * motion / motion.std()
    lower, upper = 9.81 - rng.uniform(1.3, 1.6), 9.81 + rng.uniform(1.3, 1.6)
    step = rng.uniform(0.08, 0.12)
    sensor = np.clip(motion + 0.05 * rng.normal(size=count), lower, upper)
    sensor = step * np.round(sensor / step)
    part = int(rate / slow)
    at = np.round(1e9 * np.arange(count) / rate)
    smooth = sosfiltfilt(butter(8, 20.0, fs=rate, output="sos"), motion)
    found = diagnose((Samples.of(at[::part], np.outer(
        smooth[::part] + 0.05 * rng.normal(size=len(smooth[::part])), [0, 0, 1])),
        Samples.of(at, np.outer(sensor, [0, 0, 1]))), SensorModel(Gain(1.0)), axis="z",
        time_limit_s=60)
    named = {finding.cause: finding.effect for finding in found.findings}
    assert "clipping" in named
    # of one limit the tail may fall too slowly for its pile to stand out
    off = [abs(named["clipping"].lower - lower), abs(named["clipping"].upper - upper)]
    assert min(off) <= step / 2 + 1e-9
    assert all(one <= step / 2 + 1e-9 or one > 1e3 for one in off)
    assert set(named) <= {"clipping", "quantization", "reference_noise"}


def test_certain_limits_beside_a_slower_reference_are_told_once():
    """What is certain by itself asks no model."""
    rng, rate = np.random.default_rng(65), 200.0
    count = int(60 * rate)
    motion = sosfiltfilt(butter(2, [0.5, 15.0], "band", fs=rate, output="sos"),
                         rng.normal(size=count))
    motion = motion / motion.std()
    sensor = np.clip(motion + 0.01 * rng.normal(size=count), -1.5, 1.5)
    at = np.round(1e9 * np.arange(count) / rate)
    found = diagnose((Samples.of(at[::4], np.outer(motion[::4], [1, 0, 0])),
                      Samples.of(at, np.outer(sensor, [1, 0, 0]))), SensorModel(Gain(1.0)),
                     time_limit_s=10)
    words = found.as_dict()["integrity"]
    assert sum("upper limit" in one for one in words) == 1
    assert sum("lower limit" in one for one in words) == 1
