"""Springs so strong that no linear core is near the sensor's own.

The motion is the rig's; each record begins in its middle, as a logger that is switched on does.
"""

import numpy as np
import pytest
from rig.oscillator import integrate

import frac_accel

RATE, FINE, BEFORE, SAMPLES = 610.0, 32, 1000, 8000


def strong(seed, quadratic):
    """Diagnosis, without a model, of a record with a random spring, and that spring."""
    rng = np.random.default_rng(seed)
    f0, zeta = rng.uniform(60, 75), rng.uniform(0.04, 0.06)
    alpha2, alpha3 = quadratic * rng.uniform(0.01, 0.03), rng.uniform(0.02, 0.04)
    n = (BEFORE + SAMPLES) * FINE
    frequency = np.fft.rfftfreq(n, 1 / (RATE * FINE))
    band = (frequency > 1) & (frequency < 200)
    base = np.fft.irfft(band * np.exp(2j * np.pi * rng.random(len(band))), n)
    base *= np.minimum(np.arange(n) / (0.5 * BEFORE * FINE), 1) / base.std()
    motion = integrate(np.append(base, base[-1]), 1 / (RATE * FINE), f0, zeta, alpha2=alpha2,
                       alpha3=alpha3).q[:n]
    rows = slice(BEFORE * FINE, None, FINE)
    reference, output = base[rows], motion[rows]
    noisy = [values + share * values.std() * rng.standard_normal(SAMPLES)
             for values, share in ((reference, 3e-4), (output, 1e-3))]
    found = frac_accel.diagnose(tuple(noisy), sampling_rate_hz=RATE, time_limit_s=60.0)
    return found, alpha2, alpha3


@pytest.mark.parametrize("seed", [3601, 3602, 3603])
@pytest.mark.parametrize("quadratic", [1, 0])
def test_a_strong_spring_is_named_and_leaves_only_noise(seed, quadratic):
    found, alpha2, alpha3 = strong(seed, quadratic)
    assert found.baseline["nrmse"] > 0.3
    causes = {finding.cause: finding for finding in found.findings}
    assert causes.keys() == {"cubic_stiffness"} | ({"quadratic_stiffness"} if quadratic else set())
    assert causes["cubic_stiffness"].effect.alpha3 == pytest.approx(alpha3, rel=0.005)
    if quadratic:
        assert causes["quadratic_stiffness"].effect.alpha2 == pytest.approx(alpha2, rel=0.02)
    assert found.verdict == "explained"
    assert found.extended["nrmse"] < 0.003


@pytest.mark.parametrize("quadratic", [1, pytest.param(0, marks=pytest.mark.long)])
def test_a_motion_that_hardly_repeats_itself_gets_no_other_name(quadratic):
    """So strong that a simulation from a start that is a little off is another motion: a part of
    it may stay without a name, but a resonance was named for it."""
    found, _, _ = strong(3604, quadratic)
    assert {finding.cause for finding in found.findings} <= {
        "cubic_stiffness", "quadratic_stiffness"}
