"""What the lattice of a topic's values tells."""

import numpy as np
import pytest

from frac_accel.record.lattice import lattice_step, stuck_bit


def quantised(rng, bits=10):
    """Motion over some hundred levels, and its step."""
    step = 10 ** rng.uniform(-3, 1)
    walk = np.convolve(rng.normal(size=6000), np.ones(20), "same")
    return np.round(walk / np.abs(walk).max() * 2 ** (bits - 1)).astype(np.int64), step


@pytest.mark.parametrize("is_set", [False, True])
@pytest.mark.parametrize("seed", range(5))
def test_a_bit_that_is_stuck_is_found(seed, is_set):
    rng = np.random.default_rng([31, seed])
    counts, step = quantised(rng)
    bit = 1 << int(rng.integers(1, 7))
    values = step * (counts | bit if is_set else counts & ~bit)
    assert stuck_bit(values, lattice_step(values)) == pytest.approx(bit * step)


@pytest.mark.parametrize("seed", range(5))
def test_values_that_change_all_their_bits_have_none(seed):
    rng = np.random.default_rng([32, seed])
    counts, step = quantised(rng)
    # all of them; resting in two places; around zero only; no lattice
    for some in (counts, np.where(np.arange(len(counts)) % 2, counts % 8, 1024 + counts % 8),
                 counts % 8 - 4):
        assert stuck_bit(step * some, lattice_step(step * some)) is None
    assert stuck_bit(rng.normal(size=1000), None) is None
