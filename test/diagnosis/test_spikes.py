"""Samples that stand far out while the reference does not."""

import numpy as np

from frac_accel.diagnosis.spikes import spikes, spikes_words


def test_a_shock_that_a_smooth_reference_cannot_follow_is_not_called_a_spike_only():
    time = np.arange(2000) / 200.0
    reference = np.sin(2 * np.pi * 1.5 * time)
    sensor = reference + 0.05 * np.random.default_rng(1).normal(size=len(time))
    sensor[200::400] += 20.0
    found = spikes(sensor, reference)
    assert found[200::400].all()
    assert "spikes, or shocks that the reference cannot follow" in spikes_words(found.sum())
    assert spikes_words(1).startswith("1 sample stands ")
