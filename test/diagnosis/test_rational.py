"""Rational functions fitted to a response: exact ones found again, always stable and real."""

import numpy as np
import pytest

from frac_accel.diagnosis.rational import fit_rational


def modes(rng, pairs, real):
    """Poles of some modes and decays, as frequencies below one."""
    size, ratio = rng.uniform(0.1, 0.9, pairs), rng.uniform(0.02, 0.5, pairs)
    upper = size * (-ratio + 1j * np.sqrt(1 - ratio**2))
    return np.r_[upper, upper.conj(), -rng.uniform(0.05, 0.9, real)]


@pytest.mark.parametrize("seed", range(8))
def test_a_rational_function_is_found_again(seed):
    rng = np.random.default_rng(seed)
    pairs, real = seed % 4, 1 + seed % 2
    poles = modes(rng, pairs, real)
    numerator = rng.normal(size=len(poles) + 1)
    s = 1j * np.linspace(0.005, 1, 300)
    response = np.polyval(numerator, s) / np.polyval(np.real(np.poly(poles)), s)
    found = fit_rational(s, response, np.ones(len(s)), len(poles), 1e-3, (1e-3, 4.0))
    again = np.polyval(found[0], s) / np.polyval(found[1], s)
    assert np.max(np.abs(again - response)) < 1e-6 * np.max(np.abs(response))


@pytest.mark.parametrize("order", [1, 2, 5, 16])
def test_a_response_of_no_stable_filter_gets_one(order):
    """A lead, with noise: as near as it comes, and within the bounds."""
    rng = np.random.default_rng(order)
    s = 1j * np.linspace(0.005, 1, 200)
    response = np.exp(3 * s) + 0.1 * rng.normal(size=(200, 2)) @ [1, 1j]
    numerator, denominator = fit_rational(s, response, np.ones(200), order, 0.01, (0.01, 4.0))
    poles = np.roots(denominator)
    assert len(numerator) == len(denominator) == order + 1
    assert np.all(np.isreal(numerator)) and np.all(np.isreal(denominator))
    assert np.all(poles.real < -0.009) and np.all(np.abs(poles) < 4.1)
    left = response - np.polyval(numerator, s) / np.polyval(denominator, s)
    assert np.mean(np.abs(left)**2) < np.mean(np.abs(response - response.real.mean())**2)
