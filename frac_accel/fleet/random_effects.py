"""Mean of estimates that differ by more than their uncertainties: the random-effects model."""

from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq
from scipy.special import stdtr, stdtrit

# Two-sided coverage of the interval.
_COVERAGE = 0.95
# Spread, in the largest deviation of the estimates, within which its equation is solved.
_WIDEST = 10.0


class Pooled(NamedTuple):
    """Hierarchical mean of some estimates.

    Attributes
    ----------
    mean, std : float
        Mean and its standard uncertainty.
    low, high : float
        95 % interval of the mean.
    spread : float
        Standard deviation of the true values between the estimates' owners.
    p_value : float
        Two-sided, of a mean of zero.
    count : int
    """

    mean: float
    std: float
    low: float
    high: float
    spread: float
    p_value: float
    count: int


def pool(values, stds, freedom=0):
    r"""Hierarchical mean :math:`\mu` of :math:`y_i \sim N(\mu, s_i^2 + \tau^2)`.

    The spread is that of Paule and Mandel, for which the weighted squares have their expected
    value. Mean and interval are those of Hartung and Knapp, with Student's t of n - 1 degrees of
    freedom, and the factor of the variance not below one (G. Knapp, J. Hartung, *Statistics in
    Medicine* 22 (2003) 2693-2710; A. L. Rukhin, *Metrologia* 46 (2009) 323-331 on the spread).

    Parameters
    ----------
    values, stds : ndarray, shape (n,)
        At least two; standard uncertainties above 0.
    freedom : float
        Degrees of freedom by which it is known from elsewhere that, where there is no effect,
        estimates scatter no more than `stds` say; it counts for the test alone.

    Returns
    -------
    Pooled
    """
    values, stds = np.asarray(values, float), np.asarray(stds, float)
    count = len(values)
    spread = _spread(values, stds**2)
    weight = 1 / (stds**2 + spread**2)
    mean = weight @ values / weight.sum()
    factor = max(weight @ (values - mean)**2 / (count - 1), 1.0)
    std = np.sqrt(factor / weight.sum())
    reach = stdtrit(count - 1, (1 + _COVERAGE) / 2) * std
    p_value = 2 * stdtr(max(count - 1, freedom), -abs(mean) / std)
    return Pooled(float(mean), float(std), float(mean - reach), float(mean + reach), float(spread),
                  float(p_value), count)


def _spread(values, variances):
    """Root of the between variance that solves Paule's and Mandel's equation."""
    def excess(between):
        weight = 1 / (variances + between)
        mean = weight @ values / weight.sum()
        return weight @ (values - mean)**2 - (len(values) - 1)
    if excess(0.0) <= 0:
        return 0.0
    return float(np.sqrt(brentq(excess, 0.0, _WIDEST * np.ptp(values)**2)))
