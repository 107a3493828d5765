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
    assert "spikes, single steps of values coarser than the motion there, or shocks that the " \
        "reference cannot follow" in spikes_words(found.sum())
    assert spikes_words(1).startswith("1 sample stands ")


def test_a_value_that_is_rounded_the_other_way_is_no_spike():
    """At rest near a threshold of the lattice single samples are a step away."""
    rng, time = np.random.default_rng(0), np.arange(6000) / 100.0
    moves = (time > 20) & (time < 35)
    reference = np.convolve(rng.normal(size=6000), np.hanning(20), "same") * moves
    step = reference[moves].std()
    sensor = step * np.round(reference / step + 0.43 + 0.03 * rng.normal(size=6000))
    assert np.sum(np.abs(np.diff(sensor[:1900])) > 0) > 10
    assert not spikes(sensor, reference, step).any()
    sensor[500] += 3 * step
    assert spikes(sensor, reference, step)[500]
