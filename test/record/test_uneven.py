"""Samples that are read now and then, and two that are read together."""

import numpy as np
import pytest

from frac_accel import Samples
from frac_accel.record import Record
from frac_accel.record.clock import Clock


@pytest.mark.parametrize("seed", range(5))
def test_the_ticks_of_a_clock_that_reads_now_and_then_are_no_instants(seed):
    """Telemetry at 3 Hz on a grid of 20 ms: 94 % of the samples were "missing"."""
    rng = np.random.default_rng([661, seed])
    tick_s = rng.uniform(0.01, 0.05)
    steps = rng.choice([14, 16, 18, 20], 1000)
    stamps = np.cumsum(steps) * tick_s + rng.uniform(0, 0.2 * tick_s, 1000)
    clock = Clock.of(np.round(1e9 * stamps).astype(np.int64))
    assert clock.kind == "uneven"
    assert clock.rate_hz == pytest.approx(1 / (20 * tick_s), rel=0.1)


@pytest.mark.parametrize("share", [0.3, 0.5])
def test_losses_at_random_leave_a_clock_one(share):
    rng = np.random.default_rng(662)
    kept = rng.uniform(size=4000) > share
    clock = Clock.of((np.flatnonzero(kept) * 10_000_000).astype(np.int64))
    assert clock.kind == "regular" and clock.rate_hz == pytest.approx(100.0)


@pytest.mark.parametrize("seed", range(3))
def test_uneven_samples_that_were_taken_together_stay_together(seed):
    rng = np.random.default_rng([663, seed])
    seconds = np.cumsum(rng.choice([0.01, 0.02, 0.03, 0.05], 1500, p=[0.3, 0.5, 0.1, 0.1])
                        + rng.uniform(0, 0.004, 1500))
    values = np.outer(np.sin(2 * np.pi * 0.7 * seconds) + 0.3 * rng.normal(size=1500), [1, 0, 0])
    lag = rng.uniform(-0.002, 0.002)
    late = seconds + lag + rng.choice([0.0, -0.001], 1500, p=[0.9, 0.1])
    one, two = (Samples.of(np.round(1e9 * at), values + zero)
                for at, zero in ((seconds, 0.0), (late, [0.25, 0, 0])))
    record = Record.of(one, two)
    apart = (record.sensor - record.reference)[record.valid, 0]
    # but for the lag, the same
    slope = np.std(np.diff(record.reference[record.valid, 0])) * record.sampling_rate_hz
    assert np.mean(apart) == pytest.approx(0.25, abs=0.01)
    assert np.std(apart) < 2 * abs(lag) * slope + 1e-6


@pytest.mark.parametrize("seed", range(12))
def test_a_loop_that_takes_its_time_is_no_clock_that_loses_samples(seed):
    """Steps of one, one and a half or two turns of a busy loop: at 50 Hz, 30 % were "missing"."""
    rng = np.random.default_rng([971, seed])
    turns_s = rng.uniform(0.016, 0.018), rng.uniform(0.024, 0.028), rng.uniform(0.033, 0.036)
    steps_s = rng.choice(turns_s, 20_000, p=[0.4, 0.35, 0.25]) + rng.normal(0, 0.001, 20_000)
    assert Clock.of(np.round(1e9 * np.cumsum(steps_s)).astype(np.int64)).kind == "uneven"


@pytest.mark.parametrize("seed", range(5))
def test_a_clock_that_wanders_and_loses_samples_is_one(seed):
    rng = np.random.default_rng([972, seed])
    slot = np.flatnonzero(rng.random(20_000) > rng.uniform(0.03, 0.2))
    wander = np.interp(slot, np.linspace(0, 20_000, 9), rng.uniform(-2, 2, 9))
    stamps = slot + wander + rng.normal(0, 0.1, len(slot))
    assert Clock.of(np.round(1e7 * np.maximum.accumulate(stamps)).astype(np.int64)
                    + np.arange(len(slot))).kind == "regular"
