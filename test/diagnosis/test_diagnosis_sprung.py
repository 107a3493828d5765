"""A sensor far below its resonance, where it is linear as a gain with a delay is, but whose spring
is bent."""

import numpy as np
import pytest
from rig.oscillator import integrate
from scipy.signal import chirp

import frac_accel

RATE, FINE, SAMPLES = 1000.0, 16, 12_000


@pytest.mark.parametrize("seed", [1, 2])
def test_a_bent_spring_far_above_the_motion_is_named(seed):
    rng = np.random.default_rng(seed)
    time = np.arange(SAMPLES * FINE) / (RATE * FINE)
    base = 6.0 * chirp(time, 6.0, time[-1], 190.0, "logarithmic", phi=-90)
    base *= np.clip(np.minimum(time, time[-1] - time) / 0.3, 0, 1)
    f0, zeta = rng.uniform(380, 440), rng.uniform(0.6, 0.72)
    motion = integrate(np.append(base, base[-1]), 1 / (RATE * FINE), f0, zeta,
                       alpha3=rng.uniform(0.002, 0.004)).q[:len(base)]
    noisy = [values[::FINE] + 0.004 * values.std() * rng.standard_normal(SAMPLES)
             for values in (base, motion)]
    found = frac_accel.diagnose(tuple(noisy), sampling_rate_hz=RATE, time_limit_s=60.0)
    assert [finding.cause for finding in found.findings] == ["cubic_stiffness"]
    assert found.extended["nrmse"] < 0.02


@pytest.mark.parametrize("seed", [11, 12, 13])
def test_an_oscillator_that_a_smoothing_gain_imitates_is_found(seed):
    """Much damping of another order looks like a moving average in slow steps of frequency."""
    rng = np.random.default_rng(seed)
    time = np.arange(8000 * FINE) / (RATE * FINE)
    base = 10.0 * chirp(time, rng.uniform(300, 330), time[-1], 6.0, "logarithmic", phi=-90)
    base *= np.clip(np.minimum(time, time[-1] - time) / 0.3, 0, 1)
    f0, zeta, order = rng.uniform(180, 220), rng.uniform(0.5, 0.65), rng.uniform(0.75, 0.85)
    motion = integrate(np.append(base, base[-1]), 1 / (RATE * FINE), f0, zeta, order).q[:len(base)]
    noisy = [values[::FINE] + share * values.std() * rng.standard_normal(8000)
             for share, values in ((0.0, base), (0.004, motion))]
    found = frac_accel.diagnose(tuple(noisy), sampling_rate_hz=RATE, time_limit_s=60.0)
    finding, = found.findings
    assert finding.cause == "fractional_damping"
    assert abs(finding.effect.damping_order - order) < 4 * finding.std["damping_order"] < 0.01
    assert found.extended["nrmse"] < 0.005
