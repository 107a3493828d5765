"""Which instants samples belong to whose stamps scatter, where messages are lost in runs."""

import numpy as np
import pytest

from frac_accel.record.clock import Clock


@pytest.mark.parametrize("seed, scatter, lost", [
    (1, 0.15, 0.02), (2, 0.15, 0.1), (3, 0.2, 0.02), (4, 0.2, 0.1), (5, 0.2, 0.0)])
def test_nearly_every_sample_gets_its_own_instant(seed, scatter, lost):
    rng = np.random.default_rng(seed)
    kept = np.ones(20_000, bool)
    while np.mean(~kept) < lost:
        start = rng.integers(5, len(kept) - 40)
        kept[start:start + rng.geometric(0.3)] = False
    slot = np.flatnonzero(kept)
    stamps = np.maximum.accumulate(slot + rng.normal(0, scatter, len(slot)))
    clock = Clock.of(np.round(1e7 * stamps).astype(np.int64) + np.arange(len(stamps)))
    away = clock.slot - slot
    # a stamp that is off by more than half an interval beside a gap tells the wrong one
    assert clock.kind == "regular" and np.mean(away != np.median(away)) < 1e-3
