"""What the time before a record may have left of a fractional sensor's motion, and no more."""

import numpy as np
import pytest
from rig.excitation import band_noise
from rig.oscillator import integrate

from frac_accel.model import AxisModel
from frac_accel.model.core import Oscillator
from frac_accel.simulation.free_motion import free_motions, shares_within

RATE, LASTS_S = 1000.0, 4.0


@pytest.mark.parametrize("seed", range(301, 309))
def test_a_tail_stays_within_its_bounds_and_a_drift_does_not(seed):
    rng = np.random.default_rng(seed)
    f0, zeta, order = rng.uniform(20, 120), rng.uniform(0.1, 0.8), rng.choice(
        [rng.uniform(0.2, 0.9), rng.uniform(1.1, 1.7)])
    moved = band_noise(rng, RATE, LASTS_S, (1.0, 200.0))
    shaken, every = moved.acceleration[0], moved.oversampling
    motion = integrate(np.r_[shaken, np.zeros(len(shaken) - 1)], moved.step_s, f0, zeta, order).q
    before, after = np.split(motion, [len(shaken)])
    before, after = before[::every], after[::every]
    time_s = np.arange(len(after)) / RATE
    columns, most = free_motions(AxisModel(Oscillator(f0, zeta, order), ()), time_s,
                                 np.ones(len(after), bool))
    level = np.sqrt(np.mean(before**2))
    left = after - columns @ shares_within(columns, most, level, after)
    assert np.std(left) < 1e-4 * level

    # a drift as large as the motion is no memory of it
    drift = level * np.sin(2 * np.pi * time_s / time_s[-1])
    left = drift - columns @ shares_within(columns, most, level, drift)
    loose = drift - columns @ np.linalg.lstsq(columns, drift, rcond=1e-6)[0]
    assert np.std(loose) < 0.5 * np.std(drift)
    assert np.std(left) > 0.8 * np.std(drift)
