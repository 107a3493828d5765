"""Samples that a recorder has mixed are put in order; not so behind a clock that was set back."""

import numpy as np
import pytest

from frac_accel import Record, Samples
from frac_accel.record.ordering import Reordering, in_order

RATE = 2000.0


def run(rng, count=4000):
    stamps = np.round(np.arange(count) * 1e9 / RATE).astype(np.int64) + 10**18
    values = np.cumsum(rng.normal(size=(count, 3)), axis=0)
    values -= np.linspace(0, 1, count)[:, None] * values[-1]
    return Samples.of(stamps, values)


def mixed(samples, rng, scatter_s):
    """As a recorder writes them whose messages wait for different times."""
    waits_ns = rng.normal(size=len(samples.stamps_ns)) * scatter_s * 1e9
    order = np.argsort(samples.stamps_ns + waits_ns, kind="stable")
    return Samples.of(samples.stamps_ns[order], samples.values[order])


@pytest.mark.parametrize("seed", range(5))
def test_mixed_samples_make_the_record_that_they_made_before(seed):
    rng = np.random.default_rng(seed)
    whole = run(rng)
    other = mixed(whole, rng, rng.uniform(0.2, 5) / RATE)
    assert np.any(np.diff(other.stamps_ns) < 0)
    before, after = Record.of(whole, whole), Record.of(whole, other)
    np.testing.assert_array_equal(after.sensor, before.sensor)
    np.testing.assert_array_equal(after.valid, before.valid)
    assert "came after a later one" in after.words[0] and "sensor" in after.words[0]


@pytest.mark.parametrize("back", [1.0, 1.5, 5.0, 200.0])
def test_behind_a_clock_that_was_set_back_the_order_stays(back):
    samples = run(np.random.default_rng(3))
    stamps = samples.stamps_ns.copy()
    stamps[2000:] -= round((back + 1) * 1e9 / RATE)
    same, late = in_order(Samples.of(stamps, samples.values))
    assert late == 0
    np.testing.assert_array_equal(same.stamps_ns, stamps)


def test_one_wrong_stamp_does_not_move_its_sample():
    samples = run(np.random.default_rng(4))
    stamps = samples.stamps_ns.copy()
    stamps[2000] = stamps[1990]
    assert in_order(Samples.of(stamps, samples.values))[1] == 0


@pytest.mark.parametrize("seed", range(5))
def test_in_blocks_as_in_one_piece(seed):
    rng = np.random.default_rng(seed)
    whole = run(rng)
    other = mixed(whole, rng, rng.uniform(0.2, 5) / RATE)
    names, late = list(range(len(whole.stamps_ns))), in_order(other)[1]
    order, parts, start = Reordering(), [], 0
    while start < len(names):
        stop = start + int(rng.integers(1, 300))
        rows = slice(start, stop)
        parts.append(order.add(other._replace(
            stamps_ns=other.stamps_ns[rows], values=other.values[rows],
            variance=other.variance[rows]), names[rows]))
        start = stop
    parts.append(order.rest())
    assert order.late == late
    np.testing.assert_array_equal(np.concatenate([s.stamps_ns for s, _ in parts]), whole.stamps_ns)
    np.testing.assert_array_equal(np.concatenate([s.values for s, _ in parts]), whole.values)
    place = np.concatenate([told for _, told in parts]).astype(int)
    np.testing.assert_array_equal(other.stamps_ns[place], whole.stamps_ns)
