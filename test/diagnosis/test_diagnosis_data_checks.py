"""What the record itself says is read off rightly: lattice, limits, stamps."""

import numpy as np
import pytest

from frac_accel.io.samples import Samples
from frac_accel.model.effects.timestamp_jitter import TimestampJitter
from frac_accel.record import Record, Topic
from frac_accel.record.clock import slots_of
from frac_accel.record.lattice import lattice_step

RATE = 1000.0


def samples(values, stamps_s=None):
    """Samples whose x axis holds the values."""
    stamps_s = np.arange(len(values)) / RATE if stamps_s is None else stamps_s
    return Samples.of(np.round(stamps_s * 1e9).astype(np.int64),
                      np.stack([values, values, values], axis=1))


@pytest.mark.parametrize("seed", range(5))
def test_step_of_rounded_values_is_found(seed):
    rng = np.random.default_rng(seed)
    step = float(np.exp(rng.uniform(-6, 1)))
    values = rng.normal(0, step * rng.uniform(3, 300), 8000) + rng.normal()
    assert lattice_step(step * np.round(values / step)) == pytest.approx(step, rel=1e-6)


def test_values_without_a_lattice_have_none():
    rng = np.random.default_rng(0)
    assert lattice_step(rng.normal(size=8000)) is None


@pytest.mark.parametrize("seed", range(5))
def test_limits_are_found_where_samples_pile_up(seed):
    rng = np.random.default_rng(seed)
    values = rng.normal(size=4000)
    lower, upper = -rng.uniform(1, 2.5), rng.uniform(1, 2.5)
    found = Topic(samples(np.clip(values, lower, upper)), "sensor").integrity(0)
    assert (found.lower, found.upper) == (lower, upper)


@pytest.mark.parametrize("step", [None, 0.05, 0.5])
def test_no_limits_where_nothing_is_clipped(step):
    rng = np.random.default_rng(1)
    for values in (rng.normal(size=20_000), np.sin(0.7 * np.arange(20_000)) + 1e-3 * rng.normal(
            size=20_000)):
        values = values if step is None else step * np.round(values / step)
        found = Topic(samples(values), "sensor").integrity(0)
        crest = step is not None and np.ptp(values) < 6 * step
        assert crest or (found.lower is None and found.upper is None)


@pytest.mark.parametrize("seed", range(4))
def test_lost_samples_are_counted_and_stamps_that_scatter_measured(seed):
    rng = np.random.default_rng(seed)
    scatter_s = rng.uniform(0.01, 0.1) / RATE
    kept = rng.random(10_000) > 0.01
    stamps = np.arange(10_000) / RATE + rng.normal(0, scatter_s, 10_000)
    kept[[0, -1]] = True
    found = Topic(samples(rng.normal(size=kept.sum()), stamps[kept]), "sensor").integrity(0)
    assert found.missing == np.sum(~kept)
    assert found.jitter_rms_s == pytest.approx(scatter_s, rel=0.05)


@pytest.mark.parametrize("seed", range(4))
def test_stamps_that_are_rounded_scatter_for_no_other_reason(seed):
    """1 µs at 2 kHz was `timestamp_jitter`."""
    rng = np.random.default_rng([55, seed])
    unit = rng.choice([1e-6, 1e-5, 1e-3]) * rng.choice([1, 2, 5])
    rate, values = rng.uniform(0.005, 0.05) / unit, rng.normal(size=10_000)
    true = np.arange(10_000) / rate
    for scatter, rounds in ((0.0, True), (unit, False)):
        stamps = unit * np.round((true + rng.normal(0, scatter, 10_000)) / unit)
        found = Topic(samples(values, stamps), "sensor").integrity(0)
        assert found.rounds_stamps == rounds
        assert any("stamps are multiples of" in words for words in found.words) == rounds
        assert (TimestampJitter.of_record(found, values) is None) == rounds


@pytest.mark.parametrize("scatter", [0.15, 0.25, 0.35])
def test_samples_keep_their_places_where_stamps_scatter_widely(scatter):
    rng = np.random.default_rng(3)
    place = np.sort(np.arange(5000) + rng.normal(0, scatter, 5000))
    assert np.array_equal(slots_of(place), np.arange(5000))


@pytest.mark.parametrize("lost, most", [(0.0, 0.15), (0.01, 0.12)])
def test_rate_is_right_where_stamps_scatter(lost, most):
    """A late stamp makes an interval look like two: in the first 64 of a tenth of records."""
    rng = np.random.default_rng(4)
    n = 4000
    for _ in range(100):
        kept = rng.random(n) >= lost
        stamps = (np.arange(n) + rng.normal(0, rng.uniform(0.05, most), n)) / RATE
        pair = Record.of(samples(rng.normal(size=n)),
                         samples(rng.normal(size=kept.sum()), stamps[kept]))
        assert len(pair) >= n - 1 - 10 * lost
        assert pair.valid.sum() == pytest.approx(kept.sum(), abs=1)


def test_temperature_follows_a_course_that_bends():
    rng = np.random.default_rng(5)
    t = np.arange(12_000) / RATE
    period_s = rng.uniform(8, 20)
    celsius = 25 + 12 * np.sin(2 * np.pi * t / period_s + rng.uniform(0, 6))
    every = slice(None, None, 50)
    stamps = np.round(t * 1e9).astype(np.int64)
    # a repeated stamp and a missing value must not matter
    given = (np.r_[stamps[every], stamps[-50]], np.r_[celsius[every], np.nan])
    record = Record.of(samples(rng.normal(size=12_000)), samples(rng.normal(size=12_000)),
                       temperature=given)
    inside = slice(100, -100)
    assert np.max(np.abs(record.temperature_c - celsius)[inside]) < 2e-4
