"""A soft mount, and no model: the sensor's own resonance would need a lead, which none has."""

import numpy as np
import pytest
from sampled_pair import sampled_pair
from scipy.signal import bilinear, butter, lfilter, sosfiltfilt

from frac_accel import diagnose

RATE, COUNT, FINER = 400.0, 12_000, 32


def on_a_mount(rng):
    """Reference and sensor on a spring and damper, and the mount's frequency and damping ratio."""
    frequency_hz, damping_ratio = rng.uniform(90, 150), rng.uniform(0.08, 0.2)
    fine, omega = FINER * RATE, 2 * np.pi * frequency_hz
    motion = sosfiltfilt(butter(2, [2, 60], "band", fs=fine, output="sos"),
                         rng.normal(size=FINER * COUNT))
    motion *= 2.0 / motion.std()
    damper = 2 * damping_ratio * omega
    felt = lfilter(*bilinear([damper, omega**2], [1, damper, omega**2], fine), motion)
    pair = sampled_pair(rng, (motion, felt), FINER, RATE, 0.002)
    return pair, frequency_hz, damping_ratio


@pytest.mark.parametrize("seed", range(3))
def test_a_soft_mount_is_no_oscillator_with_a_lead(seed):
    pair, frequency_hz, damping_ratio = on_a_mount(np.random.default_rng(seed))
    found, = diagnose(pair, time_limit_s=60).findings
    assert found.cause == "mounting_resonance"
    assert found.effect.frequency_hz == pytest.approx(frequency_hz, rel=1e-3)
    assert found.effect.damping_ratio == pytest.approx(damping_ratio, rel=0.01)
