"""A digital filter with uncertain coefficients: PyDynamic's numbers, and a Monte Carlo's."""

import numpy as np
import pytest

from frac_accel.errors import FracAccelError
from frac_accel.uncertainty import UncertainFilter


def random_filter(rng, order, zeros):
    poles = rng.uniform(0.2, 0.97, order // 2) * np.exp(1j * rng.uniform(0.1, 3, order // 2))
    poles = np.r_[poles, poles.conj(), rng.uniform(-0.9, 0.97, order % 2)]
    root = rng.normal(size=(order + zeros + 1, order + zeros + 1)) * 1e-3
    return rng.normal(size=zeros + 1), np.real(np.poly(poles)), root @ root.T


class Settable(np.ndarray):
    """PyDynamic assigns arrays of one element to elements, which numpy 2.4 refuses."""

    def __setitem__(self, key, value):
        super().__setitem__(key, np.asarray(value).item())


@pytest.mark.parametrize("seed", range(12))
def test_equal_to_pydynamic(seed):
    pydynamic = pytest.importorskip("PyDynamic.uncertainty.propagate_filter")
    rng = np.random.default_rng(seed)
    b, a, covariance = random_filter(rng, rng.integers(1, 5), rng.integers(0, 4))
    values, std = rng.normal(size=500) + 1, np.abs(rng.normal(size=500))
    expected, expected_std, _ = pydynamic.IIRuncFilter(
        values.view(Settable), std, b, a, Uab=covariance, kind="diag")
    uncertain = UncertainFilter(b, a, covariance, level=values[0], input_std=std[0])
    parts = [uncertain.process(values[i:j], std[i:j]) for i, j in ((0, 1), (1, 130), (130, 500))]
    output, output_std = (np.concatenate(part) for part in zip(*parts))
    np.testing.assert_allclose(output, expected, rtol=0, atol=1e-9 * np.abs(expected).max())
    np.testing.assert_allclose(output_std, expected_std, rtol=1e-9)


def test_equal_to_a_monte_carlo_of_coefficients_and_noise():
    rng = np.random.default_rng(5)
    b, a, covariance = random_filter(rng, 2, 2)
    b = b + 2
    values = np.sin(np.arange(60) / 5)
    _, std = UncertainFilter(b, a, covariance).process(values, 0.003)
    from scipy.signal import lfilter
    root = np.linalg.cholesky(covariance)
    draws = []
    for _ in range(20_000):
        change = root @ rng.normal(size=5)
        draws.append(lfilter(b + change[2:], a + np.r_[0, change[:2]],
                             values + 0.003 * rng.normal(size=60)))
    np.testing.assert_allclose(std, np.std(draws, axis=0), rtol=0.05)


@pytest.mark.parametrize("b, a, covariance, words", [
    ([1.0], [2.0, 0.5], None, "a: "), ([1.0], [1.0, -1.0], None, "not stable"),
    ([1.0], [1.0, -0.5], np.eye(3), "covariance: shape")])
def test_bad_filters_are_refused(b, a, covariance, words):
    with pytest.raises(FracAccelError, match=words):
        UncertainFilter(b, a, covariance)
