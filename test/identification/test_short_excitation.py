"""A short record of many frequencies is not taken for one sine, nor one sine for many."""

import numpy as np
import pytest

from frac_accel.errors import IdentificationError
from frac_accel.identification.response.excitation import (
    held_out,
    persistent_excitation,
    require_excitation,
)

RATE = 500.0


@pytest.mark.parametrize("seed", range(6))
def test_a_short_sweep_excites_more_than_one_frequency(seed):
    rng = np.random.default_rng(seed)
    time = np.arange(int(rng.uniform(2.5, 4.0) * RATE)) / RATE
    first, last = rng.uniform(4.0, 6.0), rng.uniform(10.0, 14.0)
    sweep = np.sin(2 * np.pi * (first * time + (last - first) / 2 * time**2 / time[-1]))
    require_excitation(sweep + 1e-3 * rng.standard_normal(len(time)), RATE, 4)


@pytest.mark.parametrize("seed", range(6))
def test_one_sine_stays_one(seed):
    rng = np.random.default_rng(seed)
    time = np.arange(int(rng.uniform(2.5, 4.0) * RATE)) / RATE
    # switched on and off slowly, as an exciter is
    rise = np.minimum(1, np.minimum(time, time[-1] - time) / 0.5)
    sine = rise * np.sin(2 * np.pi * rng.uniform(8, 60) * time) \
        + 1e-3 * rng.standard_normal(len(time))
    assert persistent_excitation(sine, RATE)[0] == 2
    with pytest.raises(IdentificationError, match="excites only"):
        require_excitation(sine, RATE, 4)


@pytest.mark.parametrize("seed", range(4))
def test_a_record_that_ends_with_a_shock_is_judged_on_more_than_it(seed):
    """It has two fifths of the energy and more, in a hundredth of the record."""
    rng = np.random.default_rng(seed)
    motion = rng.standard_normal(6000)
    strike = slice(-int(rng.integers(20, 60)), None)
    motion[strike] *= np.sqrt(rng.uniform(1.0, 3.0) * 6000 / -strike.start)
    judged = held_out(motion)
    assert 0.2 < judged.mean() < 0.8
    assert 0.2 < judged[strike].mean() < 0.8
