"""The budget of what remembers for long. Simulated here with numpy; the true shares are known."""

import numpy as np
import pytest
import scipy.signal as sig
from budget_cases import excitation, noise

from frac_accel.budget import error_budget

RATE = 200.0


def budget(residual, simulated, reference):
    if reference.ndim == 1:
        reference = np.c_[reference, np.zeros((len(reference), 2))]
    return error_budget(residual, simulated + residual, simulated, reference,
                        np.ones(len(residual), bool), RATE, 0)


def beside_noise(values, share, rng, colour=0.0):
    """A part with so much of the power, and noise with the rest."""
    return (np.sqrt(share) * values / np.sqrt(np.mean(values**2))
            + np.sqrt(1 - share) * noise(rng, len(values), colour))


@pytest.mark.parametrize("side", ["reference", "sensor"])
@pytest.mark.parametrize("seed", range(4))
def test_a_high_pass_far_below_the_motion_is_linear(seed, side):
    """Its memory is longer than any filter that is tried; a sweep, and noise from one octave up."""
    rng = np.random.default_rng([seed, 1])
    n = 12_000
    corner = rng.uniform(0.1, 0.4)
    t = np.arange(n + 4000) / RATE
    motion = np.sin(2 * np.pi * np.cumsum(np.geomspace(0.4, 20, len(t))) / RATE) if seed % 2 else \
        sig.sosfilt(sig.butter(2, [0.4, 30], "bandpass", fs=RATE, output="sos"), rng.normal(
            size=len(t)))
    passed = sig.sosfilt(sig.butter(1, corner, "highpass", fs=RATE, output="sos"), motion)
    motion, passed = motion[4000:], passed[4000:]
    reference, sensor = (passed, motion) if side == "reference" else (motion, passed)
    gain = reference @ sensor / (reference @ reference)
    share = rng.uniform(0.5, 0.95)
    e = 0.1 * beside_noise(sensor - gain * reference, share, rng)
    found = budget(e, gain * reference, reference)
    # the slowest motion cannot be told from a drift
    assert found.share("linear") + found.share("slow") == pytest.approx(share, abs=0.03)
    assert found.share("noise") == pytest.approx(1 - share, abs=0.03)


@pytest.mark.parametrize("colour", [0.999, 1.0])
@pytest.mark.parametrize("seed", range(4))
def test_noise_that_wanders_is_no_motion_that_was_summed(seed, colour):
    """Both are random walks: without guard against it the one fits the other."""
    rng = np.random.default_rng([seed, 2])
    reference, y = excitation(rng, 8000)
    e = sig.lfilter([1.0], [1.0, -colour], rng.normal(size=8000))
    found = budget(e - e.mean(), y, reference)
    assert found.share("linear") + found.share("time_varying") < 0.02
