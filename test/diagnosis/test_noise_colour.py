"""How far one fit is ahead of another, in noise of any colour: against what made the noise."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

from frac_accel.diagnosis.noise_colour import lead, noise_peak

COUNT = 40_000


def fit(residual, motion):
    return SimpleNamespace(residual=residual, simulated=motion, unknowns=(), jacobian=None)


def quiet_misfit(rng, share=slice(None)):
    """Noise whose density falls by 1e4 over the frequency, and a misfit where it is quiet."""
    motion = rng.normal(size=COUNT)
    noise = lfilter([1.0], [1.0, -0.98], rng.normal(size=COUNT))
    misfit = np.zeros(COUNT)
    misfit[share] = 0.05 * lfilter([1, -2, 1], 4.0, rng.normal(size=COUNT))[share]
    return motion, noise, misfit


@pytest.mark.parametrize("seed", range(4))
def test_a_misfit_counts_by_the_noise_where_it_is(seed):
    motion, noise, misfit = quiet_misfit(np.random.default_rng([71, seed]))
    used = np.ones(COUNT, bool)
    # the filter that makes the noise, undone, leaves it white
    exact = np.sum(lfilter([1.0, -0.98], [1.0], misfit)**2)
    found = lead(fit(noise, motion), fit(noise + misfit, motion), used)
    assert noise_peak(noise) > 20
    assert found == pytest.approx(exact, abs=5 * 2 * np.sqrt(exact) + 0.1 * exact)
    assert lead(fit(noise + misfit, motion), fit(noise, motion), used) == pytest.approx(-found)


@pytest.mark.parametrize("seed", range(4))
def test_what_happens_once_is_no_lead(seed):
    """A record's start made an offset a zero that settles within a second."""
    motion, noise, misfit = quiet_misfit(np.random.default_rng([72, seed]), slice(0, 2000))
    found = lead(fit(noise, motion), fit(noise + misfit, motion), np.ones(COUNT, bool))
    assert found is None or abs(found) < 1
